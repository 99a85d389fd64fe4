"""The terms of a scene: those that are False are neither computed, nor allocated, nor compiled."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.scenes.kinds import ANGULAR_POTENTIALS, OUTER_POTENTIALS
from ellipsoid_coupling.scenes.scene import Flow, Scene


class Terms(NamedTuple):
    """The terms of the equations that a scene switches on."""

    flow: bool
    interaction: bool
    torque: bool
    walls: bool
    reflection: bool
    gravity: bool
    outer_potential: bool
    angular_potential: bool
    noise: bool
    angular_noise: bool
    angle: bool


class Term(NamedTuple):
    """One line of ``ellipsoid plan``: the term, whether it runs, and why."""

    name: str
    runs: bool
    why: str


def terms_of(scene: Scene, *, random_motion: bool = True) -> Terms:
    """The terms that a model needs in `scene`.

    random_motion : noise moves the model's particles; in a closure it only damps
    """
    return Terms(
        **{term.name: term.runs for term in explain_terms(scene, random_motion=random_motion)}
    )


def explain_terms(scene: Scene, *, random_motion: bool = True) -> list[Term]:
    """Every term with its verdict and the reason, in the order of the equations; as `terms_of`."""
    return [
        *_fluid_and_pairs(scene),
        *_surroundings(scene),
        *_noise_terms(scene, random_motion=random_motion),
        _angle_term(scene),
    ]


def _fluid_and_pairs(scene: Scene) -> list[Term]:
    flow = scene.flow
    torque = scene.interaction is not None and not scene.particles.is_circle
    why_torque = (
        "ellipses turn one another"
        if torque
        else "no [interaction]"
        if scene.interaction is None
        else "circles (length = width) carry no torque"
    )
    return [
        Term(
            "flow",
            flow is not None,
            f"{_flow_in_words(flow)}, drag {flow.drag:g}, angular drag {flow.angular_drag:g}"
            if flow
            else "no [flow]: no fluid, no drag",
        ),
        Term(
            "interaction",
            scene.interaction is not None,
            f"strength {scene.interaction.strength:g}"
            if scene.interaction
            else "no [interaction]: no neighbour list, no kernel spectra",
        ),
        Term("torque", torque, why_torque),
    ]


def _flow_in_words(flow: Flow) -> str:
    """Its name and source, and its times, unless it is the last one for ever."""
    name = f"{flow.name} ({flow.source})"
    if flow.time == "latest":
        return name
    times = (
        "all times"
        if flow.time == "all"
        else f"time {flow.time:g}"
        if isinstance(flow.time, float)
        else ("times from {:g} to {:g}".format(*flow.time))
    )
    return f"{name}, {times}" + (", repeated" if flow.repeat else "")


def _surroundings(scene: Scene) -> list[Term]:
    walls, outer, turning = scene.walls, scene.outer_potential, scene.angular_potential
    gravity = scene.gravity
    return [
        Term(
            "walls",
            walls is not None,
            f"ghosts on {', '.join(walls.sides or ('all that reflects',))}, "
            f"{walls.strength_factor:g} times stronger, "
            f"ghost cells {walls.ghost_density}"
            if walls
            else "no [walls]: no ghosts",
        ),
        Term(
            "reflection",
            scene.has_sides("reflect") or bool(_reflecting_patches(scene)),
            _boundaries_in_words(scene),
        ),
        Term(
            "gravity",
            gravity is not None,
            f"acceleration ({gravity.x:g}, {gravity.y:g})" if gravity else "no [gravity]: g = 0",
        ),
        Term(
            "outer_potential",
            outer is not None,
            "no [outer_potential]: V1 = 0" if outer is None else OUTER_POTENTIALS.describe(outer),
        ),
        Term(
            "angular_potential",
            turning is not None,
            "no [angular_potential]: V2 = 0"
            if turning is None
            else ANGULAR_POTENTIALS.describe(turning),
        ),
    ]


def _boundaries_in_words(scene: Scene) -> str:
    """The kinds of the sides: "domain.boundary is open", or side by side; then the patches that reflect."""
    if scene.boundaries is None:
        return f"domain.boundary is {scene.domain.boundary}"
    kinds = [f"{side.kind} on the {name}" for name, side in scene.sides.items()]
    patches = _reflecting_patches(scene)
    if patches:
        kinds.append(
            f"reflect at the patch{'es' if len(patches) > 1 else ''} {' and '.join(patches)}"
        )
    return ", ".join(kinds)


def _reflecting_patches(scene: Scene) -> list[str]:
    """The patches in [boundaries] at which particles turn round."""
    return [name for name, part in scene.named_patches.items() if part.particles == "reflect"]


def _noise_terms(scene: Scene, *, random_motion: bool) -> list[Term]:
    def term(name: str, amplitude: float, letter: str) -> Term:
        if amplitude == 0.0:
            return Term(name, False, f"{letter} = 0: no random number is drawn")
        if not random_motion:
            why = f"{letter} = {amplitude:g} enters this closure as damping {letter}^2/2 only"
            return Term(name, False, why)
        return Term(name, True, f"{letter} = {amplitude:g}, with damping {letter}^2/2")

    noise = scene.noise
    return [
        term("noise", noise.noise if noise else 0.0, "A"),
        term("angular_noise", noise.angular_noise if noise else 0.0, "B"),
    ]


def _angle_term(scene: Scene) -> Term:
    turned_by = [
        name
        for name, acts in (
            ("the fluid", scene.flow is not None and scene.flow.angular_drag > 0),
            ("interaction", scene.interaction is not None and not scene.particles.is_circle),
            ("V2", scene.angular_potential is not None),
            ("noise", scene.noise is not None and scene.noise.angular_noise > 0),
            ("the velocities of start.file", scene.start.file is not None),
        )
        if acts
    ]
    if turned_by:
        return Term("angle", True, f"turned by {', '.join(turned_by)}")
    return Term("angle", False, "nothing turns the particles: the start angle stays")
