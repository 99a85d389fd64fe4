"""Ellipsoidal particles in an OpenFOAM flow: from particles to mean-field equations.

import ellipsoid_coupling as ec

result = ec.simulate("cavity", model="rho_mono_kinetic")
result.density(cells=30)
result.angle_distribution(bins=60)
result.plot()
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ellipsoid_coupling.compare.advice import Advice, advise
    from ellipsoid_coupling.errors import (
        EllipsoidError,
        InputError,
        Interrupted,
        RunError,
        WriteError,
    )
    from ellipsoid_coupling.flow import FlowField, FlowSeries
    from ellipsoid_coupling.models import register_model
    from ellipsoid_coupling.physics.stokes import StokesRates, stokes_rates
    from ellipsoid_coupling.result import Result
    from ellipsoid_coupling.scenes import Scene, builtin_scenes, load_scene
    from ellipsoid_coupling.simulation import simulate
    from ellipsoid_coupling.storage.run_folder import RunFolder
    from ellipsoid_coupling.sweeps import sweep

__version__ = "0.1.0"

__all__ = [
    "Advice",
    "EllipsoidError",
    "FlowField",
    "FlowSeries",
    "InputError",
    "Interrupted",
    "Result",
    "RunError",
    "RunFolder",
    "Scene",
    "StokesRates",
    "WriteError",
    "advise",
    "builtin_scenes",
    "load_scene",
    "register_model",
    "simulate",
    "stokes_rates",
    "sweep",
]

# Loaded when first asked for: numba and scipy take a second, which `ellipsoid --help` does not need.
_HOMES = {
    "compare.advice": ("Advice", "advise"),
    "errors": ("EllipsoidError", "InputError", "Interrupted", "RunError", "WriteError"),
    "flow": ("FlowField", "FlowSeries"),
    "models": ("register_model",),
    "physics.stokes": ("StokesRates", "stokes_rates"),
    "result": ("Result",),
    "scenes": ("Scene", "builtin_scenes", "load_scene"),
    "simulation": ("simulate",),
    "storage.run_folder": ("RunFolder",),
    "sweeps": ("sweep",),
}


def __getattr__(name: str) -> object:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
