"""Every limit on the size of a user's input, with its reason.

Files are limited so that reading one cannot fill the memory or take minutes; runs are limited by the
machine's memory.
"""

from __future__ import annotations

import contextlib
import os
import re
import resource
from functools import cache
from pathlib import Path

# A scene is a page of text, the longest list of save times included.
MOST_SCENE_BYTES = 1_000_000
# tomllib and OpenFOAM read nested parts by recursion; a scene has two levels, a case about six.
MOST_NESTING = 50
# One file of a case, unpacked: faces of a plane mesh of a million cells in ascii.
MOST_CASE_FILE_BYTES = 256_000_000
# A dictionary or list of patches of a case: pages of text; 4 MB are scanned in a second or two.
MOST_DICTIONARY_BYTES = 4_000_000
# Points, faces or cells of a mesh: a plane one of a million cells has four million faces.
MOST_MESH_ENTRIES = 5_000_000
# Patches of a mesh: every one is compared with every edge of the rim.
MOST_PATCHES = 1_000
# Files of a case that a run starts from, those that no solver reads included.
MOST_CASE_FILES = 2_000
# Entries and values of a dictionary that a run starts from, lists of numbers apart; as many as 1 MB has.
MOST_PARTS = 250_000
# Time steps of a flow: a plane one comes to rest in thousands.
MOST_FLOW_STEPS = 1_000_000
# Times that a run may leave on the disk: fifty periods of twenty.
MOST_WRITTEN_TIMES = 1_000
# The log of an OpenFOAM program: icoFoam writes 400 bytes a time step.
MOST_LOG_BYTES = 1_000_000_000
# A field at the start of a run, unpacked: U of a plane mesh of a million cells in ascii.
MOST_START_BYTES = 30_000_000
# A saved flow: the spline on 400 x 400 cells takes 1.5 MB; this is one on 5000 x 5000.
MOST_FLOW_BYTES = 250_000_000
# The same at several times: an archive's list of contents has no room for more bytes, or for more arrays.
MOST_SERIES_BYTES = 4_000_000_000
MOST_SERIES_TIMES = 10_000
# Arrays of one: eleven, and three of a series; those of a checkpoint: some ten for every save time.
MOST_FLOW_ARRAYS = 14
MOST_CHECKPOINT_ARRAYS = 200_000
# A yardstick, unpacked: 256 groups of bins at 100 times take 47 MB.
MOST_YARDSTICK_BYTES = 100_000_000
# Times of a solved case that are looked at to find the last one.
MOST_TIMES = 100_000
# The tables of a comparison: a hundred runs at a hundred times take 3 MB.
MOST_TABLE_BYTES = 20_000_000
# Pictures of a comparison that a report shows, and the bytes of one; ours take 0.2 MB.
MOST_PICTURES = 50
MOST_PICTURE_BYTES = 10_000_000
# A GIF is put together in memory, where a frame takes about a megabyte.
MOST_GIF_FRAMES = 1_000
# Numbers beyond these leave double precision when multiplied: lengths go in squared, U in products.
LARGEST_NUMBER = 1e100
SMALLEST_NUMBER = 1e-100
# VTK hands fields over in single precision, whose squares must stay finite as well.
LARGEST_IN_A_CASE = 1e18
# No machine holds more of anything; the product of two such counts still is a float.
MOST_COUNT = 10**18
# A step's error in lengths and radian: rounding of positions in double precision is as large, so no step is
# short enough for less.
LEAST_TOLERANCE = 1e-14
# Rounding alone is 1e-13 of the largest force where a series of some hundred harmonics is summed.
LEAST_HARMONICS_TOLERANCE = 1e-12
# A run with less takes more than a million times the steps that a grid needs, and does not end.
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
# Bytes of a path that systems allow.
MOST_PATH = 4096
# Memory of icoFoam for each cell, measured at 200 x 200.
BYTES_PER_FLUID_CELL = 1_500

# Seconds: a run whose end is further away at its present pace stops, unless it is given more.
LONGEST_RUN = 30 * 86_400.0

_PROCESS = Path("/proc/self")
# The limits of a shell's `ulimit`, and the line of /proc/self/status with the bytes in use.
_SHELL = ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData"))


def memory_limit() -> int:
    """The bytes that this process may take: the machine's, its containers' or its shell's limit."""
    return min(limit for limit, _ in _memory_limits())


def memory_left() -> int:
    """The bytes that this process may take in addition to those it has."""
    status = _read(_PROCESS / "status")
    taken = {key: 1024 * int(size) for key, size in re.findall(r"(Vm\w+):\s+(\d+) kB", status)}
    return max(min(limit - taken.get(key, 0) for limit, key in _memory_limits()), 0)


def _memory_limits() -> list[tuple[int, str]]:
    """Every limit in bytes, and the line of /proc/self/status that counts towards it."""
    limits = [(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), "VmRSS")]
    shell = [(resource.getrlimit(kind)[0], key) for kind, key in _SHELL]
    limits += [(soft, key) for soft, key in shell if soft != resource.RLIM_INFINITY]
    for path in _control_groups(_PROCESS):
        with contextlib.suppress(ValueError):  # "max", or no such file
            limits.append((int(_read(path)), "VmRSS"))
    return limits


@cache
def _control_groups(process: Path) -> tuple[Path, ...]:
    """The files that may hold a limit: of the process's own groups and of all above them, looked up once.

    Version 2 has one tree, version 1 one of them for memory. Within a container the mount may show a
    part of the tree only: groups whose path leads nowhere there are passed over.
    """
    mounts = {}
    for line in _read(process / "mountinfo").splitlines():
        before, _, after = line.partition(" - ")
        kind, _, options = after.partition(" ")
        if kind == "cgroup2" or (
            kind == "cgroup" and "memory" in options.split(" ")[-1].split(",")
        ):
            mounts[kind] = Path(before.split(" ")[4])
    files = list[Path]()
    for line in _read(process / "cgroup").splitlines():
        number, _, rest = line.partition(":")
        controllers, _, name = rest.partition(":")
        kind = "cgroup2" if number == "0" else "cgroup"
        if kind in mounts and (kind == "cgroup2" or "memory" in controllers.split(",")):
            mount = mounts[kind]
            group = mount / name.lstrip("/")
            file = "memory.max" if kind == "cgroup2" else "memory.limit_in_bytes"
            files += [p / file for p in (group, *group.parents) if p.is_relative_to(mount)]
    return tuple(files)


def _read(path: Path) -> str:
    """A small file of the system; empty if it does not exist."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


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
