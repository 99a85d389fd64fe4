"""A scene: everything that fixes the physics, and the default resolution, of one simulation.

A part that a scene does not have is None, never a zero: no `[flow]` section, no drag. Lengths,
times and masses are in the units of the scene (the paper's scenes are dimensionless); angles are in
radian.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from ellipsoid_coupling.files.limits import (
    LEAST_CFL,
    LEAST_HARMONICS_TOLERANCE,
    LEAST_TOLERANCE,
    MOST_ANGLE_CELLS,
    MOST_COUNT,
    MOST_PATCHES,
    MOST_SEED,
    SMALLEST_STEP,
)
from ellipsoid_coupling.scenes.boundary import BoundaryPart
from ellipsoid_coupling.scenes.kinds import ANGULAR_POTENTIALS, OUTER_POTENTIALS, Record
from ellipsoid_coupling.scenes.sides import (
    OPPOSITE,
    SHORT_FORMS,
    SIDES,
    AtSide,
    SideName,
    keys_of,
)
from ellipsoid_coupling.scenes.start import Start
from ellipsoid_coupling.scenes.user_methods import SceneMethods
from ellipsoid_coupling.scenes.values import (
    Count,
    FlowTime,
    Interval,
    Line,
    Names,
    NotNegative,
    Number,
    Part,
    PathText,
    Positive,
    Times,
    file_name,
    require_interval,
)


class Domain(Part):
    """The rectangle of the grids and histograms, and what happens at its edge.

    `boundary` is "reflecting" (particles and the hyperbolic part bounce), "open" (Neumann: what
    reaches the edge leaves) or "periodic" (it comes in at the opposite side): at all sides that
    [boundaries] does not name.
    """

    x: Interval
    y: Interval
    boundary: Literal["open", "reflecting", "periodic"]

    @model_validator(mode="after")
    def _check(self) -> Self:
        require_interval("x", self.x)
        require_interval("y", self.y)
        return self

    @property
    def width(self) -> float:
        """Extent in x."""
        return self.x[1] - self.x[0]

    @property
    def height(self) -> float:
        """Extent in y."""
        return self.y[1] - self.y[0]


class Particles(Part):
    """The particles: length L and width D of the ellipse, mass m, moment of inertia I_c, number N."""

    length: Positive
    width: Positive
    mass: Positive = 1.0
    inertia: Positive = 1.0
    number: Count
    realisations: Count = 1

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.width > self.length:
            raise ValueError(f"a width of at most the length {self.length}, not {self.width}")
        return self

    @property
    def is_circle(self) -> bool:
        """Circles have no main axis: no torque between them and no strain in Jeffery's term."""
        return self.length == self.width


class Flow(Part):
    """The fluid: where its velocity comes from, and the relaxation rates gamma and gamma_bar.

    `source` "openfoam" names by `field` a case of foam_cases/ (solved with `cells` cells a side), or by
    `case` the folder of a solved one (relative to the scene file); "closed_form" a field of
    flow/analytic.py, or a registered one, with its `parameters`; a field that is not linear is sampled
    with `cells` cells a side of the domain. With "given" the flow comes with the run: --flow, or `flow`
    of `simulate`.

    `divergence` keeps the sources of an OpenFOAM flow, where its face fluxes do not close.

    `time` says which times of the case: "latest", one of them, "all", or [t_0, t_1]. With several the
    flow is linear in time in between, and the scene's time 0 is the first of them, or t_0. With `repeat`
    the last of them is the first one, one period later.
    """

    source: Literal["openfoam", "closed_form", "given"] = "openfoam"
    field: PathText | None = None
    case: PathText | None = None
    cells: Count = 100
    time: FlowTime = "latest"
    repeat: bool = False
    divergence: bool = False
    drag: NotNegative
    angular_drag: NotNegative
    parameters: dict[str, Number] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.source == "given":
            if (self.field, self.case, self.parameters) != (None, None, None):
                raise ValueError('no field, case or parameters where source = "given"')
        elif (self.field is None) == (self.case is None):
            raise ValueError("either field or case")
        of_openfoam = self.case, self.time, self.repeat, self.divergence
        if self.source == "closed_form" and of_openfoam != (None, "latest", False, False):
            raise ValueError(
                "field alone for a closed form: case, time, repeat and divergence are OpenFOAM's"
            )
        if not isinstance(self.time, str | float):
            require_interval("time", self.time)
        elif self.repeat and self.time != "all":
            raise ValueError('time = "all" or [t_0, t_1] for a flow that repeats')
        return self

    @property
    def name(self) -> str:
        """The field's name, or the case's path."""
        return self.field or self.case or self.source

    @property
    def named(self) -> tuple[object, ...]:
        """What the flow itself depends on: all but the rates."""
        times = self.time, self.repeat
        return self.source, self.name, self.cells, self.parameters or {}, times, self.divergence


