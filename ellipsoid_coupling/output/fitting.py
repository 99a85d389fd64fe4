"""Which models fit a scene, and why the others do not."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import SCHEMES, model_kinds
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import checked_setup


class Fitting(NamedTuple):
    """The names of the models that fit, from particles down; the others with the reason of each."""

    fit: list[str]
    left_out: dict[str, str]


def fitting_models(scene: Scene) -> Fitting:
    """Ask every model whether it takes the scene, with some scheme; nothing is computed or allocated."""
    fit: list[str] = []
    left_out: dict[str, str] = {}
    for kind in model_kinds():
        why = ""
        for scheme in SCHEMES:
            try:
                checked_setup(scene, kind.name, scheme, 0, None)
            except InputError as error:
                why = f"expected {error.expected}, found {error.found}"
            else:
                fit.append(kind.name)
                break
        else:
            left_out[kind.name] = why
    return Fitting(fit, left_out)
