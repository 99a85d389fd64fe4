"""What a new scene takes from a case: domain, start, times, particles and their drag."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.scales import Box, FlowScales, flow_scales, roomiest_box
from ellipsoid_coupling.physics.stokes import StokesRates, stokes_rates
from ellipsoid_coupling.scenes.sides import SIDES, SideName
from ellipsoid_coupling.scenes.values import file_name

# Cells along the longer side of the domain, about.
_CELLS = 100
# Of the domain's shorter side: a particle's length, where the user gives none; its width over that.
_LENGTH, _ASPECT = 0.02, 0.5
# The part of the largest box of fluid in which particles start, in each direction.
_START = 0.5
# Parts of the time in which the fluid passes the box, at which results are saved.
_SAVED = (0.25, 0.5, 1.0)
# Without nu: gamma in units of the flow's largest shear, so that particles follow it closely.
_FOLLOWING = 10.0
# Relative: the same but for rounding; in one place, where a mesh may be saved in single precision.
_SAME, _ON_SIDE = 1e-9, 1e-5
# Digits of a number that all are right.
_EXACT = 15
_LONGEST_NAME = 80


class Wishes(NamedTuple):
    """What a user knows of the particles.

    length, width : None for a choice by the domain's size
    density : mass per volume, in units of the fluid's
    """

    length: float | None = None
    width: float | None = None
    density: float = 2.0


class Choices(NamedTuple):
    """The numbers of a new scene.

    periodic : the sides of the domain on which cyclic patches lie, by the patches' names
    start : the box in which particles start, all of it fluid
    once : the time in which the fluid passes the domain
    stokes : whether `rates` are those of Stokes' drag; else they are a guess
    """

    name: str
    domain: Box
    periodic: dict[str, SideName]
    cell: float
    start: Box
    scales: FlowScales
    once: float
    times: tuple[float, ...]
    time_step: float
    length: float
    width: float
    rates: StokesRates
    stokes: bool


def choose(
    field: FlowField, name: str, viscosity: float | None = None, wishes: Wishes | None = None
) -> Choices:
    """The choices for a flow, of a case of that name.

    viscosity : nu, if it is known: drag, mass and inertia then are those of `stokes_rates`

    Raises
    ------
    InputError
        For a flow without room, without an end or at rest, or particles that are none.
    """
    box = _mesh_box(field)
    (x_low, x_high), (y_low, y_high) = box
    if math.isinf(x_low):
        raise InputError(name, "the flow of a case", "one without an end", "Name a solved case.")
    periodic = _periodic_sides(box, field.outline)
    upright = y_high - y_low > x_high - x_low
    if periodic:
        upright = "left" not in periodic.values()
    domain, cell = _domain(box, along=int(upright))
    roomy, scales = roomiest_box(field, domain), flow_scales(field, domain)
    if roomy is None or not scales.typical > 0.0:
        found = "no fluid in it" if roomy is None else "a fluid at rest"
        raise InputError(name, "a fluid that moves", found, "Solve the case.")
    length, width = _size(box, wishes or Wishes())
    once = (x_high - x_low) / scales.typical
    return Choices(
        name=_plain_name(name),
        domain=domain,
        periodic=periodic,
        cell=cell,
        start=(_middle_part(roomy[0]), _middle_part(roomy[1])),
        scales=scales,
        once=once,
        times=tuple(_digits(part * once) for part in _SAVED),
        time_step=_digits(0.5 * cell / scales.largest, 1),
        length=length,
        width=width,
        rates=_rates(length, width, scales, viscosity, (wishes or Wishes()).density),
        stokes=viscosity is not None,
    )


def _rates(
    length: float, width: float, scales: FlowScales, viscosity: float | None, density: float
) -> StokesRates:
    """Stokes' rates in units of the fluid's density; without nu, ones with which particles follow."""
    if viscosity is not None:
        rates = stokes_rates(length, width, density, 1.0, viscosity)
        return StokesRates(*(_digits(number, 6) for number in rates))
    stokes_rates(length, width, density, 1.0, 1.0)  # refuses sizes that are none
    drag = _digits(_FOLLOWING * max(scales.shear, scales.typical / length))
    return StokesRates(drag, drag, 1.0, _digits((length**2 + width**2) / 20.0, 6))


def _mesh_box(field: FlowField) -> Box:
    """The box around the fluid, less rounding: 3.0000000000000004 is 3."""
    x_low, x_high, y_low, y_high = field.bounds
    if field.outline is not None:
        ends = field.outline.ends.reshape(-1, 2)
        (x_low, y_low), (x_high, y_high) = ends.min(axis=0), ends.max(axis=0)
    return (
        (_digits(x_low, _EXACT), _digits(x_high, _EXACT)),
        (_digits(y_low, _EXACT), _digits(y_high, _EXACT)),
    )


def _size(box: Box, wishes: Wishes) -> tuple[float, float]:
    short = min(high - low for low, high in box)
    if wishes.length is None and wishes.width is None:
        length = _nice(_LENGTH * short)
        return length, _ASPECT * length
    length = wishes.length or (wishes.width or 0.0) / _ASPECT
    return length, wishes.width or _ASPECT * length


def _periodic_sides(box: Box, outline: Outline | None) -> dict[str, SideName]:
    """The sides of a box on which cyclic patches lie, by the patches' names."""
    found: dict[str, SideName] = {}
    for number, (name, kind) in enumerate(zip(*outline[3:], strict=True) if outline else ()):
        if outline is None or kind != "cyclic" or not (outline.patch == number).any():
            continue
        ends = outline.ends[outline.patch == number]
        for place, side in enumerate(SIDES):
            axis, end = divmod(place, 2)
            size = box[axis][1] - box[axis][0]
            if abs(ends[..., axis] - box[axis][end]).max() <= _ON_SIDE * size:
                found[name] = side
    return found


