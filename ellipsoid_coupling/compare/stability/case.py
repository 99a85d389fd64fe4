"""A case of the stability map: a change of one small scene.

The small scene is a box with walls and a rigid rotation: 40 particles in 2 realisations, 12 x 12
cells and 16 angles, t = 2, so that the whole map takes some minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.analytic import (
    LinearFlow,
    closed_form_flow,
    linear_flow,
    reach_of,
)
from ellipsoid_coupling.models import ModelKind
from ellipsoid_coupling.scenes import Scene, scene_from_table, set_key

# Any: nested sections and values of a scene, which `scene_from_table` validates.
Table = dict[str, Any]

HALF = 0.5
REACH = 2.0 * math.sqrt(2.0) * 0.1

SMALL: Table = {
    "name": "small",
    "times": [2.0],
    "domain": {"x": [-HALF, HALF], "y": [-HALF, HALF], "boundary": "reflecting"},
    "particles": {
        "length": 0.1,
        "width": 0.05,
        "mass": 1.0,
        "inertia": 1e-2,
        "number": 40,
        "realisations": 2,
    },
    "start": {"x": [-0.25, 0.25], "y": [-0.25, 0.25], "angle": 0.0},
    "flow": {"source": "closed_form", "field": "rotation", "drag": 10.0, "angular_drag": 10.0},
    "interaction": {"strength": 0.1},
    "walls": {},
    "numerics": {
        "cell": 1.0 / 12,
        "angle_cells": 16,
        "time_step": 0.01,
        "harmonics_tolerance": 2e-2,
    },
}
# Changes for an equilibrium, which has neither fluid nor walls.
EQUILIBRIUM: Table = {
    "flow": None,
    "walls": None,
    "noise": None,
    "outer_potential.stiffness": 10.0,
    "particles.inertia": 1.0,
}
# The families that vary a property which an equilibrium has.
_TIMELESS = ("as it is", "aspect ratio", "eps0", "domain")
# Without these there is no overdamped limit.
_DRAGS = ("flow", "flow.drag", "flow.angular_drag")
_NOTHING = (None, 0.0)


@dataclass(frozen=True)
class Case:
    """One row of the map.

    Attributes
    ----------
    family, value : str
        The varied quantity and its value.
    settings : dict
        Dotted keys of the scene; the value None takes a part out.
    gradient : float
        Factor on the flow's velocity.
    only : callable, optional
        Whether a model is run (`ModelKind` -> bool); all if left out.
    quick : bool
        Is part of the short map (`--quick`, tests).
    overdamped_end : float
        The end time for overdamped models, whose speeds go like the force itself and not like its root;
        0 for the end time of all.
    background : float
        This density is added in all cells of a grid.
    reference : bool
        False where a finer run would take too long.
    """

    family: str
    value: str
    settings: Table
    gradient: float = 1.0
    only: Callable[[ModelKind], bool] | None = None
    quick: bool = False
    overdamped_end: float = 0.0
    background: float = 0.0
    reference: bool = True

    @property
    def name(self) -> str:
        """The varied quantity and its value."""
        return f"{self.family} {self.value}"

    def suits(self, kind: ModelKind) -> bool:
        """Whether the model has the quantity that is varied."""
        if kind.equilibrium and self.family not in _TIMELESS:
            return False
        if kind.overdamped and any(self.settings.get(key, 1.0) in _NOTHING for key in _DRAGS):
            return False
        return self.only is None or self.only(kind)

    def scene(self, kind: ModelKind, finer: Table | None = None) -> Scene:
        """The small scene with this case's changes, for one model.

        Raises
        ------
        InputError
            Where the changes are no scene, for example for a start outside of the domain.
        """
        table: Table = {k: dict(v) if isinstance(v, dict) else v for k, v in SMALL.items()}
        own = EQUILIBRIUM if kind.equilibrium else {}
        if kind.overdamped and self.overdamped_end:
            own = {"times": [self.overdamped_end]}
        for key, value in (self.settings | own | (finer or {})).items():
            set_key(table, key, value)
        return scene_from_table(table, f"case {self.name}")

    def flow(self, scene: Scene) -> FlowField | None:
        """The scene's flow, faster where the case asks for it."""
        if scene.flow is None:
            return None
        if self.gradient == 1.0:
            return closed_form_flow(scene.flow, scene.domain)
        reach = reach_of((scene.domain.x, scene.domain.y))
        return linear_flow(_FAST[scene.flow.name](self.gradient), reach)


_FAST = {
    "rotation": lambda g: LinearFlow(0.0, g, -g, f"u = {g:g} (y, -x)"),
    "shear": lambda g: LinearFlow(0.0, g, 0.0, f"u = {g:g} (y, 0)"),
    "top_bottom": lambda g: LinearFlow(-g, 0.0, 0.0, f"u = {g:g} (-x, y)"),
}