class InteractionPart(Part):
    """The pair potential's strength eps0; its shape follows from the particles' size."""

    strength: Positive


class WallsPart(Part):
    """Ghost particles and ghost cells at the walls: which ones, how much stronger, how dense.

    `sides` names sides of the domain, or patches that [boundaries] names; without it, these are all sides
    and patches that reflect.
    """

    sides: Names | None = None
    strength_factor: Positive = 10.0
    ghost_density: Literal["matched", "paper"] = "matched"

    @model_validator(mode="after")
    def _check(self) -> Self:
        named = self.sides or ()
        if len(set(named)) < len(named):
            raise ValueError(f"each of sides once, not {', '.join(named)}")
        return self


class GravityPart(Part):
    """An acceleration of all particles, the same everywhere."""

    x: Number = 0.0
    y: Number = 0.0


class Noise(Part):
    """A and B: random kicks A dW with damping A^2/2, B likewise for the angular velocity."""

    noise: NotNegative
    angular_noise: NotNegative


class Numerics(Part):
    """The default resolution; each model and scheme takes what it needs.

    `cell` is h of the grids, `angle_cells` the number of cells in [0, 2 pi); `time_step` is the
    particles' step in the scheme `paper`, `tolerance` the error that the scheme `accurate` allows a
    particle step (in particle lengths and radian); `cfl` is the CFL number of the grids;
    `interaction` chooses how a grid's interaction integral is summed ("direct": to rounding) and
    `harmonics_tolerance` how exactly (relative to the largest possible force; from 1e-4 on in single
    precision); `flux` names the numerical flux of the grids, else it is the scheme's own.
    """

    cell: Positive
    angle_cells: Annotated[int, Field(ge=1, le=MOST_ANGLE_CELLS)] = 60
    time_step: Positive = 0.01
    tolerance: Annotated[Positive, Field(ge=LEAST_TOLERANCE)] = 1e-4
    cfl: Annotated[float, Field(ge=LEAST_CFL, le=1)] = 0.9
    interaction: Literal["auto", "direct", "harmonics"] = "auto"
    harmonics_tolerance: Annotated[Positive, Field(ge=LEAST_HARMONICS_TOLERANCE)] = 2e-2
    flux: Line | None = None


