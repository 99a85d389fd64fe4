"""The models of the hierarchy, one file each; a new file with a `Model` class is found by itself."""

from __future__ import annotations

import importlib
import pkgutil

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models.base import Arrays, Health, Model, SchemeName, Setup
from ellipsoid_coupling.models.flow_fit import require_fitting
from ellipsoid_coupling.models.memory import require_memory

__all__ = [
    "SCHEMES",
    "Arrays",
    "Health",
    "Model",
    "SchemeName",
    "Setup",
    "build_model",
    "layout_of",
    "model_names",
    "require_fit",
    "scheme_named",
]

SCHEMES: tuple[SchemeName, ...] = ("paper", "accurate")


def _classes() -> dict[str, type[Model]]:
    found: dict[str, type[Model]] = {}
    for module in pkgutil.iter_modules(__path__):
        contents = vars(importlib.import_module(f"{__name__}.{module.name}"))
        model = contents.get("MODEL")
        if model is not None:
            found.update(dict.fromkeys(model.names, model))
    return found


def model_names() -> list[str]:
    """The names of all models, sorted."""
    return sorted(_classes())


def layout_of(name: str) -> str:
    """What the state of the model `name` is made of: "particles", "rho" or "q"."""
    return _classes()[name].layout


def scheme_named(name: str) -> SchemeName:
    """The scheme of that name; InputError, listing the known ones, otherwise."""
    for scheme in SCHEMES:
        if scheme == name:
            return scheme
    known = ", ".join(SCHEMES)
    raise InputError("--scheme", f"one of {known}", repr(name), "Choose one of these.")


def require_fit(name: str, setup: Setup) -> None:
    """Refuse what model, scene and numbers tell wrong, before anything is solved or allocated.

    The flow is not looked at: `setup` may still be without one.

    Raises
    ------
    InputError
        For an unknown model, a scene that it does not fit, or one that takes more memory than
        there is.
    """
    classes = _classes()
    if name not in classes:
        known = ", ".join(sorted(classes))
        raise InputError("--model", f"one of {known}", repr(name), "Choose one of these.")
    require_memory(classes[name], name, setup)
    classes[name].require_fit(setup)


def build_model(name: str, setup: Setup) -> Model:
    """The model called `name`, at the scene's start.

    Raises
    ------
    InputError
        As `require_fit`, or for a flow that the scene does not fit.
    """
    require_fit(name, setup)
    require_fitting(setup.scene, setup.flow)
    return _classes()[name](name, setup)
