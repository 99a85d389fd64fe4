"""The numerical schemes and their properties, by which others choose instead of by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes.scene import Numerics

SchemeName = Literal["paper", "accurate"]


@dataclass(frozen=True)
class Scheme:
    """The properties of a scheme by which its runs are refined, compared and checked.

    Attributes
    ----------
    name : str
    adaptive : bool
        Particles take steps within an error tolerance; otherwise steps of a fixed length.
    step_key : str
        The key of [numerics] that refines the steps of particles.
    step_symbol : str
        That key's value in the text of a resolution.
    remedy : str
        The advice to a user whose run has failed.
    """

    name: SchemeName
    adaptive: bool
    step_key: str
    step_symbol: str
    remedy: str

    def step(self, numerics: Numerics) -> float:
        """The value of `step_key`."""
        return float(getattr(numerics, self.step_key))


_SCHEMES = (
    Scheme(
        "paper",
        adaptive=False,
        step_key="time_step",
        step_symbol="dt",
        remedy="Use a smaller time step or CFL number, or the scheme `accurate`.",
    ),
    Scheme(
        "accurate",
        adaptive=True,
        step_key="tolerance",
        step_symbol="tolerance",
        remedy="Use a smaller tolerance or CFL number, or a finer grid.",
    ),
)
SCHEMES: tuple[SchemeName, ...] = tuple(scheme.name for scheme in _SCHEMES)
# Errors are measured against runs of this scheme.
ADAPTIVE_SCHEME: SchemeName = next(scheme.name for scheme in _SCHEMES if scheme.adaptive)
# The other one is the baseline that it is compared with.
BASELINE_SCHEME: SchemeName = next(scheme.name for scheme in _SCHEMES if not scheme.adaptive)


def scheme_named(name: str) -> Scheme:
    """The scheme of that name.

    Raises
    ------
    InputError
        For an unknown name; it lists the known ones.
    """
    for scheme in _SCHEMES:
        if scheme.name == name:
            return scheme
    known = ", ".join(SCHEMES)
    raise InputError("--scheme", f"one of {known}", repr(name), "Choose one of these.")
