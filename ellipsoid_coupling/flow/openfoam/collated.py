"""Collated decomposed cases: the files of all parts one after another in one, in processorsN.

    FoamFile { ... class decomposedBlockData; }
    // Processor0

    1234
    (the 1234 bytes of the first part's file, with its header)
    // Processor1

    987
    (those of the second, without a header: it is the first one's)

With -ioRanks there are several such folders, processors4_0-1 and processors4_2-3, each with its parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_CASE_FILE_BYTES
from ellipsoid_coupling.files.reading import read_bytes, unpack
from ellipsoid_coupling.flow.openfoam.files import (
    REMEDY,
    FoamFile,
    opened,
    packed,
    read_count,
    read_header,
)
from ellipsoid_coupling.flow.openfoam.tokens import after_space

_EXPECTED = "a file of all parts (decomposedBlockData)"
_KIND = "decomposedBlockData"


def split_parts(folders: Sequence[Path], names: Sequence[Path], scratch: Path) -> list[Path]:
    """The files `names` of every part in a folder of its own, scratch/processor0 and so on.

    folders : processorsN, in the order of their parts. Files that are not there are left out.

    Raises InputError for a file that is not of the form above, or that has another number of parts.
    """
    parts: list[Path] = []
    for folder in folders:
        first, counted = len(parts), 0
        for name in names:
            path = packed(folder / name)
            if path is None:
                continue
            blocks = list(_blocks(path))
            counted = counted or len(blocks)
            if len(blocks) != counted:
                raise InputError(str(path), f"{counted} parts", f"{len(blocks)}", REMEDY)
            for number, block in enumerate(blocks):
                target = scratch / f"processor{first + number}" / name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(block)
        parts += [scratch / f"processor{first + number}" for number in range(counted)]
    return parts


def _blocks(path: Path) -> Iterator[bytes]:
    """The files of the parts, each with the header of the first."""
    data = read_bytes(path, _EXPECTED, MOST_CASE_FILE_BYTES)
    if path.suffix == ".gz":
        data = unpack(data, path, _EXPECTED, MOST_CASE_FILE_BYTES)
    file = opened(path, data, (_KIND,))
    at, header = after_space(data, file.start), b""
    while at < len(data):
        block, at = _block(file, at)
        if not header:
            _, start = read_header(path, block)
            header, block = block[:start] + b"\n", block[start:]
        yield header + block


def _block(file: FoamFile, at: int) -> tuple[bytes, int]:
    """A part's bytes, and where the next part begins."""
    number, at = read_count(file, at, "bytes of a part")
    start = file.mark(at, "(")
    if start + number > len(file.data):
        found = f"{len(file.data) - start}"
        raise file.error(start, f"{number} bytes of a part", found)
    return file.data[start : start + number], after_space(file.data, file.mark(start + number, ")"))
