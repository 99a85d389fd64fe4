"""`ellipsoid report`: finished runs and comparisons as one HTML page."""

from __future__ import annotations

from ellipsoid_coupling.options import Names, Output, print_lines
from ellipsoid_coupling.output.progress import ProgressReporter

_OUTPUT = Output()


def report(runs: Names, /, *, output: Output = _OUTPUT) -> None:
    """Put finished runs and comparisons on one HTML page; without --out into results/....

    The page holds its pictures and needs no network. It says what ran and what was left out, shows the
    pictures of `figures`, numbers over time, errors, what bounded the steps, and how to repeat each run.
    Nothing is simulated or solved.

    Parameters
    ----------
    runs
        Run folders, shown side by side, and folders that `ellipsoid compare` wrote.
    """
    from ellipsoid_coupling.output.report import load_sources, write_report

    output.check()
    with ProgressReporter("report") as progress:
        made, comparisons = load_sources(runs)
        with output.folder("report") as folder:
            path = write_report(made, comparisons, folder, progress)
    print_lines(str(path))