class Scene(SceneMethods):
    """One simulation's physics. Built by `load_scene`; see the class of each part for its keys."""

    name: Annotated[str, AfterValidator(file_name)]
    title: Line = ""
    units: Literal["SI"] | None = None
    times: Times
    domain: Domain
    particles: Particles
    start: Start
    numerics: Numerics
    boundaries: Annotated[dict[Line, BoundaryPart], Field(max_length=MOST_PATCHES)] | None = None
    flow: Flow | None = None
    interaction: InteractionPart | None = None
    walls: WallsPart | None = None
    gravity: GravityPart | None = None
    outer_potential: Annotated[Record, OUTER_POTENTIALS] | None = None
    angular_potential: Annotated[Record, ANGULAR_POTENTIALS] | None = None
    noise: Noise | None = None

    @model_validator(mode="before")
    @classmethod
    def _box_of_file(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        start, domain = values.get("start"), values.get("domain")
        if not (isinstance(start, dict) and isinstance(domain, dict) and start.get("file")):
            return values
        box = {axis: domain[axis] for axis in ("x", "y") if axis in domain}
        return values | {"start": box | start}

    @model_validator(mode="after")
    def _check(self) -> Self:
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("increasing times")
        if self.numerics.time_step < SMALLEST_STEP * self.times[-1]:
            raise ValueError(
                f"numerics.time_step of at least {SMALLEST_STEP:g} of the last of times "
                f"({self.times[-1]:g}), not {self.numerics.time_step:g}, which no longer moves the clock"
            )
        self._check_sides()
        if self.start.velocity == "fluid" and self.flow is None:
            raise ValueError('[flow] with start.velocity = "fluid"')
        if self.walls is not None and self.interaction is None:
            raise ValueError("[interaction] with [walls], whose ghosts act through its potential")
        for axis in ("x", "y"):
            box, domain = getattr(self.start, axis), getattr(self.domain, axis)
            if box[0] < domain[0] or box[1] > domain[1]:
                raise ValueError(f"start.{axis} within domain.{axis} {domain}, not {box}")
        points = self.start.points
        if points is not None and len(points) != self.particles.number:
            raise ValueError(f"particles.number = {len(points)}, the number of start.points")
        return self

    def _check_sides(self) -> None:
        sides = self.sides
        for name, side in sides.items():
            other = sides[OPPOSITE[name]]
            if side.particles == "wrap" != other.particles:
                raise ValueError(
                    f"{side.kind} sides opposite one another, not on the {name} alone "
                    f"({OPPOSITE[name]}: {other.kind})"
                )
        if self.walls is not None:
            self._check_walls(self.walls)

    def _check_walls(self, walls: WallsPart) -> None:
        known = self.named_patches | {str(name): side for name, side in self.sides.items()}
        for name in walls.sides or ():
            if name not in known:
                raise ValueError(
                    f"walls.sides of {', '.join(SIDES)} or patches that [boundaries] names, not {name}"
                )
        reflecting = [name for name, part in known.items() if part.particles == "reflect"]
        for name in walls.sides or (reflecting or SIDES)[:1]:
            if name not in reflecting:
                raise ValueError(
                    'domain.boundary = "reflecting" for [walls], or a kind that reflects on their '
                    f"sides, not {known[name].kind} on the {name}"
                )

    @property
    def wall_sides(self) -> tuple[SideName, ...]:
        """The sides of the domain that have ghosts."""
        if self.walls is None:
            return ()
        named = self.walls.sides
        return tuple(
            name
            for name, side in self.sides.items()
            if (side.particles == "reflect" if named is None else name in named)
        )

    @property
    def sides(self) -> dict[SideName, BoundaryPart]:
        """What happens at each side of the domain: left, right, bottom, top."""
        named = self.boundaries or {}
        short = BoundaryPart(kind=SHORT_FORMS[self.domain.boundary])
        return {name: named.get(name, short) for name in SIDES}

    @property
    def named_patches(self) -> dict[str, BoundaryPart]:
        """The boundaries that are no sides of the domain, so must be patches of the flow's case."""
        return {name: part for name, part in (self.boundaries or {}).items() if name not in SIDES}

    @property
    def has_inflow(self) -> bool:
        """Whether mass may come in at some side or patch."""
        parts = [*self.sides.values(), *self.named_patches.values()]
        return any(keys_of(part.kind).inflow for part in parts)

    def has_sides(self, particles: AtSide) -> bool:
        """Whether particles do this at some side: "reflect", "leave" or "wrap"."""
        return any(side.particles == particles for side in self.sides.values())


class RunPart(Part):
    """The [run] part of a run.toml: what `run` was told beside the scene."""

    model: Line | None = None
    scheme: Line = "accurate"
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 0
    realisations: Count | None = None
    first_realisation: Annotated[int, Field(ge=0, le=MOST_COUNT)] = 0
    flow: str = "none"
    flow_digest: Line = "none"
    start_digest: Line = "none"

    @property
    def numbers(self) -> range | None:
        """The numbers of its realisations; None where it does not say how many there are."""
        first = self.first_realisation
        return None if self.realisations is None else range(first, first + self.realisations)
