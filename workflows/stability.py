"""The stability map: stiff and extreme cases, every model and both schemes.

    .venv/bin/python workflows/stability.py [--quick] [--out DIR]

Leaves stability.csv, the map as a picture and index.html, which explains it, in one folder. `--quick`
takes a third of the cases.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling import EllipsoidError
from ellipsoid_coupling.compare.stability import chosen_cases, map_stability
from ellipsoid_coupling.output.stability_report import report_stability
from ellipsoid_coupling.progress import ProgressReporter


def main(arguments: Sequence[str] | None = None) -> Path:
    """Make the map; returns the folder with the results."""
    parser = argparse.ArgumentParser(description="stability map of all models and schemes")
    parser.add_argument("--quick", action="store_true", help="a third of the cases")
    parser.add_argument("--out", type=Path, help="folder of the results")
    options = parser.parse_args(arguments)
    folder = options.out or Path("results") / time.strftime("stability-%Y%m%d-%H%M%S")
    cases = chosen_cases(quick=options.quick)
    with ProgressReporter() as report:
        fields = map_stability(cases, report=report)
    report_stability(fields, cases, folder)
    sys.stdout.write(f"{folder}\n")
    return folder


if __name__ == "__main__":
    try:
        main()
    except EllipsoidError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_status)
