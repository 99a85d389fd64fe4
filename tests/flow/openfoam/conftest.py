"""A solved cavity that tests may change, and the flow that it must give however it is written."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case
from tests.flow.openfoam.foreign import DATA


@pytest.fixture
def case(cavity_16: Path, tmp_path: Path) -> Path:
    """A copy of the cavity of 16 x 16 cells, without foamToVTK's files and stream function."""
    copy = tmp_path / "case"
    shutil.copytree(cavity_16, copy, ignore=shutil.ignore_patterns("VTK", "streamFunction"))
    return copy


@pytest.fixture(scope="session")
def known() -> FlowField:
    """The flow of the cavity of 16 x 16 cells."""
    return read_case(DATA / "cavity_16")
