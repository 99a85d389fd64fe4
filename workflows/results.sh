#!/usr/bin/env bash
# Every number and picture of the documentation's results anew, stamped with date, machine and commit.
#   bash workflows/results.sh                        an hour on a quiet machine
#   bash workflows/results.sh --only frontier ...    some of: cavity flows paper frontier advice stability
#                                                    benchmark cases
#   bash workflows/results.sh --quick --pages DIR    tiny sizes, which mean nothing, into another folder
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. workflows/setup.sh
exec .venv/bin/python workflows/results.py "$@"
