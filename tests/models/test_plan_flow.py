"""What `plan --flow` tells of a flow: its patches, and the numbers by which Stokes' formulas hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.models import plan_flow, plan_patches

HALF = 0.5
CAVITY = Path(__file__).parents[1] / "data" / "cavity_16"


def couette() -> FlowField:
    """The flow u = y between two walls, open at both ends: shear 1, largest speed 1."""
    x, y = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 21)
    psi = np.tile((HALF * y**2)[:, None], (1, x.size))
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    parts = (
        ("in", "patch", 3, 0),
        ("out", "patch", 1, 2),
        ("low", "wall", 0, 1),
        ("high", "wall", 2, 3),
    )
    outline = polygon_outline((name, kind, corners[[a, b]], False) for name, kind, a, b in parts)
    outline = outline._replace(outflow=np.array([-HALF, HALF, 0.0, 0.0]))
    return FlowField.from_stream_function(psi, x, y, "couette", outline=outline)


def scene(**settings: object) -> ec.Scene:
    plain = {
        "domain.boundary": "open", "particles.length": 0.1, "particles.width": 0.05, "flow.drag": 4.0,
        "particles.number": 100, "start.x": [0.0, 0.5], "start.y": [0.0, 0.5],
    }  # fmt: skip
    return ec.load_scene("cavity_free", plain | settings)


def test_numbers_are_those_of_their_formulas() -> None:
    """Shear 1 and speed 1, up to half a point of 200; nu = 0.05."""
    facts = {fact.name: fact for fact in plan_flow(scene(), couette(), 0.05)}
    assert facts["flow"].value == "couette"
    assert float(facts["speed"].value) == pytest.approx(1.0, abs=0.01)
    assert float(facts["Stokes number"].value) == pytest.approx(0.25, abs=0.01)
    assert float(facts["at the start"].value) == pytest.approx(0.1 / 0.05, abs=0.05)
    assert float(facts["Reynolds number"].value) == pytest.approx(0.25 * 0.1 / 0.05, abs=0.02)
    assert float(facts["of the shear"].value) == pytest.approx(0.01 / 0.05, abs=0.01)
    assert float(facts["neighbours"].value) == pytest.approx(99 * np.pi * 0.01 / 0.25, rel=0.05)


def test_it_warns_where_stokes_drag_ends() -> None:
    """Beyond a Reynolds number of 1, by each of the three."""
    warned = [fact.name for fact in plan_flow(scene(), couette(), 0.05) if "WARNING" in fact.why]
    assert warned == ["at the start"]
    warned = [fact.name for fact in plan_flow(scene(), couette(), 0.005) if "WARNING" in fact.why]
    assert warned == ["Reynolds number", "at the start", "of the shear"]
    assert not [fact for fact in plan_flow(scene(), couette(), 1.0) if "WARNING" in fact.why]
    unknown = {fact.name: fact for fact in plan_flow(scene(), couette(), None)}
    assert "gives no nu" in unknown["Reynolds number"].why


def test_patches_have_kinds_and_fluxes() -> None:
    rows = plan_patches(scene(), couette())
    assert [tuple(row) for row in rows] == [
        ("in", "patch", "remove", 1, -HALF), ("out", "patch", "remove", 1, HALF),
        ("low", "wall", "reflect", 1, 0.0), ("high", "wall", "reflect", 1, 0.0),
    ]  # fmt: skip
    stuck = plan_patches(scene(boundaries={"low": {"kind": "stick"}}), couette())
    assert stuck[2].kind == "stick"
    field = couette()
    assert plan_patches(scene(), FlowField(field.arrays, field.origin)) == []


def test_what_a_run_would_refuse_is_refused() -> None:
    with pytest.raises(InputError, match="reflects where the flow has walls"):
        plan_flow(scene(**{"domain.boundary": "reflecting"}), couette(), None)
    with pytest.raises(InputError, match="a patch of the flow's case"):
        plan_flow(scene(boundaries={"nowhere": {"kind": "reflect"}}), couette(), None)


def test_the_command_prints_them(capsys: pytest.CaptureFixture[str]) -> None:
    """The viscosity is the case's 0.1: a particle of length 0.05 in the lid's speed has Re = 0.5."""
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cavity_free", "--flow", str(CAVITY)])
    assert not ended.value.code
    told = capsys.readouterr().out
    assert "Stokes number" in told
    assert "at rest in the fastest fluid: Stokes' formulas hold" in told
    assert "time 3.95" in told


def test_without_flow_nothing_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["plan", "cavity_free"])
    out = capsys.readouterr().out
    assert "Reynolds number" not in out
    assert "The flow and the particles" not in out
