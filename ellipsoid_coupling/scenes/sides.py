"""The sides of the domain as scene files name them: the kinds that there are, and their keys.

    [boundaries.left]        kind is a name that `declare_kind` has made known; every other key is a
    kind = "reflecting"      parameter of that kind, a number

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

# What a particle does that reaches a side: it turns round, it is gone, it comes in on the other side.
AtSide = Literal["reflect", "leave", "wrap"]


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
    "open": KindKeys("leave"),
    "periodic": KindKeys("wrap"),
    "reflecting": KindKeys("reflect"),
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
