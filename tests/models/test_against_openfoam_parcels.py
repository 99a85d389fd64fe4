"""Particles past the cylinder against OpenFOAM's own parcels: the same flow, starts and drag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import openfoam_available
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from tests.parcel_case import run_parcels, write_parcel_case

# As foam_cases/cylinder has it: diameter 1, Re = 20.
VISCOSITY = 0.05
COUNT = 300


@pytest.mark.heavy
@pytest.mark.openfoam
@pytest.mark.skipif(not openfoam_available(), reason="OpenFOAM is not installed")
@pytest.mark.parametrize("drag", [20.0, 1.0])
def test_parcels_of_openfoam_take_the_same_ways(drag: float, tmp_path: Path) -> None:
    """Both know the flow at its cells and faces only: median distance below 0.01 diameters, same fates.

    Measured at t = 1 to 8: 0.001 to 0.007. Far behind the cylinder, where cells are 0.3 long, OpenFOAM's
    linear and our cubic velocities take them 0.024 and 0.028 apart; with cells half as long 0.004.
    Parcels begin to move when their first step ends: a longer one than 0.002 would show.
    """
    solved = solve_case("cylinder", 16)
    starts = np.random.default_rng(7).uniform((-3.5, -1.0), (-1.5, 1.0), (COUNT, 2))
    times = [1.0, 2.0, 4.0, 8.0, 16.0]
    write_parcel_case(
        tmp_path, solved, starts, drag, VISCOSITY, {"end": 16.0, "step": 0.002, "interval": 1.0}
    )
    written, rival = run_parcels(tmp_path, COUNT)
    scene = ec.load_scene(
        "cylinder",
        {
            "times": times, "start.points": starts.tolist(), "particles.number": COUNT,
            "particles.realisations": 1, "flow.drag": drag, "flow.angular_drag": drag,
            "start.x": [-3.5, -1.5], "numerics.tolerance": 1e-4,
        },
    )  # fmt: skip
    result = ec.simulate(scene, "microscopic", "accurate", flow=read_case(solved))
    place = np.stack((result.variables["x"], result.variables["y"]), axis=-1)[:, 0]
    inside = result.variables["fate"][:, 0] == 0
    for k, time in enumerate(times):
        other = rival[np.flatnonzero(np.isclose(written, time))[0]]
        there = ~np.isnan(other[:, 0])
        both = there & inside[k]
        assert both.sum() > COUNT / 2
        apart = np.hypot(*(other - place[k])[both].T)
        assert np.median(apart) < (0.01 if time <= 8.0 else 0.04)
        assert (there == inside[k]).mean() >= 0.99
