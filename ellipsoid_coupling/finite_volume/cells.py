"""The fields of an equation on cells, and everything that moves them; steppers own the order.

(r, theta) grid   (K, na + 4, ny + 4, nx + 4)   only the part of a row that holds mass is visited
r-grid            (K, 1, ny + 4, nx + 4)        one plane, which is filled; F and F_bar are kept, for
                                                they take a sine and a cosine a cell
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.dispatch import require_formula
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.fluid_lines import FluidLines
from ellipsoid_coupling.finite_volume.fluxes import FluxMaker, Transported
from ellipsoid_coupling.finite_volume.fluxes.ballistic import bends_of_step, smooth_part
from ellipsoid_coupling.finite_volume.fluxes.contract import VACUUM, Flux, in_order, through_face
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move, sweep_planes
from ellipsoid_coupling.finite_volume.grid import interior
from ellipsoid_coupling.finite_volume.kick import Kick, dampings, drift_velocity, exact_kick
from ellipsoid_coupling.finite_volume.line_sweep import line_fields, sweep_lines
from ellipsoid_coupling.finite_volume.moving_lines import MovingLines
from ellipsoid_coupling.finite_volume.moving_tables import MovingTables
from ellipsoid_coupling.finite_volume.q_grid import Extents, QGrid, grown, occupied_extents
from ellipsoid_coupling.finite_volume.q_transport import transport, transport_in_plane
from ellipsoid_coupling.finite_volume.sources import Cells, Limit, Work, acceleration, treat
from ellipsoid_coupling.finite_volume.step_limits import (
    LARGEST_TURN,
    Allowed,
    CellwiseLimit,
    ExtremesLimit,
    largest_turn,
)
from ellipsoid_coupling.finite_volume.strips import whole_plane
from ellipsoid_coupling.finite_volume.system import DENSITY, MEAN_ANGLE, VELOCITIES, System
from ellipsoid_coupling.geometry.ghost_table import GhostTable
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.closure import cell_pressure
from ellipsoid_coupling.stepping.step_control import looking_ahead

Floats = NDArray[np.float64]


@dataclass(eq=False)
class CellFields:
    """The fields of a `System` on a grid.

    Attributes
    ----------
    system : System
    grid : QGrid
        Of an r-grid `RGrid`.
    terms : CellTerms
    ghosts : GhostTable
        What happens at the ends of x and y.
    cfl : float
        The part of a cell that mass may cross in a step.
    find_forces : callable
        Interaction and walls at the present fields, (cells) -> Forces or AngleForces, or None.
    lines : FluidLines or None
        What sweeps go along where patches bound the fluid; None in a rectangle.
    fields : (K, *grid.padded) float64
        The system's components; zero at first.
    drift : (D, na or 0, ny, nx) float64
        See `sources.Cells`.
    extents : (na, ny, 2) int64
        Outside them, all is vacuum.
    vacuum : float
        The density up to which a cell counts as empty.
    outflow : (1,) or, with lines, (boundaries,) float64
        What has left through open boundaries less what came in, in units of a cell's density.
    forces : Forces, AngleForces or None
        Of interaction and walls, as last found.
    tables : MovingTables or None
        What brings `terms` to a time; None where they do not change.
    moving_lines : MovingLines or None
        Likewise, of `lines`.
    time, after : float
        At the start of the step, and at its end.
    """

    system: System
    grid: QGrid
    terms: CellTerms
    ghosts: GhostTable
    cfl: float
    find_forces: Callable[[CellFields], Forces | AngleForces | None]
    lines: FluidLines | None = None
    tables: MovingTables | None = None
    moving_lines: MovingLines | None = None
    fields: Floats = field(init=False)
    drift: Floats = field(init=False)
    extents: Extents = field(init=False)
    vacuum: float = field(init=False)
    outflow: Floats = field(init=False)
    forces: Forces | AngleForces | None = field(init=False, default=None)
    time: float = field(init=False, default=0.0)
    after: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        require_formula(cell_pressure, self.system.pressure)
        planes, *plane = self.grid.shape
        self.fields = np.zeros((len(self.system.components), *self.grid.padded))
        kept = 0 if self.grid.angle_resolved else planes
        self.drift = np.zeros((len(self.system.velocities), kept, *plane))
        # The density that mass 1 has all over the grid, a small part of it.
        self.vacuum = VACUUM / (math.prod(self.grid.shape) * self.grid.volume)
        self.outflow = np.zeros(1 if self.lines is None else len(self.lines.boundaries))
        self.look_for_mass()

    @property
    def axes(self) -> tuple[int, ...]:
        """The directions of transport, see `System`."""
        return self.system.axes

    @property
    def inside(self) -> Floats:
        """The fields without ghosts, (K, na, ny, nx)."""
        planes = self.grid.shape[0]
        ghosts = (self.fields.shape[1] - planes) // 2
        return interior(self.fields[:, ghosts : ghosts + planes])

    def fill(self, name: str, per_mass: Floats) -> None:
        """Set a component inside to the density times `per_mass`, (na, ny, nx) or what spreads to it."""
        self.inside[self.system.place(name)] = self.inside[0] * per_mass

    @property
    def mass(self) -> float:
        """All mass inside."""
        return float(self.inside[0].sum() * self.grid.volume)

    @property
    def mass_left(self) -> float:
        """The mass that has left through open boundaries."""
        return float(self.outflow.sum() * self.grid.volume)

    @property
    def left_by_boundary(self) -> dict[str, float]:
        """The same through each patch and side that bounds a cell and is no wall; {} in a rectangle."""
        if self.lines is None:
            return {}
        left = (self.outflow * self.grid.volume).tolist()
        names = zip(self.lines.boundaries, left, self.lines.is_passed, strict=True)
        return {name: one for name, one, passed in names if passed}

    # Where mass is.

    def look_for_mass(self) -> None:
        """Set the extents to what holds mass now, wherever it is."""
        self.extents = (
            occupied_extents(self.fields) if self.grid.angle_resolved else self.grid.everywhere
        )

    def narrow_extents(self) -> None:
        """Set the extents to what holds mass now, all of which lies within them."""
        if self.grid.angle_resolved:
            self.extents = occupied_extents(self.fields, self.extents)

    # Transport.

    def transport(self, flux: Flux, axis: int, dt: float, drifts: bool = True) -> None:
        """Move all fields along an axis for dt; the extents grow with them.

        drifts : see `transport_all`.
        """
        require_formula(through_face, flux)
        ratio = dt / self.grid.width(axis)
        if self.lines is not None and axis != -3:
            lines = self.lines if drifts else self.lines.without_inflow
            along = line_fields(self.fields, axis, lines, self.plane_width, self.time)
            self.outflow += sweep_lines(flux, along, ratio, self.outflow.size)
            self.extents = self.swept_extents(axis)
            return
        here = self.fields, axis, ratio, self.extents, self.ghosts, self.time
        self.extents = transport(flux, *here, self.outflow)

    @property
    def plane_width(self) -> float:
        """From plane to plane of an angle that is resolved, radian; else 0."""
        return self.grid.angle_width if self.grid.angle_resolved else 0.0

    def swept_extents(self, axis: int) -> Extents:
        """What may hold mass after a sweep of lines along x or y."""
        if not self.grid.angle_resolved or (self.lines is not None and self.lines.has_inflow):
            return self.grid.everywhere
        periodic = self.ghosts.kinds.wraps(axis)
        return grown(self.extents, self.grid.plane.nx, axis, periodic)

    def _transport_in_plane(self, flux: Flux, x_first: bool, dt: float) -> None:
        """Move all fields along x and then y for dt, or along y and then x, in one pass."""
        require_formula(through_face, flux)
        move = Move(x_first, dt / self.grid.plane.cell, self.time)
        if self.grid.angle_resolved:
            here = self.fields, move, self.extents, self.ghosts
            self.extents = transport_in_plane(flux, *here, self.outflow)
            return
        kinds, flat = self.ghosts.kinds, self.fields.reshape(len(self.fields), -1)
        whole = whole_plane(self.grid.plane.padded, kinds.wraps(-2), numba.get_num_threads())
        gone = sweep_planes(flux, flat, *whole, move, self.ghosts)
        if not kinds.closed:
            self.outflow += gone

    def transport_all(
        self, make_flux: FluxMaker, axes: tuple[int, ...], dt: float, drifts: bool = True
    ) -> None:
        """Move all fields for dt along all `axes`, in this order; x and y stand side by side in it.

        drifts : at velocities that drag draws to the fluid's, not at corrections of these.
        """
        if axes[0] == -3:
            self.transport(make_flux(self.transported(-3, dt)), -3, dt)
        first, second = (-1, -2) if axes.index(-1) < axes.index(-2) else (-2, -1)
        if self.lines is None:
            self._transport_in_plane(make_flux(self.transported(-1, dt)), first == -1, dt)
        else:
            follows = self._follows(dt) if drifts else 0.0
            if self.moving_lines is not None:
                self.set_terms(0.5 * (self.time + self.after))  # as the lines, of the step's middle
            fluid = self.lines.fluid(first, follows, second=False)
            moved = self.transported(first, dt)._replace(fluid=fluid)
            self._settle(follows)
            self.transport(make_flux(moved), first, dt, drifts)
            self._settle(follows)
            fluid = self.lines.fluid(second, follows, second=True)
            moved = self.transported(second, dt)._replace(fluid=fluid)
            self.transport(make_flux(moved), second, dt, drifts)
        if axes[-1] == -3:
            self.transport(make_flux(self.transported(-3, dt)), -3, dt)

    @property
    def fluid_step(self) -> float:
        """The step in which the fluid empties no cell; infinite where nothing follows it."""
        fastest = 0.0 if self.lines is None else self.lines.fastest
        return self.cfl * self.grid.plane.cell / fastest if fastest > 0.0 else math.inf

    def _follows(self, dt: float) -> float:
        """How much of the velocities counts as the fluid's in a step, see `fluxes.in_fluid`."""
        # As far as drag draws a velocity to the fluid's.
        return 1.0 if self.system.slaved else -math.expm1(-self.terms.damping * dt)

    def _settle(self, follows: float) -> None:
        """Before each direction: the velocities of this place, as far as drag makes them at once.

        Strong drag lets no velocity of the old place come along, nor what an implicit kick has left of it.
        The part is O(dt^3) for weak drag, so that no order is lost. At tilted walls see `wall_cells`.
        """
        part = follows**3
        if part > 0.0:
            self.treat(self.limit(1), self.drift_in_plane(part), fresh=True)
        if self.lines is not None:
            self.lines.slide(self.fields, self.system.velocities, follows > 0.0)

    def drift_in_plane(self, part: float = 1.0) -> Kick:
        """Draws this part of v to the drift's velocity, F/Gamma, and leaves omega."""
        velocities = len(self.system.velocities)
        there = drift_velocity(self.terms, velocities)
        parts = (part, part, 0.0)[:velocities]
        gain = tuple(one * gain for one, gain in zip(parts, there.gain, strict=True))
        return Kick(tuple(1.0 - one for one in parts), gain)

    def transported(self, axis: int, dt: float) -> Transported:
        """What a flux moves along an axis in a step; along x and y alike."""
        flight = bends_of_step(self.smooth_part(-1), self.grid.plane.cell, dt)
        turning = bends_of_step(self.smooth_part(-3), self.grid.angle_width, dt)
        # What else is carried has no unit here: none of its extrema counts as smooth.
        bends = dict.fromkeys(self.system.components, 0.0)
        bends |= {DENSITY: (turning if axis == -3 else flight).density, MEAN_ANGLE: flight.angle}
        bends |= dict(zip(VELOCITIES, (flight.speed, flight.speed, turning.speed), strict=True))
        order = in_order(len(self.fields), self.system.velocities[-1 - axis])
        each = tuple(bends[self.system.components[k]] for k in order)
        return Transported(self.system.pressure, each, self.smooth_part(axis), self.vacuum)

    def smooth_part(self, axis: int) -> float:
        """What is a small part along an axis, by its resolution; see `fluxes.ballistic`."""
        along_angle = axis == -3 and self.grid.angle_resolved
        return smooth_part(self.grid.angles if along_angle else max(self.grid.plane.shape))

    # Sources.

    @property
    def cells(self) -> Cells:
        """What sources see of the fields."""
        velocities, angle = self.system.velocities, self.system.carried_angle
        spin = velocities[2:] if angle else ()  # omega of a carried angle
        each = tuple(range(len(velocities)))
        moving, further = (0, *velocities), self.system.further
        return Cells(self.fields, self.extents, self.drift, each, moving, angle, spin, further)

    @property
    def keeps_drift(self) -> bool:
        """Whether F and F_bar are kept from where they are evaluated on."""
        return not self.grid.angle_resolved

    def begin_step(self, time: float, after: float) -> None:
        """A step from one time to another; `terms` are those of its start."""
        self.time, self.after = time, after
        self.set_terms(time)
        if self.moving_lines is not None:
            self.moving_lines.set(0.5 * (time + after))
            self.lines = self.moving_lines.lines

    def set_terms(self, t: float) -> None:
        """Bring `terms` to the time t."""
        if self.tables is not None:
            self.tables.set(t)

    def update_forces(self) -> None:
        """Set `forces` to interaction and walls at the present fields, and `terms` to the step's end."""
        self.set_terms(self.after)
        # Not both at once: those of before are as large.
        self.forces = None
        self.forces = self.find_forces(self)

    def limit(self, order: int) -> Limit:
        """What bounds the steps of a scheme of this order; see `step_limits`."""
        # Extremes know no sound.
        cellwise = self.grid.angle_resolved or self.system.pressure != 0.0
        return self.cellwise_limit(order) if cellwise else self._extremes_limit(order)

    def cellwise_limit(self, order: int) -> CellwiseLimit:
        """The bound cell by cell; no cells are crossed where the angle is no axis."""
        velocities = len(self.system.velocities)
        reach, ahead = (  # 0 along what is no axis
            (*lengths, 0.0)[:velocities] for lengths in (self._reach, self._ahead(order))
        )
        rates, each = dampings(self.terms, velocities), tuple(range(velocities))
        return CellwiseLimit(each, reach, rates, ahead, pressure=self.system.pressure)

    def _extremes_limit(self, order: int) -> ExtremesLimit:
        velocities, slaved = len(self.system.velocities), self.system.slaved
        driven = order > 1 and not slaved
        turn = LARGEST_TURN if order == 1 else largest_turn(max(self.grid.plane.shape))
        # The implicit turn of a first order scheme bears any step; the drift velocity does not.
        turn = turn if driven or slaved else math.inf
        rates = dampings(self.terms, velocities)
        return ExtremesLimit(
            (0, 1) if velocities < 3 else (0, 1, 2, 3),  # speed and force, spin and torque
            self._reach[0],  # cells are square
            self._ahead(order if driven else 1)[0],
            turn,
            (rates[0], rates[-1]),  # Gamma, Gamma_bar
            driven,
        )

    @property
    def _reach(self) -> tuple[float, ...]:
        """How far mass may move along each axis."""
        return tuple(self.cfl * self.grid.width(axis) for axis in self.axes)

    def _ahead(self, order: int) -> tuple[float, ...]:
        """Over which accelerations count: a second order scheme looks ahead, see `looking_ahead`."""
        if order == 1:
            return self._reach
        counts = {-1: max(self.grid.plane.shape), -2: max(self.grid.plane.shape)}
        counts[-3] = self.grid.angles
        return tuple(
            max(reach, looking_ahead(self.grid.width(axis), counts[axis]))
            for axis, reach in zip(self.axes, self._reach, strict=True)
        )

    def treat(
        self,
        limit: Limit,
        change: Kick | None = None,
        time: float = 0.0,
        *,
        fresh: bool = False,
        limits: bool = False,
    ) -> Floats:
        """Kick v and omega and turn a carried angle by `time` omega, in one pass; see `sources.treat`.

        fresh : at a new place or angle, so that a drift which is kept is evaluated first
        limits : return what the new velocities reach; 0 else
        """
        # One type of arguments for all passes, whether they kick or not.
        kick = change or exact_kick(self.terms, 0.0, len(self.system.velocities))
        work = Work(kick, change is not None, time if self.system.carried_angle else 0.0, limits)
        force = acceleration(self.terms, self.forces) if fresh or not self.keeps_drift else None
        return treat(self.cells, force, work, limit)

    def turn(self, limit: Limit, time: float) -> None:
        """Turn a carried angle by `time` omega."""
        if self.system.carried_angle:
            self.treat(limit, time=time)

    def allowed(self, limit: Limit) -> Allowed:
        """The step that the present velocities and forces allow, and its reason."""
        return limit.allowed(self.treat(limit, limits=True))

    def react(self, dt: float) -> None:
        """Further sources over dt, if the system has any."""
        if self.system.source is not None:
            self.system.source(self, dt)
