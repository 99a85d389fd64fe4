"""Shared by all tests: where compiled kernels and solved flows are cached stays as it is."""

from __future__ import annotations

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
