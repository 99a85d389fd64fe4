"""Boundaries as scene files name them: the kinds that there are, and their keys.

    [boundaries.NAME]        NAME is a side of the domain, or a patch of the flow's case;
    kind = "reflect"         kind is a name that `declare_kind` has made known; every other key is a
                             parameter of that kind, a number

What a kind does to cells and particles stands in `geometry.boundaries`, one file a kind.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

SideName = Literal["left", "right", "bottom", "top"]
SIDES: tuple[SideName, ...] = ("left", "right", "bottom", "top")
OPPOSITE: dict[SideName, SideName] = {
    "left": "right",
    "right": "left",
    "bottom": "top",
    "top": "bottom",
}

# What a particle does that reaches a boundary: it turns round, it is gone, it comes in on the other side.
AtSide = Literal["reflect", "leave", "wrap"]
# What domain.boundary, the short form for all sides, stands for.
SHORT_FORMS = {"reflecting": "reflect", "open": "remove", "periodic": "periodic"}


class KindKeys(NamedTuple):
    """One kind of boundary, as a scene file sees it.

    Attributes
    ----------
    particles : "reflect", "leave" or "wrap"
        What a particle does there.
    inflow : bool
        Whether mass may come in.
    required, optional : tuple of str
        The names of its parameters.
    """

    particles: AtSide
    inflow: bool = False
    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()


_KINDS = {
    "inlet": KindKeys("leave", inflow=True, required=("density",), optional=("angle",)),
    "periodic": KindKeys("wrap"),
    "reflect": KindKeys("reflect"),
    "remove": KindKeys("leave"),
    "stick": KindKeys("leave"),
}


def declare_kind(name: str, keys: KindKeys) -> None:
    """Make a kind of boundary known to scene files.

    Raises
    ------
    ValueError
        If there is another one of that name.
    """
    if _KINDS.setdefault(name, keys) != keys:
        raise ValueError(f"there is another kind of boundary named {name!r}")


def known_kinds() -> list[str]:
    """The names of all kinds of boundary, sorted."""
    return sorted(_KINDS)


def keys_of(kind: str) -> KindKeys:
    """What scene files know of a kind; KeyError for an unknown one."""
    return _KINDS[kind]
