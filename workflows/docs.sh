#!/usr/bin/env bash
# The documentation, as HTML: pages, gallery and pictures from today's code, without a warning.
#   bash workflows/docs.sh                   everything; the examples of the gallery run
#   bash workflows/docs.sh --without-running the pages alone, in half a minute
#   bash workflows/docs.sh --out DIR         into another folder than results/docs
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. workflows/setup.sh
make_documentation_tools
exec .venv/bin/python workflows/docs/build.py "$@"
