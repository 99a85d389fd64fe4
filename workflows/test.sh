#!/usr/bin/env bash
# Formatting, lint, types and tests, on a clean checkout too.
#   bash workflows/test.sh            everything but the long validation
#   bash workflows/test.sh -m heavy   the long validation; other pytest arguments likewise
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. workflows/setup.sh
.venv/bin/ruff check .
.venv/bin/ruff format --check .
.venv/bin/mypy
exec .venv/bin/python -m pytest "$@"
