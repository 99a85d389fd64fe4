"""The cases of the stability map: each changes one thing of the small scene (`case`), some two.

Where a change makes everything faster, the end time is as many of the scene's own, shorter times.
"""

from __future__ import annotations

import math

from ellipsoid_coupling.compare.stability.case import REACH, SMALL, Case, Table
from ellipsoid_coupling.models import ModelKind


def _of_particles(kind: ModelKind) -> bool:
    return not kind.is_grid


def _without_pressure(kind: ModelKind) -> bool:
    return kind.pressure == 0.0


def _until(end: float) -> Table:
    """The end time, and 200 steps of the scheme `paper`."""
    return {"times": [end], "numerics.time_step": end / 200}


def _points(*points: tuple[float, ...]) -> Table:
    return {"start": {"points": [list(p) for p in points]}, "particles.number": len(points)}


def _scaled(width: float, cells: int = 12, *, drive: str = "rotation") -> Table:
    """The small scene `width` wide instead of 1, particles and potential with it."""
    box = [-0.5 * width, 0.5 * width]
    settings: Table = {
        "domain": {"x": box, "y": box, "boundary": "reflecting"},
        "start": {"x": [0.5 * b for b in box], "y": [0.5 * b for b in box], "angle": 0.0},
        "particles.length": 0.1 * width,
        "particles.width": 0.05 * width,
        "numerics.cell": width / cells,
    }
    if drive == "potential":
        # The polynomials of a flow's spline overflow where x^3 does.
        settings |= {"flow": None, "outer_potential": {"stiffness": 10.0}}
    return settings


_ALONE: Table = {"interaction": None, "walls": None}
_AT_WALL: Table = {"start.x": [-0.5, 0.0], "start.y": [-0.5, 0.0]}
_OPEN: Table = {"walls": None, "domain.boundary": "open"}


def _one_by_one() -> list[Case]:
    cases = [Case("as it is", "", {}, quick=True)]
    quick = {1e-8, 0.0, 1e8, 1e6}
    for i in (1.0, 1e-4, 1e-6, 1e-8):
        # Torques turn in times that go like the root: as many of these, whatever the inertia.
        changes = {"particles.inertia": i} | _until(min(2.0, 200.0 * math.sqrt(i)))
        cases.append(Case("inertia", f"{i:g}", changes, quick=i in quick))
    for key, family in (("drag", "drag"), ("angular_drag", "angular drag")):
        cases += [
            Case(family, f"{d:g}", {f"flow.{key}": d}, quick=d in quick)
            for d in (0.0, 1.0, 1e2, 1e4, 1e6, 1e8)
        ]
    for ratio in (1.0, 10.0, 100.0, 1e4, 1e8):
        name = f"{ratio:g}" if ratio > 1.0 else "1 (circle)"
        changes = {"particles.width": 0.1 / ratio} | _until(2.0 if ratio < 1e4 else 0.2)
        overdamped = 0.05 if ratio > 1e6 else 0.0
        in_quick = ratio in (1.0, 100.0)
        cases.append(Case("aspect ratio", name, changes, quick=in_quick, overdamped_end=overdamped))
    cases.append(Case("eps0", "0", _ALONE))
    for strength in (1e2, 1e4, 1e6):
        # Speeds grow like the root: the same way is gone in a shorter time.
        changes = {"interaction.strength": strength} | _until(5.0 / math.sqrt(strength))
        cases.append(
            Case(
                "eps0",
                f"{strength:g}",
                changes,
                quick=strength == 1e6,
                overdamped_end=20.0 / strength,
            )
        )
    return cases


def _walls_and_noise() -> list[Case]:
    cases = []
    for f in (1.0, 1e3, 1e6):
        changes = _AT_WALL | {"walls.strength_factor": f} | _until(min(2.0, 20.0 / math.sqrt(f)))
        cases.append(Case("wall factor", f"{f:g}", changes, quick=f == 1e6))
    for cells in (12, 100, 500, 2000):
        # In a domain of 12 cells, so that speeds are the same and times go with its width.
        changes = _scaled(12.0 / cells) | {"walls.ghost_density": "paper"} | _until(24.0 / cells)
        cases.append(
            Case(
                "ghost density 1/h^2, h =",
                f"1/{cells}",
                changes,
                quick=cells == 2000,
                overdamped_end=min(2.0, 6.0 * (12.0 / cells) ** 2),
            )
        )
    for a in (0.0, 0.1, 1.0, 10.0, 100.0):
        noise = {"noise": {"noise": a, "angular_noise": a}, "particles.realisations": 10}
        cases.append(Case("noise", f"{a:g}", noise, quick=a in (0.0, 100.0)))
    return cases


def _densities() -> list[Case]:
    h = SMALL["numerics"]["cell"]
    one = {"start": {"x": [0.0, h], "y": [0.0, h], "angle": 0.3}}
    cases = [
        Case("density", "all in one cell", one, quick=True),
        Case("density", "one cell, else 1e-15", one, background=1e-15),
        Case("density", "one cell, else 1e-300", one, background=1e-300, quick=True),
    ]
    for width in (1e-49, 1e49, 1e99):
        density = f"{4.0 / width / width:.0e}"
        changes = _scaled(width, drive="potential") | {"walls": None}
        # The same motion in another unit of length; eps0 h^2 of the widest would overflow.
        square = width * width
        if width < 1e90:
            eps0 = {"strength": 0.1 * square}
            changes |= {"particles.inertia": 1e-2 * square, "interaction": eps0}
        else:
            changes |= {"interaction": None}
        # A temperature of 1 is a speed of 1, and crosses the smallest box too often.
        only = _without_pressure if width < 1.0 else None
        cases.append(Case("density", density, changes, only=only, quick=width > 1e90))
    return cases


