"""Which terms a scene has: what is False here is neither computed, nor allocated, nor compiled."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.scenes.scene import Scene

# Models whose unknown is a density without random motion: noise enters them as damping only.
_CLOSED_MODELS = ("q_maxwellian", "q_mono_kinetic", "rho_mono_kinetic", "diffusive")

# Models whose equilibria stay to rounding, so that their interaction is summed with all digits.
_EXACT_MODELS = ("q_maxwellian", "stationary_state")
# Models of samples, which interact through nodes or pair by pair.
_SAMPLED_MODELS = ("mckean_vlasov",)
# From here on, rounding in single precision (1e-6) is far below what is allowed.
_LEAST_SINGLE_TOLERANCE = 1e-4


class Terms(NamedTuple):
    """The terms of the equations that a scene switches on."""

    flow: bool
    interaction: bool
    torque: bool
    walls: bool
    reflection: bool
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


def terms_of(scene: Scene, model: str = "microscopic") -> Terms:
    """The terms that `model` needs in `scene`."""
    return Terms(**{term.name: term.runs for term in explain_terms(scene, model)})


def explain_terms(scene: Scene, model: str = "microscopic") -> list[Term]:
    """Every term with its verdict and the reason, in the order of the equations."""
    return [
        *_fluid_and_pairs(scene, model),
        *_surroundings(scene),
        *_noise_terms(scene, model),
        _angle_term(scene),
    ]


def _how_summed(scene: Scene, model: str) -> str:
    """How exactly a model sums the interaction, and in which precision."""
    numerics = scene.numerics
    if model == "microscopic":
        return "pair by pair"
    if numerics.interaction == "direct" or model in _EXACT_MODELS:
        return "to rounding"
    tolerance = numerics.harmonics_tolerance
    precision = "single" if tolerance >= _LEAST_SINGLE_TOLERANCE else "double"
    if model in _SAMPLED_MODELS:
        pairs = (
            "" if numerics.interaction == "harmonics" else "; pair by pair where that is less work"
        )
        return (
            f"force and torque within {tolerance:g} of the largest that a density can exert, "
            f"nodes and harmonics together, {precision} precision{pairs}"
        )
    return f"within {tolerance:g} of its largest value, {precision} precision"


def _fluid_and_pairs(scene: Scene, model: str) -> list[Term]:
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
            f"{flow.field} ({flow.source}), drag {flow.drag:g}, angular drag {flow.angular_drag:g}"
            if flow
            else "no [flow]: no fluid, no drag",
        ),
        Term(
            "interaction",
            scene.interaction is not None,
            f"strength {scene.interaction.strength:g}, {_how_summed(scene, model)}"
            if scene.interaction
            else "no [interaction]: no neighbour list, no kernel spectra",
        ),
        Term("torque", torque, why_torque),
    ]


def _surroundings(scene: Scene) -> list[Term]:
    walls, outer, turning = scene.walls, scene.outer_potential, scene.angular_potential
    return [
        Term(
            "walls",
            walls is not None,
            f"ghosts on {', '.join(walls.sides)}, {walls.strength_factor:g} times stronger, "
            f"ghost cells {walls.ghost_density}"
            if walls
            else "no [walls]: no ghosts",
        ),
        Term(
            "reflection",
            scene.has_sides("reflect"),
            _sides_in_words(scene),
        ),
        Term(
            "outer_potential",
            outer is not None,
            f"V1 = {outer.stiffness:g} r^2/2" if outer else "no [outer_potential]: V1 = 0",
        ),
        Term(
            "angular_potential",
            turning is not None,
            f"V2 = {turning.amplitude:g} sin(theta)"
            if turning
            else "no [angular_potential]: V2 = 0",
        ),
    ]


def _sides_in_words(scene: Scene) -> str:
    """The kinds of the sides: "domain.boundary is open", or side by side."""
    if scene.boundaries is None:
        return f"domain.boundary is {scene.domain.boundary}"
    return ", ".join(f"{side.kind} on the {name}" for name, side in scene.sides.items())


def _noise_terms(scene: Scene, model: str) -> list[Term]:
    def term(name: str, amplitude: float, letter: str) -> Term:
        if amplitude == 0.0:
            return Term(name, False, f"{letter} = 0: no random number is drawn")
        if model in _CLOSED_MODELS:
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
        )
        if acts
    ]
    if turned_by:
        return Term("angle", True, f"turned by {', '.join(turned_by)}")
    return Term("angle", False, "nothing turns the particles: the start angle stays")
