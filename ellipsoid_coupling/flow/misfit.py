"""How far a field is off the U of the solver that it was read from, and whether that is too far."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.errors import InputError

# A field further off U than this, rms over the fluid's area or over the edges of walls, is another flow.
LARGEST_MISFIT = 0.05
# More of the misfit than this beside walls, squared, is told to be theirs.
_MOSTLY = 0.5


class Misfit(NamedTuple):
    """Of a field, against the solver's U.

    Attributes
    ----------
    cells : float
        In the cells, rms over the fluid's area, of U's own rms.
    walls : float
        At walls, rms over their edges, of the largest speed.
    beside : float
        The part of `cells`, squared, that lies in cells beside walls.
    gap : float
        By how much the solver's fluxes do not close, as a part of psi's range; 0 without fluxes, and
        where the field has these sources.
    speed, top : float
        U's rms and its largest.
    """

    cells: float
    walls: float
    beside: float
    gap: float
    speed: float
    top: float

    def of(self, speed: float, top: float) -> tuple[float, float]:
        """`cells` and `walls` as parts of another rms and another largest speed."""
        return (
            self.cells * (self.speed / speed if speed > 0.0 else 1.0),
            self.walls * (self.top / top if top > 0.0 else 1.0),
        )


def percent(part: float) -> str:
    """In words: 0.31 %, 12 %, 250 %."""
    return f"{100.0 * part:.2g} %" if part < 0.995 else f"{100.0 * part:.0f} %"


def require_near(where: str, misfit: Misfit, largest: Misfit | None = None) -> None:
    """Refuse a field that is more than `LARGEST_MISFIT` off.

    Parameters
    ----------
    where : str
        The case.
    misfit : Misfit
    largest : Misfit, optional
        Whose `speed` and `top` are the largest of a series: what is off is a part of these.

    Raises
    ------
    InputError
    """
    own = misfit.cells, misfit.walls
    counted = own if largest is None else misfit.of(largest.speed, largest.top)
    if max(counted) <= LARGEST_MISFIT:
        return
    cells = counted[0] > LARGEST_MISFIT
    part = (
        f"{percent(own[0])} off (rms) in the cells"
        if cells
        else f"{percent(own[1])} off (rms) at walls"
    )
    if largest is not None and counted != own:
        part += f", {percent(counted[0 if cells else 1])} of the largest U of all times"
    if cells and misfit.beside > _MOSTLY:
        part += ", most of it beside walls whose layers are thinner than a cell"
    remedy = "Give a solved plane incompressible flow, or solve it on a finer mesh; "
    if misfit.gap > 0.0:
        part += f"; its phi does not close by {percent(misfit.gap)}"
        remedy = (
            "Set flow.divergence = true (ellipsoid new --divergence) where the fluid has sources, else "
            "give a solved plane incompressible flow; "
        )
    raise InputError(
        where, f"a velocity U without sources, resolved by the mesh to {LARGEST_MISFIT:.0%}",
        f"one whose best stream function is {part}",
        f"{remedy}--allow-misfit (allow_misfit=True) takes it as it is.",
    )  # fmt: skip
