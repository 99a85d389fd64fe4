"""Which terms a model has in a scene, and how it sums its interaction: ``ellipsoid plan``."""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.scales import FlowScales, flow_scales
from ellipsoid_coupling.geometry.patches import patch_parts
from ellipsoid_coupling.models.flow_fit import rectangle, require_fitting
from ellipsoid_coupling.models.registry import kind_named
from ellipsoid_coupling.physics.stokes import LARGEST_REYNOLDS
from ellipsoid_coupling.scenes import Scene, Term, Terms, explain_terms, terms_of


class Fact(NamedTuple):
    """One line of what a flow means for the particles of a scene: name, value, what it tells."""

    name: str
    value: str
    why: str


class PatchFact(NamedTuple):
    """One patch of the flow's case: its type there, its kind in the scene, edges, flux out of it."""

    name: str
    patch_type: str
    kind: str
    edges: int
    outflow: float


def model_terms(scene: Scene, name: str) -> Terms:
    """The terms that the model called `name` needs in `scene`; InputError for an unknown name."""
    return terms_of(scene, random_motion=kind_named(name).random_motion)


def plan_terms(scene: Scene, name: str) -> list[Term]:
    """Every term with its verdict and the reason, in the order of the equations.

    The way in which the interaction is summed is found by the same functions that choose it in a run.

    Raises
    ------
    InputError
        For an unknown model, or an interaction that a run would refuse.
    """
    kind = kind_named(name)
    terms = explain_terms(scene, random_motion=kind.random_motion)
    if scene.interaction is None:
        return terms
    summed = kind.summation(scene)
    return [
        term._replace(why=f"{term.why}, {summed}") if term.name == "interaction" else term
        for term in terms
    ]


def plan_patches(scene: Scene, field: FlowField) -> list[PatchFact]:
    """Every patch that bounds the fluid, with its kind in the scene; none where none are known.

    Raises
    ------
    InputError
        For a name in [boundaries] that is neither a side of the domain nor a patch.
    """
    outline = field.outline
    if outline is None:
        return []
    kinds = patch_parts(scene, outline)
    rows = []
    for number, (name, patch_type) in enumerate(zip(outline.names, outline.types, strict=True)):
        here = outline.patch == number
        if here.any():
            flux = float(outline.outflow[here].sum())
            rows.append(PatchFact(name, patch_type, kinds[name].kind, int(here.sum()), flux))
    return rows


def plan_flow(scene: Scene, field: FlowField, viscosity: float | None) -> list[Fact]:
    """What a flow is, and what it means for the particles of a scene.

    viscosity : nu of the fluid, where it is known

    Raises
    ------
    InputError
        As a run would, for a flow that does not fit the scene.
    """
    require_fitting(scene, field)
    scales = flow_scales(field, (scene.domain.x, scene.domain.y))
    ny, nx = field.cells
    facts = [Fact("flow", field.origin, f"the spline has {nx} x {ny} cells")]
    if not math.isinf(field.bounds[0]):
        facts.append(Fact("rectangle", rectangle(field), "of the mesh"))
    facts.append(Fact("speed", f"{scales.largest:.3g}", f"the largest; rms {scales.typical:.3g}"))
    facts.append(Fact("shear", f"{scales.shear:.3g}", "the largest rate"))
    if field.has_sources:
        why = "the largest rate at which the fluid swells or shrinks: flow.divergence = true"
        facts.append(Fact("divergence", f"{scales.divergence:.3g}", why))
    return [
        *facts,
        *_stokes(scene, scales),
        *_reynolds(scene, scales, viscosity),
        _neighbours(scene),
    ]


def _stokes(scene: Scene, scales: FlowScales) -> list[Fact]:
    """How far particles lag behind the fluid."""
    if scene.flow is None or scene.flow.drag == 0.0:
        return []
    stokes = scales.shear / scene.flow.drag
    told = "follow the fluid" if stokes < 0.1 else "lag behind it" if stokes < 10.0 else "fly on"
    return [Fact("Stokes number", f"{stokes:.2g}", f"shear over drag: particles {told}")]


def _reynolds(scene: Scene, scales: FlowScales, viscosity: float | None) -> list[Fact]:
    """Reynolds numbers of the particles, by their slip and by the shear across them.

    At rest in the fastest fluid the slip is the speed itself; later it is about the Stokes number times it.
    """
    if scene.flow is None:
        return []
    if viscosity is None:
        why = "the case gives no nu, so whether Stokes drag holds is not known"
        return [Fact("Reynolds number", "unknown", why)]
    length = scene.particles.length
    start = scales.largest * length / viscosity
    slip = min(1.0, scales.shear / scene.flow.drag) if scene.flow.drag > 0.0 else 1.0
    return [
        Fact("Reynolds number", f"{slip * start:.2g}", _verdict("of the slip", slip * start)),
        Fact("at the start", f"{start:.2g}", _verdict("at rest in the fastest fluid", start)),
        Fact(
            "of the shear", f"{scales.shear * length**2 / viscosity:.2g}",
            _verdict("across a particle", scales.shear * length**2 / viscosity),
        ),
    ]  # fmt: skip


def _verdict(what: str, reynolds: float) -> str:
    if reynolds <= LARGEST_REYNOLDS:
        return f"{what}: Stokes' formulas hold"
    return f"{what}: WARNING: beyond {LARGEST_REYNOLDS:g}, where Stokes' formulas are too small"


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %" if part < 0.1 else f"{100.0 * part:.0f} %"


def _neighbours(scene: Scene) -> Fact:
    """How many others are within a length of a particle, spread evenly over the start box."""
    start, particles = scene.start, scene.particles
    area = (start.x[1] - start.x[0]) * (start.y[1] - start.y[0])
    if not area > 0.0:
        return Fact("neighbours", "unknown", "the start has no area")
    number = (particles.number - 1) * math.pi * particles.length**2 / area
    covered = particles.number * math.pi / 4.0 * particles.length * particles.width / area
    return Fact(
        "neighbours", f"{number:.2g}",
        f"within a length of a particle at the start, where they cover {_percent(covered)} of the area",
    )  # fmt: skip
