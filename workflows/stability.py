"""The stability map: stiff and extreme cases, every model and both schemes.

    .venv/bin/python workflows/stability.py [--quick] [--out DIR] [--force]

Leaves stability.csv, the map as a picture and index.html, which explains it, in one folder: what
`ellipsoid stability` does. `--quick` takes a third of the cases.
"""

from __future__ import annotations

import sys

from ellipsoid_coupling.cli import main

if __name__ == "__main__":
    main(["stability", *sys.argv[1:]])