def _particles() -> list[Case]:
    apart = {"1e-14": 1e-14, "1e-3": 1e-3, "the reach": REACH}
    cases = [
        Case("two particles", "at one place", _points((0.1, 0.1, 0.3), (0.1, 0.1, 0.3)), quick=True)
    ]
    for name, distance in apart.items():
        points = _points((0.1, 0.1, 0.0), (0.1 + distance, 0.1, 0.0))
        cases.append(Case("two particles", f"{name} apart", points))
    cases.append(Case("one particle", "", _points((0.1, 0.1, 0.3)), quick=True))
    side = 0.5 * REACH
    box = {"start.x": [-side, side], "start.y": [-side, side], "particles.realisations": 1}
    for number in (1000, 100_000):
        step = {"times": [0.01], "numerics.time_step": 0.01}
        changes = box | step | {"particles.number": number}
        name, fine = f"N = {number}", number <= 1000
        one = Case("in a box of one reach", name, changes, only=_of_particles, reference=fine)
        cases.append(one)
    return cases


def _flows_and_angles() -> list[Case]:
    cases = []
    for field in ("rotation", "shear", "top_bottom"):
        for g in (1e2, 1e4, 1e6):
            # Ten of the times in which drag and gradient together change a place.
            changes = {"flow.field": field} | _until(10.0 / math.sqrt(10.0 * g))
            name = f"{field.replace('_', '-')}, {g:g}"
            if field == "rotation" or g == 1e6:
                one = Case("gradient", name, changes, g, quick=g == 1e6, overdamped_end=6.0 / g)
                cases.append(one)
    return cases + [
        Case("start angle", f"{angle:g}", {"start.angle": angle}, quick=angle == 1e9)
        for angle in (1e3, 1e9)
    ]


def _steps_and_times() -> list[Case]:
    cases = []
    stable = 2.0 / SMALL["flow"]["drag"]
    for factor in (1e-3, 1e-2, 0.1, 1.0, 10.0, 1e3):
        changes = {
            "numerics.time_step": factor * stable,
            "numerics.tolerance": 1e-3 * factor,
            "numerics.cfl": min(1.0, factor),
            "times": [2.0 * min(1.0, 10.0 * factor)],
        }
        cases.append(Case("steps, stable one x", f"{factor:g}", changes, quick=factor == 1e3))
    for count in (100, 10_000):
        drag = 0.1 * count
        changes = {"flow.drag": drag, "flow.angular_drag": drag, "times": [10.0]}
        changes |= {"numerics.time_step": 1.0 / drag}
        cases.append(Case("end time, in 1/drag", f"{count}", changes, quick=count == 10_000))
    return cases


def _places() -> list[Case]:
    wall, corner = (-0.5, 0.1, 0.3), (-0.5, 0.5, 0.3)
    return [
        Case("domain", "of one cell", {"numerics.cell": 1.0}, quick=True),
        Case("domain", "of 2 x 2 cells", {"numerics.cell": 0.5}),
        Case("start", "on a wall", _points(wall, (-0.5, 0.0, 1.0), (0.0, 0.5, 0.0)), quick=True),
        Case("start", "in a corner", _points(corner, (0.5, 0.5, 0.0)), quick=True),
        Case("start", "outside", _points((0.7, 0.1, 0.0)), quick=True),
        Case("start", "on an open edge", _OPEN | {"start.x": [0.25, 0.5]}),
        Case("open, blown out", "", _OPEN | {"flow.field": "top_bottom", "flow.drag": 100.0}),
    ]


def _two_at_once() -> list[Case]:
    still = {"flow": None} | _ALONE
    return [
        Case("nothing acts", "", still, quick=True),
        Case("no drag, inertia", "1e-8", {"flow": None, "particles.inertia": 1e-8, **_until(0.02)}),
        Case("both drags 1e8, eps0", "1e6", {"flow.drag": 1e8, "flow.angular_drag": 1e8,
             "interaction.strength": 1e6}, quick=True),
        Case("drag 1e8, noise", "100", {"flow.drag": 1e8, "noise": {"noise": 100.0,
             "angular_noise": 100.0}, "particles.realisations": 10}),
        Case("aspect ratio 100, eps0", "1e3", {"particles.width": 1e-3,
             "interaction.strength": 1e3, **_until(0.2)}),
        Case("circle, inertia", "1e-8", {"particles.width": 0.1, "particles.inertia": 1e-8}),
        Case("one cell, eps0", "1e6", {"numerics.cell": 1.0, "interaction.strength": 1e6,
             **_until(0.005)}, overdamped_end=2e-5),
        Case("open, gradient", "1e4", _OPEN | {"flow.field": "top_bottom", "times": [0.03],
             "numerics.time_step": 6e-4}, gradient=1e4),
        Case("inertia 1e-6, angular drag", "1e4", {"particles.inertia": 1e-6,
             "flow.angular_drag": 1e4}),
    ]  # fmt: skip


CASES: tuple[Case, ...] = (
    *_one_by_one(),
    *_walls_and_noise(),
    *_densities(),
    *_particles(),
    *_flows_and_angles(),
    *_steps_and_times(),
    *_places(),
    *_two_at_once(),
)
