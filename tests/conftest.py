"""Shared by all tests: where compiled kernels and solved flows are cached stays as it is."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from ellipsoid_coupling.flow import FlowField, analytic_flow


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
