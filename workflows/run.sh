#!/usr/bin/env bash
# The main job, end to end: ellipsoids in the driven cavity, from icoFoam to pictures.
#   bash workflows/run.sh           a small version, about two minutes
#   bash workflows/run.sh --full    the paper's numbers, below eight minutes on two cores
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. workflows/setup.sh
exec .venv/bin/python workflows/cavity.py "$@"
