"""What every model offers to the time loop, and what it is built from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models.failure_site import Spot
from ellipsoid_coupling.scenes import Scene, Terms

Arrays = dict[str, NDArray[np.generic]]
Counts = dict[str, Any]
SchemeName = Literal["paper", "accurate"]


@dataclass(frozen=True)
class Setup:
    """Everything a model is built from; two equal setups give the same bits."""

    scene: Scene
    terms: Terms
    scheme: SchemeName
    flow: FlowField | None  # None, too, while only the scene is looked at: `Model.require_fit`
    seed: int
    realisations: int


class Health(NamedTuple):
    """What the monitors watch.

    Attributes
    ----------
    mass : float
        Of all that is inside; of particles, the part that has not left the flow's mesh.
    least_density : float
        0 for particles.
    speeds : (float, float)
        Root mean square of v and of omega, by mass.
    forces : (float, float)
        Bounds of the drift, per mass and per inertia, without its linear part: of particles, in all
        steps so far, of grids now; infinite where something else drives as well (pressure).
    outside : int
        Particles' coordinates beyond reflecting walls; 0 for grids and where edges are open.
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
    """One model on one scene, somewhere between start and end.

    `advance` does a bounded amount of work, so that progress can be shown and checkpoints written
    between calls; the steps that it takes do not depend on how it is cut into calls.
    """

    names: ClassVar[tuple[str, ...]]
    layout: ClassVar[Literal["particles", "rho", "q"]]
    # Whether all that it holds takes each step at once, or one realisation after another.
    together: ClassVar[bool]

    def __init__(self, name: str, setup: Setup) -> None:
        """Build the model called `name` and put it to the scene's start."""
        ...

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError for a scene that the model does not fit; looks at no flow, costs nothing."""
        ...

    @property
    def time(self) -> float:
        """The time that all of the model has reached."""
        ...

    def advance(self, until: float) -> None:
        """Take some steps, none beyond `until`; raises RunError where it cannot go on."""
        ...

    def snapshot(self) -> Arrays:
        """The variables of the result file at the present time (without the time axis)."""
        ...

    def state(self) -> Arrays:
        """Everything that a later `restore` needs to go on bit for bit."""
        ...

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        ...

    def spot(self) -> Spot:
        """Where the drift is strongest now, and by which term."""
        ...

    def health(self) -> Health:
        """What the monitors watch; cheap against a step."""
        ...

    def counts(self) -> Counts:
        """Attributes for the result file: the log of the steps, mass, ..."""
        ...

    def coordinates(self) -> dict[str, NDArray[np.float64]]:
        """The coordinates of the snapshot's axes that are not plain counts."""
        ...
