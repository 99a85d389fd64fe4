"""What the variables of result files are, by the CF conventions: units, long names, axes, remarks."""

from __future__ import annotations

from typing import NamedTuple

CONVENTIONS = "CF-1.11"
REFERENCES = "Borsche, Klar, Meurer, Tse: Mean field models for interacting ellipsoidal particles"

_ANGLE = (
    "radian, anticlockwise from the x axis to the main axis, not reduced to one turn; ellipses have no "
    "head: angles that differ by pi are one orientation"
)


class _Quantity(NamedTuple):
    """`units` of a scene without any, `si` of one in metres and seconds."""

    units: str
    si: str
    long_name: str
    axis: str = ""
    comment: str = ""


_QUANTITIES = {
    "time": _Quantity("1", "s", "time", axis="T", comment="since the start of the run"),
    "x": _Quantity("1", "m", "position, x", axis="X"),
    "y": _Quantity("1", "m", "position, y", axis="Y"),
    "realisation": _Quantity("1", "1", "number of the realisation"),
    "particle": _Quantity("1", "1", "number of the particle"),
    "angle": _Quantity("rad", "rad", "angle of the main axis against the x axis", comment=_ANGLE),
    "velocity_x": _Quantity("1", "m s-1", "velocity, x"),
    "velocity_y": _Quantity("1", "m s-1", "velocity, y"),
    "angular_velocity": _Quantity("rad", "rad s-1", "angular velocity, per unit of time"),
    "density": _Quantity("1", "m-2", "probability density"),
    "mean_angle": _Quantity(
        "rad", "rad", "mean angle of the main axis against the x axis", comment=_ANGLE
    ),
    "frozen": _Quantity(
        "1", "1", "1 where the particle has left the flow's mesh and stays where it left it"
    ),
    "fate": _Quantity(
        "1", "1", "what has become of the particle: the patch at which it ended, and where it stays"
    ),
    "end_time": _Quantity(
        "1", "s", "when the particle ended at a patch; NaN as long as it has not"
    ),
}


def attributes_of(name: str, dimensions: tuple[str, ...], *, si: bool) -> dict[str, str]:
    """The attributes of a variable or coordinate over these dimensions; KeyError for an unknown one."""
    known = _QUANTITIES[name]
    made = {"units": known.si if si else known.units, "long_name": known.long_name}
    if name == "density" and "angle" in dimensions:
        made["units"] = "m-2 rad-1" if si else "rad-1"
    if dimensions == (name,) and known.axis:
        made["axis"] = known.axis
    return made | ({"comment": known.comment} if known.comment else {})
