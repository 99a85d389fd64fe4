"""Shared by all tests: where compiled kernels and solved flows are cached stays as it is."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from ellipsoid_coupling.flow import FlowField, analytic_flow

# Files that take a minute or more of two quiet cores, longest first: with several workers the others fill
# what is left. The first one compiles most of the kernels that later ones load from the cache.
LONG_FILES = [
    "test_same_bits.py",
    "test_workflows.py",
    "test_gallery.py",
    "test_stability.py",
    "test_resume.py",
    "test_extreme_units.py",
    "test_diffusive.py",
    "test_bad_input.py",
    "test_kernels.py",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, the others as they were."""
    place = {name: k for k, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: place.get(item.path.name, len(place)))


@pytest.fixture(scope="session")
def stagnation_flow() -> FlowField:
    """U = (-x, y), everywhere."""
    return analytic_flow("top_bottom")


@pytest.fixture(scope="session")
def rotation_flow() -> FlowField:
    """U = (y, -x), everywhere."""
    return analytic_flow("rotation")


@pytest.fixture
def obeyed() -> Iterator[Callable[..., Any]]:
    """SIGTERM, SIGINT and SIGHUP end a process and those that it starts, as in a terminal.

    The background of a shell ignores SIGINT, nohup SIGHUP, and whoever they start does so too.
    """
    handler = signal.default_int_handler
    numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
    before = {number: signal.signal(number, handler) for number in numbers}
    yield handler
    for number, old in before.items():
        signal.signal(number, old)
