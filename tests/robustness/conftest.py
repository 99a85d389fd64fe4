"""Limits under which every bad input must end: 10 seconds, and 2 GB beyond what the process has."""

from __future__ import annotations

import re
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

SECONDS = 10
ROOM = 2_000_000_000


@contextmanager
def within_limits() -> Iterator[None]:
    """Raise TimeoutError after 10 s, MemoryError beyond 2 GB more than there is now."""

    def ring(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {SECONDS} seconds")

    found = re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text(encoding="ascii"))
    assert found is not None
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGALRM, ring)
    resource.setrlimit(resource.RLIMIT_AS, (int(found[1]) * 1024 + ROOM, before[1]))
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.fixture(scope="session", autouse=True)
def _libraries() -> None:
    """Imports and compiling are no part of what is timed."""
    from ellipsoid_coupling.flow.reader import read_case, read_vtk

    data = Path(__file__).parents[1] / "data"
    read_case(data / "cavity_16")
    read_vtk(data / "cavity_16")
