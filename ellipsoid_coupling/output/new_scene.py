"""A scene file for a solved case, ready to run and to edit: ``ellipsoid new``."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.reading import exists, is_ordinary, output_folder
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow import FlowField, flow_at
from ellipsoid_coupling.flow.case_plane import CasePlane
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.viscosity import read_viscosity
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.scales import normal_speed
from ellipsoid_coupling.geometry.patches import kind_of_type
from ellipsoid_coupling.output.scene_choices import Choices, Wishes, choose
from ellipsoid_coupling.physics.stokes import LARGEST_REYNOLDS
from ellipsoid_coupling.scenes.files import toml_key, toml_value
from ellipsoid_coupling.scenes.sides import SIDES, known_kinds

# An inlet or outlet lets this part of the larger of its flows through in the other direction, at most.
_ONE_WAY = 0.05
# Of the largest speed: what passes a side that is a wall.
_TIGHT = 5e-3
# Of the flow's speed and shear: what noise adds to velocities, where it is switched on.
_NOISE = 0.1


def scene_of_case(
    path: Path, wishes: Wishes, *, allow_misfit: bool = False, divergence: bool = False
) -> str:
    """The TOML text of a scene for the solved case at a path, read as `flow_at` does.

    Raises
    ------
    InputError
        As `flow_at` and `choose`.
    """
    field = flow_at(path, allow_misfit=allow_misfit, divergence=divergence)
    name, viscosity = path.stem, None
    # A saved flow, or the output of foamToVTK, is no case.
    with suppress(InputError):
        case, _ = locate(path)
        name, viscosity = case.resolve().name, read_viscosity(case)
    choices = choose(field, name, viscosity, wishes)
    return scene_text(choices, field, str(path.resolve()), viscosity)


def scene_text(c: Choices, field: FlowField, case: str, viscosity: float | None = None) -> str:
    """The TOML text of a scene: the choices, each with its reason.

    field : the flow, whose outline names the patches
    case : its path
    """
    boundaries = _sides(c, field) if field.outline is None else _boundaries(c, field.outline)
    parts = (
        _head(c, field.origin), _domain(c, field.plane), _particles(c), _start(c),
        _flow(c, case, viscosity, field), boundaries, _numerics(c), _more(c),
    )  # fmt: skip
    return "\n".join("\n".join(part) + "\n" for part in parts if part)


def require_new(path: Path, *, force: bool) -> None:
    """Refuse a scene file that would overwrite something; InputError."""
    output_folder(path.parent)
    if exists(path) and not (force and is_ordinary(path)):
        remedy = "Name another --out, or add --force." if is_ordinary(path) else "Name a file."
        raise InputError(str(path), "a new file", "something of that name", remedy)


def write_scene(text: str, path: Path) -> None:
    """Write a scene file, completely or not at all."""
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _line(key: str, value: object, why: str = "") -> str:
    text = f"{key} = {toml_value(value)}"
    return f"{text}  # {why}" if why else text


def _head(c: Choices, origin: str) -> list[str]:
    speed = f"rms {c.scales.typical:.3g}, largest {c.scales.largest:.3g}"
    return [
        "# Made by `ellipsoid new` from this flow; everything below may be changed:",
        f"# {readable(origin)}",
        f"# Its speed: {speed}; its largest rate of shear: {c.scales.shear:.3g}.",
        "# Lengths and times are in the units of the case, angles in radian.",
        _line("name", c.name),
        _line("times", list(c.times), f"saved; the fluid passes the box in about {c.once:.2g}"),
        '# units = "SI"  # for a case in metres and seconds: results then say so',
    ]


def _domain(c: Choices, plane: CasePlane) -> list[str]:
    why = "where no [boundaries] say another thing"
    x, y = ("xyz"[axis] for axis in plane.axes)
    return [
        *([] if (x, y) == ("x", "y") else [f"# x and y are the case's {x} and {y}."]),
        "# The mesh's box, upwards to whole cells of numerics.cell.",
        "[domain]",
        _line("x", list(c.domain[0])),
        _line("y", list(c.domain[1])),
        _line("boundary", "open", why),
    ]


def _particles(c: Choices) -> list[str]:
    mass = "# Mass and inertia are those of the spheroid, where the fluid's density is 1."
    if not c.stokes:
        mass = "# The mass is 1, the inertia that of a spheroid."
    return [
        "# Length and width are a guess: `ellipsoid new CASE --length L --width D --density R` takes yours",
        "# (R in units of the fluid's density) and works out what follows from them.",
        mass,
        "[particles]",
        _line("length", c.length),
        _line("width", c.width),
        _line("mass", c.rates.mass),
        _line("inertia", c.rates.inertia),
        _line("number", 1000),
        _line("realisations", 1, "runs with other starts and noise, for means"),
    ]


def _start(c: Choices) -> list[str]:
    return [
        "# At rest, evenly spread over the middle of the largest rectangle that is all fluid.",
        "[start]",
        _line("x", list(c.start[0])),
        _line("y", list(c.start[1])),
        _line("angle", 0.0, "radian, of all main axes"),
    ]


def _flow(c: Choices, case: str, viscosity: float | None, field: FlowField) -> list[str]:
    why = [
        "# The case gives no nu: with these rates particles follow the fluid closely. Choose yours."
    ]
    if c.stokes and viscosity is not None:
        reynolds = c.scales.largest * c.length / viscosity
        beyond = reynolds > LARGEST_REYNOLDS
        why = [
            f"# Stokes drag of that spheroid, nu = {viscosity:g}, by ec.stokes_rates.",
            f"# Stokes number (shear over drag): {c.scales.shear / c.rates.drag:.2g}.",
            f"# Reynolds number of a particle at rest in the fastest fluid: {reynolds:.2g}"
            f"{'; beyond 1 the true drag is larger' if beyond else ''}.",
        ]
    return [
        *why,
        "[flow]",
        _line("case", case, "or another one by --flow CASE"),
        *([_line("divergence", True, "its sources are kept")] if field.has_sources else []),
        _line("drag", c.rates.drag, "gamma, per time"),
        _line("angular_drag", c.rates.angular_drag, "gamma_bar, per time"),
    ]


def _boundaries(c: Choices, outline: Outline) -> list[str]:
    lines = [
        "# What happens at each patch of the case: reflect, stick (they stay there), remove (they leave),",
        "# periodic, or inlet.",
    ]
    for number, (name, patch_type) in enumerate(zip(outline.names, outline.types, strict=True)):
        flux = outline.outflow[outline.patch == number]
        if not flux.size:
            continue
        told = f"type {readable(patch_type)}"
        usual = kind_of_type(patch_type)
        if usual == "periodic":
            lines += ["", *_periodic(c, name, told)]
        elif not name.isprintable():
            lines += ["", f"# {readable(name)}: {usual}, by its {told}"]
        elif usual == "remove":
            inflow, outflow = abs(float(flux[flux < 0.0].sum())), float(flux[flux > 0.0].sum())
            lines += ["", *_opening(c, name, told, inflow, outflow)]
        else:
            lines += ["", f"[boundaries.{toml_key(name)}]", _line("kind", usual, told)]
    return lines


def _sides(c: Choices, field: FlowField) -> list[str]:
    """The sides of a flow of which no patches are known: what the fluid does there."""
    lines = [
        "# What happens at each side: reflect, stick (they stay there), remove (they leave), periodic."
    ]
    for place, side in enumerate(SIDES):
        axis, end = divmod(place, 2)
        wall = abs(field.bounds[place] - c.domain[axis][end]) < _TIGHT * c.cell
        tight = normal_speed(field, place) <= _TIGHT * c.scales.largest
        kind = "reflect" if wall and tight else "remove"
        why = "no fluid passes" if tight else "fluid passes"
        lines += ["", f"[boundaries.{side}]", _line("kind", kind, why)]
    return lines


def _periodic(c: Choices, name: str, told: str) -> list[str]:
    """A cyclic patch: the side of the domain that it lies on is periodic."""
    side = c.periodic.get(name)
    if side is None:
        return [
            f"# {readable(name)}, {told}, lies on no side of the domain: nothing comes back there"
        ]
    return [f"[boundaries.{side}]", _line("kind", "periodic", f"{readable(name)}, {told}")]


def _opening(c: Choices, name: str, told: str, inflow: float, outflow: float) -> list[str]:
    """A patch through which the fluid flows; `inflow` and `outflow` are per unit depth."""
    head, both = f"[boundaries.{toml_key(name)}]", f"{inflow:.3g} flows in, {outflow:.3g} out"
    if inflow <= _ONE_WAY * outflow or outflow > _ONE_WAY * inflow:
        return [head, _line("kind", "remove", f"{told}; {both}")]
    (left, right), (low, high) = c.start
    density = float(f"{1.0 / ((right - left) * (high - low)):.6g}")
    dense = "of what comes in, per area: that of the start, whose mass is 1"
    inlet = [_line("kind", "inlet", f"{told}; {both}"), _line("density", density, dense)]
    if "inlet" in known_kinds():
        return ['# With kind = "remove" and without density nothing comes in.', head, *inlet]
    return [head, _line("kind", "remove", f"{told}; {both}, without particles")]


def _numerics(c: Choices) -> list[str]:
    return [
        "[numerics]",
        _line("cell", c.cell, "of the grids; it must divide the domain"),
        _line("time_step", c.time_step, "of the scheme `paper`; `accurate` finds its own"),
    ]


def _more(c: Choices) -> list[str]:
    """Terms to switch on, with numbers that go with the flow, however small the particles are."""
    strength = c.rates.mass * c.scales.typical**2
    noise, speed = _kicks(c.scales.typical, c.rates.drag)
    angular_noise, turning = _kicks(c.scales.shear, c.rates.angular_drag)
    return [
        "# Further terms: what is not named is not computed. Take the # away to switch one on.",
        "# [interaction]",
        f"# strength = {strength:.2g}  # eps0 of the pair potential, mass length^2/time^2: here m U^2",
        "# [noise]",
        f"# noise = {noise:.2g}  # A, time^(-1/2): each component of v then has an rms of {speed:.2g}",
        f"# angular_noise = {angular_noise:.2g}  # B, likewise: omega has an rms of {turning:.2g}",
    ]


def _kicks(scale: float, drag: float) -> tuple[float, float]:
    """A for velocities of about a tenth of a scale, and their rms, A over (2 drag + A^2)^(1/2)."""
    noise = _NOISE * scale * math.sqrt(2.0 * drag)
    return noise, noise / math.sqrt(2.0 * drag + noise**2)


def next_commands(scene: Path, case: Path, *, allow_misfit: bool = False) -> Iterator[str]:
    """What to type next; a flow that is far off the solver's U is taken there as it was here."""
    given = f"{shlex.quote(str(scene))} --flow {shlex.quote(str(case))}"
    given += " --allow-misfit" if allow_misfit else ""
    yield f"  ellipsoid plan {given} --model microscopic"
    yield f"  ellipsoid run {given} --model microscopic"
