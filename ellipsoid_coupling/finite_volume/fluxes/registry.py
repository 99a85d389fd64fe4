"""Numerical fluxes by name, so that a scene may choose one: the key `numerics.flux`.

    register_flux_name("hll", lambda moved: Hll(moved.pressure, moved.vacuum), carries_pressure=True)

The flux itself is a NamedTuple and a formula, registered for its type (`contract.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.fluxes.ballistic import Ballistic
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux
from ellipsoid_coupling.finite_volume.fluxes.force import Force
from ellipsoid_coupling.finite_volume.fluxes.in_fluid import (
    BallisticInFluid,
    FluidMotion,
    ForceInFluid,
)
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Kinetic
from ellipsoid_coupling.physics.closure import Pressure

Floats = NDArray[np.float64]


class Transported(NamedTuple):
    """What a flux moves along one axis in one step.

    Attributes
    ----------
    pressure : float or record
        The closure's, see `physics.closure`.
    bends : (K,) float
        Up to which bend an extremum is smooth, in the flux's order: of the density (relative), of the
        velocity along the axis, and of whatever else is carried; see `ballistic.py`.
    smooth : float
        What is a small part along the axis, by its resolution.
    vacuum : float
        The density up to which a cell counts as empty.
    tilt : (cells,) float64 or None
        For fluxes that balance forces: e^{g/2} of the work g from each cell's centre to the next one's.
    fluid : FluidMotion or None
        On staircases what the fluid does at the cells' faces, for fluxes that keep even densities even.
    """

    pressure: Pressure
    bends: Values
    smooth: float
    vacuum: float
    tilt: Floats | None = None
    fluid: FluidMotion | None = None


FluxMaker = Callable[[Transported], Flux]


class _Named(NamedTuple):
    make: FluxMaker
    carries_pressure: bool
    balances: bool


_fluxes: dict[str, _Named] = {}


def register_flux_name(
    name: str, make: FluxMaker, carries_pressure: bool, balances: bool = False
) -> None:
    """Let scenes choose a flux by this name.

    Parameters
    ----------
    make : callable
        Transported -> the flux, for each step anew; its type is registered, see `contract.py`.
    carries_pressure : bool
        Whether it holds for closures with pressure.
    balances : bool
        Whether it balances pressure and forces: needs `tilt`, and a scheme that gives it.

    Raises
    ------
    ValueError
        If there is a flux of that name.
    """
    if name in _fluxes:
        raise ValueError(f"there is a flux called {name} already")
    _fluxes[name] = _Named(make, carries_pressure, balances)


def flux_names() -> list[str]:
    """The names that a scene may choose from, sorted."""
    return sorted(_fluxes)


def flux_named(name: str, pressure: Pressure, balanced: bool, where: str) -> FluxMaker:
    """What makes the flux called `name`.

    Parameters
    ----------
    pressure : float or record
        The closure's.
    balanced : bool
        Whether the scheme gives the forces' work to the flux.
    where : str
        Scene and key, for the message.

    Raises
    ------
    InputError
        If there is none of that name, or it fits neither that closure nor that scheme.
    """
    fit = [
        one
        for one, kind in sorted(_fluxes.items())
        if kind.balances == balanced and (pressure == 0.0 or kind.carries_pressure)
    ]
    if name not in fit:
        raise InputError(
            where,
            f"a numerical flux that fits closure and scheme: {', '.join(fit)}",
            # A known one that does not fit is told apart from a word that is no flux.
            f"{name!r}, which does not" if name in _fluxes else repr(name),
            "Choose one of these, or leave the key out for the scheme's own.",
        )
    return _fluxes[name].make


def _force(moved: Transported) -> Force | ForceInFluid:
    # Types of their own: runs without a staircase compile nothing of the fluid.
    if moved.fluid is None:
        return Force(moved.pressure, moved.vacuum)
    return ForceInFluid(moved.pressure, moved.fluid, moved.vacuum)


def _ballistic(moved: Transported) -> Ballistic | BallisticInFluid:
    if moved.fluid is None:
        return Ballistic(moved.bends, vacuum=moved.vacuum)
    return BallisticInFluid(moved.bends, moved.fluid, vacuum=moved.vacuum)


register_flux_name("force", _force, carries_pressure=True)
register_flux_name("ballistic", _ballistic, carries_pressure=False)


def _kinetic(moved: Transported) -> Kinetic:
    """Of a scheme that gives the work; see `flux_named`."""
    assert moved.tilt is not None
    return Kinetic(moved.tilt, moved.smooth, moved.vacuum)


register_flux_name("kinetic", _kinetic, carries_pressure=True, balances=True)
