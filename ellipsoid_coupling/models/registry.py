"""The registry that models are found in by their names."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models.base import Model, Setup
from ellipsoid_coupling.models.flow_fit import require_fitting
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.memory import require_memory

# Models from outside of the package, by name; `register_model` checks and adds them.
registered: dict[str, type[Model]] = {}


@cache
def _own_models() -> tuple[type[Model], ...]:
    """The classes of the files in this folder; imported when the first of them is asked for."""
    package = __name__.rpartition(".")[0]
    names = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)])]
    modules = [vars(importlib.import_module(f"{package}.{name}")) for name in names]
    return tuple(module["MODEL"] for module in modules if "MODEL" in module)


def _classes() -> dict[str, type[Model]]:
    own = {kind.name: model for model in _own_models() for kind in model.kinds}
    return own | registered


def register_model(model: type[Model]) -> None:
    """Add a model from outside of the package, under every name that its `kinds` declare.

    Parameters
    ----------
    model : class
        With all members of the protocol `Model`. Its names are then known to `simulate` and, in the same
        process, to the command line.

    Raises
    ------
    TypeError
        For a class that lacks members of the protocol.
    ValueError
        For a name that another model has, or a further variable that a result file cannot hold.
    """
    promised = ("kinds", *(name for name in vars(Model) if not name.startswith("_")))
    missing = sorted(name for name in promised if not hasattr(model, name))
    if missing:
        raise TypeError(f"{model.__name__} is no Model: it has no {', '.join(missing)}")
    for kind in model.kinds:
        _require_names(kind)
        if _classes().get(kind.name, model) is not model:
            raise ValueError(f"the name {kind.name} belongs to another model")
    registered.update((kind.name, model) for kind in model.kinds)


def _require_names(kind: ModelKind) -> None:
    for name, units, long_name in kind.variables:
        text = f"{units}{long_name}"
        if not name.isidentifier() or "," in units or not text.isprintable():
            raise ValueError(
                f"model {kind.name}: expected a variable's name of letters, digits and _, units without "
                f"a comma and a long name in one line, found {name!r}, {units!r}, {long_name!r}"
            )


def _class_named(name: str) -> type[Model]:
    """The class of a model's name; InputError, listing the known names, otherwise."""
    classes = _classes()
    if name not in classes:
        known = ", ".join(sorted(classes))
        raise InputError("--model", f"one of {known}", repr(name), "Choose one of these.")
    return classes[name]


def model_names() -> list[str]:
    """The names of all models, sorted."""
    return sorted(_classes())


def model_kinds() -> list[ModelKind]:
    """The kinds of all models, from particles down the hierarchy (`ModelKind.rank`)."""
    kinds = {kind.name: kind for model in _classes().values() for kind in model.kinds}
    return sorted(kinds.values(), key=lambda kind: (kind.rank, kind.name))


def kind_named(name: str) -> ModelKind:
    """The kind of the model called `name`.

    Raises
    ------
    InputError
        For an unknown name; it lists the known ones.
    """
    return next(kind for kind in _class_named(name).kinds if kind.name == name)


def find_kind(name: str) -> ModelKind | None:
    """The kind of the model called `name`; None for an unknown name.

    For results from elsewhere, whose model may not be registered.
    """
    return kind_named(name) if name in _classes() else None


def require_fit(name: str, setup: Setup) -> None:
    """Refuse a model, scene or numbers that do not fit, before anything is solved or allocated.

    The flow is not used: `setup` may still be without one.

    Raises
    ------
    InputError
        For an unknown model, a scene that it does not fit, or one that takes more memory than
        there is.
    """
    model = _class_named(name)
    require_memory(kind_named(name), setup)
    model.require_fit(setup)


def build_model(name: str, setup: Setup) -> Model:
    """The model called `name`, at the scene's start.

    Raises
    ------
    InputError
        As `require_fit`, or for a flow that the scene does not fit.
    """
    require_fit(name, setup)
    require_fitting(setup.scene, setup.flow)
    return _class_named(name)(name, setup)
