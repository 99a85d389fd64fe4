"""A field that is far off U is taken by who asks for it only: in Python and on the command line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ellipsoid_coupling import simulation
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import Wanted, analytic_flow, flow_at, obtain_flow
from ellipsoid_coupling.flow.misfit import LARGEST_MISFIT, Misfit
from ellipsoid_coupling.scenes import load_scene
from ellipsoid_coupling.simulation import scene_flow

# 17 % off U: the lid's jet is one cell wide.
COARSE = Path(__file__).parents[1] / "data" / "l_shape"


def test_a_scene_takes_it_if_asked_for() -> None:
    scene = load_scene("cavity")
    with pytest.raises(InputError, match="--allow-misfit"):
        scene_flow(scene, COARSE)
    with pytest.raises(InputError, match="--allow-misfit"):
        obtain_flow("cavity", 100, COARSE)
    field = scene_flow(scene, Wanted(COARSE, allow_misfit=True))
    assert field is not None
    assert field.origin.startswith("given: OpenFOAM case l_shape, time 1.85, 17 % off U (rms)")


def test_a_saved_field_is_as_far_off_as_the_case(tmp_path: Path) -> None:
    """What it was read from, with which misfit, stands in the file."""
    saved = tmp_path / "flow.npz"
    misfit = Misfit(2.0 * LARGEST_MISFIT, 0.0, 0.0, 0.0, 1.0, 1.0)
    replace(analytic_flow("shear"), misfit=misfit).save(saved)
    with pytest.raises(InputError, match=r"flow\.npz: .*10 % off .*--allow-misfit"):
        flow_at(saved)
    assert flow_at(saved, allow_misfit=True).misfit == misfit
    replace(analytic_flow("shear"), misfit=misfit._replace(cells=LARGEST_MISFIT)).save(saved)
    assert flow_at(saved).misfit is not None


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ([], Wanted()),
        (["--flow", str(COARSE)], Wanted(COARSE)),
        (["--flow", str(COARSE), "--allow-misfit"], Wanted(COARSE, allow_misfit=True)),
        (["--allow-misfit"], Wanted(None, allow_misfit=True)),
    ],
)
def test_run_and_compare_hand_it_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, options: list[str], given: object
) -> None:
    """Both stop where they would take the flow, and have then been given the right one."""

    class Reached(Exception):
        pass

    def stop(_scene: Any, *arguments: Any, **named: Any) -> None:
        assert (named["flow"] if "flow" in named else arguments[0]) == given
        raise Reached

    monkeypatch.setattr(simulation, "simulate", stop)
    monkeypatch.setattr(simulation, "scene_flow", stop)
    for command in (["run", "cavity", "--model", "microscopic"], ["compare", "cavity"]):
        with pytest.raises(Reached):
            main([*command, *options, "--out", str(tmp_path / command[0])])
