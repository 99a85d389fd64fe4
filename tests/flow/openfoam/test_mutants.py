"""One flow in many files: other numbers, orders, planes, places and units give the same velocity.

The cases are small solutions of icoFoam: a ring whose wall moves, a cylinder, a plate, an elbow.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case
from tests.flow.openfoam.mutants import (
    Array,
    Form,
    Whole,
    mapped,
    patches_in,
    renumbered,
    reordered,
    scaled,
    turned,
    turned_faces,
    whole_of,
    with_empty_patches_first,
    write,
)

DATA = Path(__file__).parents[2] / "data"


@cache
def known(name: str) -> tuple[Whole, FlowField]:
    """A case and its field, read once."""
    return whole_of(DATA / name), read_case(DATA / name, allow_misfit=True)


def difference(
    field: FlowField, other: FlowField, there: Callable[[Array], Array], turn: Array
) -> float:
    """How far velocities differ, of the largest, at points of a flow that lie elsewhere in the other.

    there : points (n, 2) of the flow -> points (n, 2) of the other
    turn : (2, 2), what turns velocities of the flow into those of the other
    """
    x_low, x_high, y_low, y_high = field.bounds
    x, y = np.meshgrid(np.linspace(x_low, x_high, 41)[1:-1], np.linspace(y_low, y_high, 37)[1:-1])
    points = np.column_stack((x.ravel(), y.ravel()))
    own, found = field.evaluate(*points.T), other.evaluate(*there(points).T)
    both = own.inside & found.inside
    assert both.sum() > 0.9 * own.inside.sum()
    expected = np.stack((own.velocity_x, own.velocity_y), axis=-1) @ turn.T
    off = np.hypot(found.velocity_x - expected[:, 0], found.velocity_y - expected[:, 1])
    return float(off[both].max()) / field.largest_speed


def same(points: Array) -> Array:
    return points


ORDERS: dict[str, Callable[[Whole], Whole]] = {
    "numbers": renumbered,
    "orders": reordered,
    "sides of faces": turned_faces,
    "patches": lambda case: with_empty_patches_first(patches_in(case, range(9)[::-1])),
    "all of it": lambda case: renumbered(reordered(turned_faces(with_empty_patches_first(case)))),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ["baffle", "cylinder_8", "elbow"])
def test_numbers_and_orders_do_not_matter(name: str, order: str, tmp_path: Path) -> None:
    """To 1e-6: psi is summed along other ways, which differ by what fluxes of 8 digits do not close."""
    case, field = known(name)
    other = read_case(write(ORDERS[order](case), tmp_path / "case"), allow_misfit=True)
    assert difference(field, other, same, np.eye(2)) < 1e-6
    assert field.outline is not None
    assert other.outline is not None
    flows = [
        {name: float(one.outflow[one.patch == k].sum()) for k, name in enumerate(one.names)}
        for one in (field.outline, other.outline)
    ]
    assert flows[0] == pytest.approx(flows[1], abs=1e-7)


FORMS = {
    "binary": Form(binary=True),
    "long labels": Form(binary=True, label=64),
    "packed": Form(packed=True),
    "packed binary": Form(binary=True, packed=True),
    "a small time": Form(time="1e-05"),
    "a long time": Form(time="0.30000000000000004"),
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_do_not_matter(form: str, tmp_path: Path) -> None:
    """To the bit."""
    case, _ = known("nozzle")
    plain = read_case(write(case, tmp_path / "plain"))
    other = read_case(write(case, tmp_path / "other", FORMS[form]))
    assert other.digest == plain.digest


# Which of x, y, z of the case stands along x, y, z; with the axes that its plane then has.
PLANES = {
    "x-z": ((0, 2, 1), (0, 1)),
    "y-z": ((2, 0, 1), (0, 1)),
    "z-y": ((2, 1, 0), (1, 0)),
    "y-x": ((1, 0, 2), (1, 0)),
}


@pytest.mark.parametrize(
    ("name", "plane"), [("nozzle", "x-z"), ("ring_8", "y-z"), ("ring_8", "z-y"), ("nozzle", "y-x")]
)
def test_planes_do_not_matter(name: str, plane: str, tmp_path: Path) -> None:
    """Turned and mirrored ones; the rest in the order of the axes, so some are seen from behind."""
    case, field = known(name)
    axes, swap = PLANES[plane]
    matrix = np.zeros((3, 3))
    matrix[range(3), axes] = 1.0
    other = read_case(write(mapped(case, matrix), tmp_path / "case"), allow_misfit=True)
    turn = np.eye(2)[list(swap)]
    assert difference(field, other, lambda at: at @ turn.T, turn) < 1e-6


@pytest.mark.parametrize(
    ("name", "at"), [("cylinder_8", (1e6, -3e5, 7.0)), ("baffle", (-1e3, 1e6, -1e6))]
)
def test_places_do_not_matter(name: str, at: tuple[float, float, float], tmp_path: Path) -> None:
    """Coordinates of 1e6 end at 1e-10: the slope of that over a cell of 0.1, 1e-6 at curved walls."""
    case, field = known(name)
    other = read_case(write(mapped(case, np.eye(3), at), tmp_path / "case"), allow_misfit=True)
    by = np.array(at[:2])
    assert difference(field, other, lambda points: points + by, np.eye(2)) < 1e-6


@pytest.mark.parametrize(("length", "depth"), [(1e-6, 1e-6), (1e5, 1e5), (1.0, 1e-3), (1.0, 50.0)])
def test_units_and_thickness_do_not_matter(length: float, depth: float, tmp_path: Path) -> None:
    case, field = known("baffle")
    other = read_case(write(scaled(case, length, depth), tmp_path / "case"), allow_misfit=True)
    assert difference(field, other, lambda points: points * length, np.eye(2)) < 1e-6


@pytest.mark.parametrize(("name", "angle"), [("nozzle", 30.0), ("step_6", 137.0)])
def test_turned_cases_have_the_same_flow(name: str, angle: float, tmp_path: Path) -> None:
    """The spline's nodes lie elsewhere: as far off as each is from U, walls no worse than 5 %."""
    case, field = known(name)
    turn = turned(np.radians(angle))
    other = read_case(write(mapped(case, turn), tmp_path / "case"), allow_misfit=True)
    assert field.misfit is not None
    assert other.misfit is not None
    assert other.misfit.cells < 1.5 * field.misfit.cells + 0.005
    assert other.misfit.walls < 0.05
    flat = turn[:2, :2]
    assert difference(field, other, lambda points: points @ flat.T, flat) < 0.25


def test_what_is_no_plane_case_is_refused_in_one_message(tmp_path: Path) -> None:
    """A wedge, a case without a thin axis, a mesh whose planes are not parallel."""
    case, _ = known("nozzle")
    parts = [p._replace(kind="wedge") if p.kind == "empty" else p for p in case.patches]
    wedge = Whole(**{**vars(case), "patches": parts})
    with pytest.raises(InputError, match="axisymmetric one, with wedge patches"):
        read_case(write(wedge, tmp_path / "wedge"))
    tilt = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    with pytest.raises(InputError, match="plane case, one cell thick along x, y or z"):
        read_case(write(mapped(case, tilt), tmp_path / "tilted"))
    points = case.points.copy()
    points[:, 2] *= 1.0 + 0.1 * points[:, 0]
    with pytest.raises(InputError, match="plane case, one cell thick"):
        read_case(write(Whole(**{**vars(case), "points": points}), tmp_path / "tapered"))
