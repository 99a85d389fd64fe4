#!/usr/bin/env bash
# Formatting, lint, types and tests, on a clean checkout too.
#   bash workflows/test.sh            everything but the long validation
#   bash workflows/test.sh -m heavy   the long validation; other pytest arguments likewise
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. workflows/setup.sh
# One test looks at the paper's page in a browser; without one it checks the files only.
command -v chromium >/dev/null || install_system chromium || say "chromium is not installed: apt-get install chromium"
.venv/bin/ruff check .
.venv/bin/ruff format --check .
.venv/bin/mypy
# Everything: a worker a core, up to four; files in the order of tests/conftest.py, long ones first.
# Some tests alone (benchmarks, say): one.
workers=$(nproc)
[ $# -gt 0 ] && workers=0
exec .venv/bin/python -m pytest -n "$((workers > 4 ? 4 : workers))" --dist loadfile --no-loadscope-reorder "$@"
