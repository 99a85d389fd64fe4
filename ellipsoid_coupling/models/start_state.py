"""The state at the start that is not that of the start box: as the fluid moves, or as an earlier run ended.

    particles   from particles, one by one: positions, angles, velocities
    cells       from the same cells; or from particles, which are counted: means of what they carry

A run goes on with the masses that it finds: a density is not made one of mass 1 again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.finite_volume.q_grid import QGrid
from ellipsoid_coupling.finite_volume.system import DENSITY, MEAN_ANGLE
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.earlier import VELOCITIES, Earlier
from ellipsoid_coupling.models.fluid_motion import fluid_motion
from ellipsoid_coupling.models.staircase import Staircase
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]
Values = dict[str, Floats]


class Moving(NamedTuple):
    """Particles (blocks, D, n) of an earlier run: x, y and angle, and their velocities."""

    position: Floats
    velocity: Floats


def _refused(scene: Scene, expected: str, found: str, remedy: str) -> InputError:
    return InputError(f"scene {scene.name}, key start.file", expected, found, remedy)


# Particles.


def earlier_realisations(setup: Setup) -> Moving | None:
    """The particles of the realisations of a run, whose numbers count; None without start.file.

    Raises
    ------
    InputError
        For another number of particles, or too few realisations.
    """
    if setup.earlier is None:
        return None
    whole, first = _particles(setup, setup.earlier), setup.first_realisation
    count, number = whole.position.shape[0], whole.position.shape[2]
    wanted, last = setup.scene.particles.number, first + setup.realisations
    if number != wanted or count < last:
        raise _refused(
            setup.scene, f"{last} or more realisations of {wanted} particles",
            f"{count} of {number} in {setup.earlier.where}",
            "Change particles.number or the realisations.",
        )  # fmt: skip
    return Moving(*(np.ascontiguousarray(part[first:last]) for part in whole))


def earlier_samples(setup: Setup) -> Moving | None:
    """The same as samples of one density: blocks are realisations, or parts of what one realisation holds.

    Raises
    ------
    InputError
        For another number of particles.
    """
    if setup.earlier is None:
        return None
    whole = _particles(setup, setup.earlier)
    blocks, degrees, size = whole.position.shape
    wanted = setup.scene.particles.number * setup.realisations
    if blocks * size != wanted:
        raise _refused(
            setup.scene, f"particles.number x realisations = {wanted} particles",
            f"{blocks * size} in {setup.earlier.where}",
            "Change particles.number or the realisations.",
        )  # fmt: skip

    def cut(values: Floats) -> Floats:
        flat = values.swapaxes(0, 1).reshape(degrees, setup.realisations, -1)
        return np.ascontiguousarray(flat.swapaxes(0, 1))

    return Moving(*map(cut, whole))


def _particles(setup: Setup, earlier: Earlier) -> Moving:
    scene, values = setup.scene, earlier.variables
    if earlier.layout != "particles" or earlier.particles != values["x"].size:
        found = "a grid" if earlier.layout != "particles" else "some that came in or have left"
        raise _refused(
            scene, "particles, all of which are in the fluid",
            f"{found} in {earlier.where}", "Give the result of another run, or start on a grid.",
        )  # fmt: skip
    _require_in_domain(scene, earlier)
    angle = values["angle"] - scene.start.turns
    position = np.stack((values["x"], values["y"], angle), axis=1)
    return Moving(position, np.stack([values[name] for name in VELOCITIES], axis=1))


def _require_in_domain(scene: Scene, earlier: Earlier) -> None:
    """Refuse particles beyond sides that none can pass."""
    x, y = earlier.variables["x"], earlier.variables["y"]
    (left, right), (bottom, top) = scene.domain.x, scene.domain.y
    beyond = {"left": x < left, "right": x > right, "bottom": y < bottom, "top": y > top}
    for name, side in scene.sides.items():
        outside = beyond[name]
        if side.particles != "leave" and outside.any():
            first = float(x[outside][0]), float(y[outside][0])
            raise _refused(
                scene, "particles within the domain, whose sides cannot be left",
                f"{np.count_nonzero(outside)} of {x.size} beyond the {name}, the first at "
                f"({first[0]:.6g}, {first[1]:.6g}), in {earlier.where}",
                "Make the domain larger, or give another result.",
            )  # fmt: skip


def start_velocity(setup: Setup, position: Floats) -> Floats:
    """That of particles at position (blocks, D, n) as the scene says: at rest, or with the fluid."""
    scene, flow = setup.scene, setup.flow
    if scene.start.velocity == "rest" or flow is None:
        return np.zeros_like(position)
    turned = position if position.shape[1] == 3 else np.pad(position, ((0, 0), (0, 1), (0, 0)))
    motion = fluid_motion(scene, flow.at(0.0), turned.swapaxes(0, 1)).swapaxes(0, 1)
    return np.ascontiguousarray(motion[:, : position.shape[1]])


# Cells.


def fill_start(cells: CellFields, setup: Setup, stairs: Staircase | None, own: Values) -> None:
    """Set the fields of cells to the start, in place.

    Parameters
    ----------
    own : dict
        The density (na, ny, nx) of the scene's own start, and the mean angle where it is carried.

    Raises
    ------
    InputError
        For a start.file that does not fit.
    """
    if setup.earlier is not None:
        values = _earlier_cells(setup, setup.earlier, cells.grid)
        _require_fluid(setup.scene, values[DENSITY], stairs, cells.grid.plane)
    elif setup.scene.start.velocity == "fluid":
        values = own | _fluid_cells(setup, stairs, cells.grid, own)
    else:
        values = own
    cells.inside[0] = values[DENSITY]
    cells.look_for_mass()
    for name in cells.system.components[1:]:
        if name in values:
            cells.fill(name, values[name])


def _fluid_cells(setup: Setup, stairs: Staircase | None, grid: QGrid, own: Values) -> Values:
    """Velocities of cells that go with the fluid."""
    assert setup.flow is not None
    x, y = np.meshgrid(grid.plane.x, grid.plane.y)
    angle = grid.angle if grid.angle_resolved and grid.angles > 1 else own.get(MEAN_ANGLE)
    if angle is None:
        angle = np.full(1, setup.scene.start.own_angle)
    turned = angle[:, None, None] if angle.ndim == 1 else angle
    position = np.stack(np.broadcast_arrays(x, y, turned))
    motion = fluid_motion(setup.scene, setup.flow.at(0.0), position)
    if stairs is not None:
        for d, axis in enumerate((-1, -2)):
            motion[d] = stairs.faces[axis].mean
    return dict(zip(VELOCITIES, motion, strict=True))


def _require_fluid(scene: Scene, density: Floats, stairs: Staircase | None, plane: Grid) -> None:
    if stairs is None:
        return
    lost = (density > 0.0).any(axis=0) & ~stairs.cells.inside
    if lost.any():
        j, i = np.argwhere(lost)[0]
        raise _refused(
            scene, "mass in the fluid's cells",
            f"some in {np.count_nonzero(lost)} cells in solids or beyond the mesh, the first at "
            f"({plane.x[i]:.6g}, {plane.y[j]:.6g})",
            "Give the result of a run in this flow.",
        )  # fmt: skip


def _earlier_cells(setup: Setup, earlier: Earlier, grid: QGrid) -> Values:
    if earlier.layout == "particles":
        _require_in_domain(setup.scene, earlier)
        return _binned(setup.scene, earlier, grid)
    resolved = grid.angle_resolved
    axes = {"y": grid.plane.y, "x": grid.plane.x} | ({"angle": grid.angle} if resolved else {})
    wanted = "q" if resolved else "rho"
    found = earlier.coordinates
    same = earlier.layout == wanted and all(
        found[name].shape == centres.shape
        and np.allclose(found[name], centres, rtol=1e-12, atol=1e-9 * grid.plane.cell)
        for name, centres in axes.items()
    )
    if not same:
        sizes = " x ".join(str(found[name].size) for name in sorted(found))
        raise _refused(
            setup.scene, f"cells of layout {wanted} at the same places, or particles",
            f"{sizes} cells of layout {earlier.layout} in {earlier.where}",
            "Take the domain, numerics.cell, numerics.angle_cells and kind of model of that run.",
        )  # fmt: skip
    values = {name: value.reshape(grid.shape) for name, value in earlier.variables.items()}
    if (values[DENSITY] < 0.0).any():
        raise _refused(
            setup.scene, "no negative density", f"some in {earlier.where}", "Give another result."
        )
    if MEAN_ANGLE in values:
        values[MEAN_ANGLE] = values[MEAN_ANGLE] - setup.scene.start.turns
    return values


def _binned(scene: Scene, earlier: Earlier, grid: QGrid) -> Values:
    """Particles counted in cells: their density, and the means of angle and velocities.

    Those beyond an open side have left.
    """
    plane, (x, y) = grid.plane, (earlier.variables["x"], earlier.variables["y"])
    (left, right), (bottom, top) = scene.domain.x, scene.domain.y
    inside = (left <= x) & (x <= right) & (bottom <= y) & (y <= top)
    values = {name: v[inside] for name, v in earlier.variables.items()}
    i = np.clip(np.searchsorted(plane.x_edges, values["x"], "right") - 1, 0, plane.nx - 1)
    j = np.clip(np.searchsorted(plane.y_edges, values["y"], "right") - 1, 0, plane.ny - 1)
    angle = values["angle"] - scene.start.turns
    if grid.angle_resolved and grid.angles > 1:
        # Between two centres a particle counts for both, as that of a start angle does.
        place = angle / grid.angle_width
        low = np.floor(place).astype(np.int64)
        shares = [(low, 1.0 - (place - low)), (low + 1, place - low)]
    else:
        shares = [(np.zeros(i.size, np.int64), np.ones(i.size))]

    def gathered(weight: Floats) -> Floats:
        out = np.zeros(grid.shape)
        for a, part in shares:
            np.add.at(out, (a % grid.shape[0], j, i), part * weight)
        return out

    count = gathered(np.ones(i.size))
    means = {name: gathered(values[name]) for name in VELOCITIES} | {MEAN_ANGLE: gathered(angle)}
    found = {name: np.divide(m, count, out=m, where=count > 0.0) for name, m in means.items()}
    return found | {DENSITY: count / (earlier.particles * grid.volume)}
