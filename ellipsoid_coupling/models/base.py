"""The protocol of a model, and the setup that it is built from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models.earlier import Earlier
from ellipsoid_coupling.models.failure_site import FailureSite
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.schemes import SchemeName
from ellipsoid_coupling.scenes import Scene, Terms

Arrays = dict[str, NDArray[np.generic]]
# Any: a number or a text, which the name decides.
Counts = dict[str, Any]


@dataclass(frozen=True)
class Setup:
    """Everything that a model is built from; two equal setups give the same bits.

    `flow` is None for a scene without a fluid, and in `Model.require_fit`, which looks at the scene alone.
    One that changes holds from its last given time up to the next, `flow.until`, and no `advance` goes
    beyond that; in between two calls it moves on in place. `flow.at(t)` is the flow at a time, and kernels
    take `flow.in_time`.
    The run holds `realisations` from number `first_realisation` on. Their numbers name their random
    numbers, so that a part of a large run has the bits that it has in the whole.
    `earlier` is the state that start.file names, and None without it; see `start_state`.
    """

    scene: Scene
    terms: Terms
    scheme: SchemeName
    flow: FlowField | None
    seed: int
    realisations: int
    first_realisation: int = 0
    earlier: Earlier | None = None


class Health(NamedTuple):
    """What the monitors check.

    Attributes
    ----------
    mass : float
        Of all that is inside the domain; of particles, the part that is still on the flow's mesh.
    least_density : float
        The smallest density of any cell; 0 for particles.
    speeds : (float, float)
        Root mean square of v and of omega, weighted by mass.
    forces : (float, float)
        Upper bounds of the drift's size, per mass and per inertia, without the damping. Particles give
        the largest of all steps so far, grids the present one. Infinite under pressure, which drives as
        well.
    outside : int
        Coordinates of particles beyond reflecting walls; 0 for grids and for open edges.
    left : float
        Of grids the mass that has left through the boundary, less what came in; 0 for particles.
    """

    mass: float
    least_density: float
    speeds: tuple[float, float]
    forces: tuple[float, float]
    outside: int = 0
    left: float = 0.0


class Model(Protocol):
    """One model on one scene, somewhere between start and end: all that the time loop asks for.

    A class with these members is a model. It is found by itself as `MODEL` of a file in
    `ellipsoid_coupling.models`, and is added from outside by `register_model`.

    The contract is the same bits: two models that are built from equal setups give equal snapshots,
    for any number of threads and wherever `advance` is cut into calls, and a model that is restored
    from a `state` continues as if it had never stopped. So a step depends on nothing but the setup and
    the state: random numbers come from `Setup.seed` and a counter that stands in the state, and no step
    is shortened for the clock on the wall.

    Attributes
    ----------
    kinds : tuple of ModelKind
        The properties that the class declares, one entry for each of its names.
    name : str
        The name that it was built by.
    """

    kinds: ClassVar[tuple[ModelKind, ...]]
    name: str

    def __init__(self, name: str, setup: Setup) -> None:
        """Build the model called `name` and put it to the scene's start."""
        ...

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Refuse a scene that the model has no equations for; called before a flow is there.

        Allocates and computes nothing.

        Raises
        ------
        InputError
            With the key at fault, the expected value and a remedy.
        """
        ...

    @property
    def time(self) -> float:
        """The time, in the scene's unit, that all of the model has reached."""
        ...

    def advance(self, until: float) -> None:
        """Take some steps, none beyond `until`, and reach it after a finite number of calls.

        A call takes a bounded amount of work, best some hundredths of a second: between calls progress
        is shown, the monitors look and checkpoints are written. The steps do not depend on how they are
        cut into calls.

        Raises
        ------
        RunError
            If a step is impossible, with the time, the position and a remedy.
        """
        ...

    def snapshot(self) -> Arrays:
        """The variables of the result file at the present time, float64 in the scene's units.

        Axes by `ModelKind.layout`, without the axis of time:

            particles   (realisation, particle)   x, y, angle, velocity_x, velocity_y, angular_velocity
            rho         (y, x)                    density, mean_angle, and the three velocities
            q           (angle, y, x)             density and the three velocities

        Angles are in radian and not reduced; a density is mass per area (rho), or per area and radian
        (q), of a mass of 1 in all. Velocities are 0 where there is no mass. The arrays are the caller's
        own: later steps do not change them.
        """
        ...

    def state(self) -> Arrays:
        """Everything that `restore` needs to go on bit for bit, as a dictionary of arrays of numbers.

        Names, shapes and dtypes stay the same for the whole run. The arrays may be the model's own.
        """
        ...

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`, of which some arrays may be left out: these keep their values."""
        ...

    def failure_site(self) -> FailureSite:
        """Where the drift is strongest now, and by which term: for the message of a failure."""
        ...

    def health(self) -> Health:
        """What the monitors check after each `advance`; cheap against a step."""
        ...

    def counts(self) -> Counts:
        """Attributes for the result file, numbers and texts.

        Required are mass_start, mass_end and mass_left (through open edges), whose balance the monitors
        and the stability map check, and steps. `step_control.step_log` makes the log of the steps,
        `run_warnings.as_counts` the sentences of `Result.warnings`.
        """
        ...

    def coordinates(self) -> dict[str, NDArray[np.float64]]:
        """The coordinates of the snapshot's axes that are not plain counts: x, y (m,), angle (na,)."""
        ...


def listed(numbers: Mapping[str, float]) -> str:
    """Names and numbers in one line: "outlet 0.25, cylinder 0"."""
    return ", ".join(f"{name} {number:.12g}" for name, number in numbers.items())