def _domain(box: Box, along: int) -> tuple[Box, float]:
    """A box around this one, and a cell that divides it; the box itself where a cell can.

    In the direction `along` the box stays as it is in any case; in the other its upper end may move.
    """
    sizes = [high - low for low, high in box]
    long, other = sizes[along], sizes[1 - along]
    least = max(1, round(_CELLS * min(1.0, long / other)))
    exact = [
        count for count in range(max(1, least // 2), 2 * least + 1)
        if abs(count * other / long - max(1, round(count * other / long))) <= _SAME * count
    ]  # fmt: skip
    if exact:
        # Of the cells that divide both sides one that is short to write: 0.04, not 0.0303...
        best = min(exact, key=lambda n: (len(repr(_digits(long / n, _EXACT))), abs(n - least)))
        return box, _digits(long / best, _EXACT)
    cell = long / least
    low, _ = box[1 - along]
    wider = low, low + math.ceil(other / cell - _SAME) * cell
    return (box[0], wider) if along == 0 else (wider, box[1]), cell


def _nice(value: float) -> float:
    """1, 2 or 5 times a power of ten, at most `value`."""
    power = math.floor(math.log10(value))
    digit = max(d for d in (1, 2, 5) if d <= value / 10.0**power * (1.0 + _SAME))
    return float(f"{digit}e{power}")


def _digits(value: float, count: int = 2) -> float:
    return float(f"{value:.{count}g}")


def _middle_part(side: tuple[float, float]) -> tuple[float, float]:
    middle, half = 0.5 * (side[0] + side[1]), 0.5 * _START * (side[1] - side[0])
    digits = 2 - math.floor(math.log10(2.0 * half))
    return round(middle - half, digits), round(middle + half, digits)


def _plain_name(name: str) -> str:
    """A scene's name like the case's, of the letters that a folder named after it may have."""
    text = re.sub(r"[^\w.+()=-]+", "_", name).strip("_.+()=- ")
    while len(text.encode()) > _LONGEST_NAME:
        text = text[:-1]
    try:
        return file_name(text)
    except ValueError:
        return "scene"
