"""A stranger's case, as tests edit it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder
from ellipsoid_coupling.flow.openfoam.trust import plain_case


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def refused(case: Path, match: str = "") -> InputError:
    with pytest.raises(InputError, match=match) as caught:
        plain_case(case, None, 1)
    return caught.value


def stranger(folder: Path) -> Path:
    """A copy of the cavity on 16 cells, in a new folder."""
    own = Path(shutil.copytree(case_folder("cavity"), folder))
    edit(own / "system" / "parameters", "cells       100;", "cells 16;")
    return own
