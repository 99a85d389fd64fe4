"""What a report is made of: finished runs, and the folders of comparisons. All of it is untrusted."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import (
    MOST_PICTURE_BYTES,
    MOST_PICTURES,
    MOST_SCENE_BYTES,
    MOST_TABLE_BYTES,
)
from ellipsoid_coupling.files.reading import exists, is_folder, read_bytes, read_text
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.storage.run_flow import load_runs
from ellipsoid_coupling.storage.run_folder import RESULT_FILE, RUN_FILE, read_run_file

_TABLE, _TEXT = "errors.csv", "errors.txt"
_PNG = b"\x89PNG\r\n\x1a\n"
# The columns that a report cannot do without; parts of errors are shown where they are.
_COLUMNS = (
    "scene", "model", "scheme", "resolution", "time", "density_error", "angle_error", "wall_seconds",
    "status",
)  # fmt: skip
_REMEDY = "Take a folder that `ellipsoid compare` wrote, or compare again."

Rows = list[dict[str, str]]


class Run(NamedTuple):
    """A finished run.

    Attributes
    ----------
    path : as the user gave it
    result : Result
    flow : the one that it used, None without a fluid
    run_file : the text of its run.toml, "" where there is none
    versions : of the packages that it ran with, by name
    """

    path: Path
    result: Result
    flow: FlowField | None
    run_file: str
    versions: dict[str, str]


class Comparison(NamedTuple):
    """What `ellipsoid compare` has left.

    Attributes
    ----------
    path : the folder
    rows : errors.csv, a row for each run and saved time, cells by column (`compare.table`)
    text : errors.txt, "" where there is none
    pictures : PNG files by name
    """

    path: Path
    rows: Rows
    text: str
    pictures: dict[str, bytes]


def is_comparison(path: Path) -> bool:
    """Whether a folder is one that `ellipsoid compare` wrote."""
    return is_folder(path) and exists(path / _TABLE) and not exists(path / RESULT_FILE)


def load_sources(paths: Sequence[str | Path]) -> tuple[list[Run], list[Comparison]]:
    """Runs and comparisons, each in the order of the paths; nothing is solved for them.

    Raises
    ------
    InputError
        For a path that is neither, or a damaged one.
    """
    folders = [Path(path) for path in paths]
    comparisons = [_load_comparison(path) for path in folders if is_comparison(path)]
    runs = [path for path in folders if not is_comparison(path)]
    results, flows = load_runs(runs)
    made = [_with_file(*parts) for parts in zip(runs, results, flows, strict=True)]
    return made, comparisons


def _with_file(path: Path, result: Result, flow: FlowField | None) -> Run:
    file = (path if is_folder(path) else path.parent) / RUN_FILE
    if not exists(file):
        return Run(path, result, flow, "", {})
    versions = read_run_file(file).get("versions", {})
    text = read_text(file, "the run.toml of a run", MOST_SCENE_BYTES)
    return Run(path, result, flow, text, {name: str(value) for name, value in versions.items()})


def _load_comparison(path: Path) -> Comparison:
    text = path / _TEXT
    pictures = sorted(path.glob("*.png"))[:MOST_PICTURES]
    return Comparison(
        path,
        _read_rows(path / _TABLE),
        read_text(text, "the tables of a comparison", MOST_TABLE_BYTES) if exists(text) else "",
        {picture.name: _read_picture(picture) for picture in pictures},
    )


def _read_rows(file: Path) -> Rows:
    expected = "the errors.csv of a comparison"
    text = io.StringIO(read_text(file, expected, MOST_TABLE_BYTES), newline="")
    try:
        # Rows with too many cells have a list, those with too few None.
        rows = list(csv.DictReader(text, restkey="", restval=None, strict=True))
    except csv.Error as error:
        raise InputError(str(file), expected, str(error), _REMEDY) from None
    missing = [name for name in _COLUMNS if rows and name not in rows[0]]
    if not rows or missing:
        found = f"no column {missing[0]}" if missing else "no rows"
        raise InputError(str(file), expected, found, _REMEDY)
    for number, row in enumerate(rows, 2):
        if any(not isinstance(cell, str) for cell in row.values()):
            raise InputError(f"{file}, line {number}", expected, "another number of cells", _REMEDY)
    return rows


def _read_picture(file: Path) -> bytes:
    data = read_bytes(file, "a picture (PNG)", MOST_PICTURE_BYTES)
    if not data.startswith(_PNG):
        raise InputError(str(file), "a picture (PNG)", "another file", "Remove it.")
    return data
