"""Where particles start: [start] of a scene file."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any, Literal, Self

from pydantic import model_validator

from ellipsoid_coupling.scenes.values import (
    Interval,
    Number,
    Part,
    PathText,
    Points,
    require_interval,
)

# The copy of start.file in a run's folder, by which run.toml calls it.
KEPT_START = "start.nc"


class Start(Part):
    """Where the particles start: the box Omega_0, filled evenly, and the start angle.

    Or `points`, one [x, y] or [x, y, angle] a particle (of one realisation), at `angle` where none
    is given; x and y then are the box around them, and may be left out.

    They start at rest, or with `velocity` "fluid" as the fluid there moves and turns.

    Or as they were at the end of an earlier run, whose result.nc `file` names (relative to the scene
    file): places, angles and all velocities. x and y then are the domain, and may be left out.
    """

    x: Interval
    y: Interval
    angle: Number = 0.0
    points: Points | None = None
    velocity: Literal["rest", "fluid"] = "rest"
    file: PathText | None = None

    @model_validator(mode="before")
    @classmethod
    def _box_of_points(cls, values: Any) -> Any:
        if not isinstance(values, dict) or values.get("points") is None:
            return values
        boxes = {"x": (0.0, 0.0), "y": (0.0, 0.0)}
        # What is wrong with the points is told with their own key.
        with suppress(TypeError, ValueError, LookupError):
            for d, name in enumerate("xy"):
                column = [float(point[d]) for point in values["points"]]
                boxes[name] = (min(column), max(column))
        return boxes | values

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.file is not None and (self.points is not None or self.velocity != "rest"):
            raise ValueError("file alone, without points or velocity: it has both")
        if self.points is None:
            require_interval("x", self.x)
            require_interval("y", self.y)
            return self
        for d, (low, high) in enumerate((self.x, self.y)):
            if not all(low <= point[d] <= high for point in self.points):
                raise ValueError(f"points within {'xy'[d]} = {[low, high]}")
        return self

    @property
    def turns(self) -> float:
        """Whole turns in the (first point's) angle, radian; 0 up to half a turn.

        Models keep angles less this and add it to what they show: 1e9 + dt omega would lose digits.
        """
        angles = [point[2] for point in self.points or () if len(point) == 3]
        first = angles[0] if angles else self.angle
        # sin and cos of the angle itself: 2 pi rounded, times the turns, would be off.
        return first - math.atan2(math.sin(first), math.cos(first)) if abs(first) > math.pi else 0.0

    def _less_turns(self, angle: float) -> float:
        turns = self.turns
        if turns == 0.0:
            return angle
        part = math.atan2(math.sin(angle), math.cos(angle))
        return part + 2.0 * math.pi * round((angle - turns - part) / (2.0 * math.pi))

    @property
    def own_angle(self) -> float:
        """`angle` less `turns`."""
        return self._less_turns(self.angle)

    def places(self) -> list[tuple[float, float, float]]:
        """(x, y, angle less `turns`) of every one of `points`; empty without them."""
        return [
            (p[0], p[1], self._less_turns(p[2] if len(p) == 3 else self.angle))
            for p in self.points or ()
        ]
