"""How fast: every number with its rival and the machine's limits from the same run.

    .venv/bin/python workflows/benchmark.py [--quick] [--out DIR]

Medians after a warm-up, compiling apart. Prints a table and writes benchmark.json. Nothing here
passes or fails by a clock: the column `aim` is the project's aim, to be read beside what this
machine gave.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numba
from benchmark_grids import grid_rows
from benchmark_particles import particle_rows
from benchmark_start import start_rows
from benchmark_tools import Row, Sizes, limits

from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.output.tables import print_table

PARTS: tuple[Callable[[Sizes], Iterator[Row]], ...] = (particle_rows, grid_rows, start_rows)


@contextmanager
def own_threads() -> Iterator[None]:
    """Whatever number of threads a row leaves behind, the next one has the machine's."""
    before = numba.get_num_threads()
    try:
        yield
    finally:
        numba.set_num_threads(before)


def main(arguments: Sequence[str] | None = None) -> Path:
    """Measure everything; returns the path of benchmark.json."""
    parser = argparse.ArgumentParser(description="kernels, rivals and the machine's limits")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: the numbers mean nothing")
    parser.add_argument("--out", type=Path, help="folder of benchmark.json")
    options = parser.parse_args(arguments)
    folder = options.out or Path("results") / time.strftime("benchmark-%Y%m%d-%H%M%S")
    folder.mkdir(parents=True, exist_ok=True)
    sizes = Sizes.quick() if options.quick else Sizes()
    rows: list[Row] = []
    with ProgressReporter() as report:
        machine = limits(sizes)
        for part in PARTS:
            with own_threads():
                for row in part(sizes):
                    report(row.work, 1.0)
                    rows.append(row)
    title = ", ".join(f"{name} {value:.3g}" for name, value in machine.items())
    columns = ("work", "aim", "measured", "beside it")
    print_table(f"{os.cpu_count()} cores; {title}", columns, [row.words for row in rows])
    path = folder / "benchmark.json"
    table = {
        "machine": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "limits": machine,
        "rows": [row._asdict() for row in rows],
    }
    with whole_file(path) as beside:
        beside.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{folder}\n")
    return path


if __name__ == "__main__":
    run_in_words(main)
