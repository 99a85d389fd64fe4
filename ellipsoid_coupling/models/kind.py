"""The properties that a model declares, by which others choose instead of by its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from ellipsoid_coupling.physics.closure import Pressure
from ellipsoid_coupling.scenes import Scene

Layout = Literal["particles", "rho", "q"]


class LineStyle(NamedTuple):
    """How a model is drawn in every figure; the default is that of an undeclared model, grey dots.

    Attributes
    ----------
    colour : str
        For colour-blind readers, the palette of Okabe and Ito.
    dashes : str or (offset, lengths)
        As `linestyle` of matplotlib.
    marker : str
    """

    colour: str = "#555555"
    dashes: str | tuple[float, tuple[float, ...]] = (0.0, (1.0, 2.0))
    marker: str = "X"


def _not_summed(scene: Scene) -> str:
    del scene
    return "which this model does not have"


_UNDECLARED = LineStyle()


class Variable(NamedTuple):
    """A variable of results beside those of the layout: its name, and its attributes in a result file."""

    name: str
    units: str
    long_name: str


@dataclass(frozen=True)
class ModelKind:
    """One name of a model, and the properties that decide how it is run, compared and drawn.

    Attributes
    ----------
    name : str
        For the command line, `simulate` and result files.
    label : str
        For figures and tables.
    layout : "particles", "rho" or "q"
        The axes of its snapshots: see `Model.snapshot`.
    rank : int
        Its place in lists of models: from particles down to limits. Models from outside stand last.
    solves, needs : str
        What it solves, and what a scene must have or leave out for it, for `ellipsoid models`.
    style : LineStyle
    independent_realisations : bool
        Every realisation is a system of its own, and is stepped alone. Otherwise all that the model
        holds is one density, and takes each step at once.
    random_motion : bool
        Noise moves the model's particles. In a closure it only damps.
    summation : callable
        (scene with interaction) -> how the model sums it, in words for `ellipsoid plan`.
    pressure : float or record
        That of the closure, see `physics.closure`; where it is not 0, a step costs more and keeps more
        memory.
    overdamped : bool
        Velocities follow from the forces at every moment, so everything that moves must be damped.
    variables : tuple of Variable
        What its snapshots hold besides the variables of the layout.
    equilibrium : bool
        The model is a state without time and fluid, so it cannot be refined against run time.
    """

    name: str
    label: str
    layout: Layout
    rank: int = 100
    solves: str = ""
    needs: str = ""
    style: LineStyle = _UNDECLARED
    independent_realisations: bool = False
    random_motion: bool = False
    summation: Callable[[Scene], str] = _not_summed
    pressure: Pressure = 0.0
    overdamped: bool = False
    equilibrium: bool = False
    variables: tuple[Variable, ...] = ()

    @property
    def is_grid(self) -> bool:
        """Whether the unknowns live on cells."""
        return self.layout != "particles"

    @property
    def is_sampled_density(self) -> bool:
        """Whether the particles are samples of one density, which they all interact with."""
        return not self.is_grid and not self.independent_realisations
