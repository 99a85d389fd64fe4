"""Every limit on the size of what a user may give, each with its reason, in one place.

Files are limited so that reading one cannot fill the memory or take minutes; runs are limited by what
the machine has.
"""

from __future__ import annotations

import contextlib
import os
import resource
from pathlib import Path

# A scene is a page of text, the longest list of save times included.
MOST_SCENE_BYTES = 1_000_000
# tomllib and OpenFOAM read nested parts by recursion; a scene has two levels, a case about six.
MOST_NESTING = 50
# One file of a case, unpacked: faces of a plane mesh of a million cells in ascii.
MOST_CASE_FILE_BYTES = 256_000_000
# What a case's dictionaries, without mesh and solution, hold together, and how many files.
MOST_DICTIONARY_BYTES = 50_000_000
MOST_DICTIONARIES = 2_000
# A saved flow: the spline on 400 x 400 cells takes 1.5 MB; this is one on 5000 x 5000.
MOST_FLOW_BYTES = 250_000_000
# Times of a solved case that are looked at to find the last one.
MOST_TIMES = 100_000
# Numbers beyond these leave double precision when multiplied: lengths go in squared, U in products.
LARGEST_NUMBER = 1e100
SMALLEST_NUMBER = 1e-100
# VTK hands fields over in single precision, whose squares must stay finite as well.
LARGEST_IN_A_CASE = 1e18
# More of anything fits into no machine; products of two such counts still are floats.
MOST_COUNT = 10**18
# A step's error in lengths and radian: double precision keeps no place to less, so no step is short
# enough for less.
LEAST_TOLERANCE = 1e-14
# Times a million more steps than grids need; below, a run does not end.
LEAST_CFL = 1e-6
# A hundredth of a degree in [0, 2 pi); the paper has 60.
MOST_ANGLE_CELLS = 36_000
# numpy's generators are seeded by 64 bits; TOML's whole numbers have 63.
MOST_SEED = 2**63 - 1
# A step that is a smaller part of the end time no longer changes the clock.
SMALLEST_STEP = 1e-15
# Names become file names; systems allow 255 bytes, and numbers and endings are added.
MOST_NAME = 100
# A title stands above a figure.
MOST_LINE = 300
# What systems allow for a path, bytes.
MOST_PATH = 4096
# What icoFoam takes for a cell, measured at 200 x 200.
BYTES_PER_FLUID_CELL = 1_500

# Seconds: a run whose end is further away at its present pace stops, unless it is given more.
LONGEST_RUN = 30 * 86_400.0

_CONTROL_GROUP = Path("/sys/fs/cgroup/memory.max")


def memory_limit() -> int:
    """The bytes that this process may take: the machine's, its container's or its shell's limit."""
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY:
        limits.append(soft)
    with contextlib.suppress(OSError, ValueError):  # no such limit
        limits.append(int(_CONTROL_GROUP.read_text(encoding="ascii")))
    return min(limits)


def in_words(size: float) -> str:
    """A number of bytes for a message: 12 bytes, 3.5 MB, 8e+03 TB."""
    for unit, name in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= unit:
            return f"{size / unit:.3g} {name}"
    return f"{size:.0f} bytes"


def time_in_words(seconds: float) -> str:
    """A time for a message: 12 s, 3.5 hours, 40 days, 8e+03 years."""
    for unit, name in ((365.25 * 86_400, "years"), (86_400, "days"), (3600, "hours"), (60, "min")):
        if seconds >= 2 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.3g} s"
