"""Which terms a model has in a scene, and how it sums its interaction: ``ellipsoid plan``."""

from __future__ import annotations

from ellipsoid_coupling.models.registry import kind_named
from ellipsoid_coupling.scenes import Scene, Term, Terms, explain_terms, terms_of


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
