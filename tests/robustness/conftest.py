"""The limit under which every bad input must end: 2 GB beyond what the process has."""

from __future__ import annotations

import re
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOM = 2_000_000_000


@contextmanager
def within_limits() -> Iterator[None]:
    """Raise MemoryError beyond 2 GB more than there is now; how busy the machine is says nothing."""
    found = re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text(encoding="ascii"))
    assert found is not None
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (int(found[1]) * 1024 + ROOM, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.fixture(scope="session", autouse=True)
def _libraries() -> None:
    """Imports and compiling take memory of their own."""
    from ellipsoid_coupling.flow.openfoam.reader import read_case, read_vtk

    data = Path(__file__).parents[1] / "data"
    read_case(data / "cavity_16")
    read_vtk(data / "cavity_16")
