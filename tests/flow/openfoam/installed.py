"""A mark for tests that start OpenFOAM's programs, which are left out where there are none."""

from __future__ import annotations

import pytest

from ellipsoid_coupling.flow.openfoam import programs

needs_openfoam = pytest.mark.skipif(
    not programs.openfoam_available(), reason="OpenFOAM is not installed"
)
