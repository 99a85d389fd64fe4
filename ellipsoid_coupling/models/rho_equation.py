"""The rho-equation with mono-kinetic closure, `eq:macro_rho_mono` with its signs mended.

    d_t rho         + div(rho v)       = 0
    d_t (rho phi)   + div(rho phi v)   = rho omega
    d_t (rho v)     + div(rho v (x) v) = rho [gamma (u - v) - K1/m - grad V1 - (A^2/2) v]
    d_t (rho omega) + div(rho omega v) = rho [gamma_bar (g - omega) - K2/I_c - dV2 - (B^2/2) omega]

Scheme `paper`: FORCE in x, then y, then implicit Euler. Scheme `accurate`: kick (half a step,
exact), drift (a step, ballistic, exact for the piecewise linear state), kick: second order;
positions and angle stand still while velocities change and the other way round, so that one
evaluation of the interaction a step suffices.
"""

from __future__ import annotations

from typing import ClassVar

from ellipsoid_coupling.finite_volume.crossing import CrossingDetector
from ellipsoid_coupling.finite_volume.splitting import GodunovSplitting, KickDriftKick, Splitting
from ellipsoid_coupling.models.base import Arrays, Counts, Setup
from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.r_grid import RGridEquation
from ellipsoid_coupling.models.run_warnings import of_crossing
from ellipsoid_coupling.models.summation import on_r_grid
from ellipsoid_coupling.physics.closure import PRESSURE


class RhoEquation(RGridEquation):
    """`Model` of the rho-equation."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "rho_mono_kinetic",
            label="rho, mono-kinetic",
            layout="rho",
            rank=5,
            style=LineStyle("#D55E00", (0.0, (4.0, 1.5)), "^"),
            summation=on_r_grid,
            pressure=PRESSURE["mono_kinetic"],
        ),
    )

    def __init__(self, name: str, setup: Setup) -> None:
        splitting: Splitting = (
            GodunovSplitting(PRESSURE["mono_kinetic"])
            if setup.scheme == "paper"
            else KickDriftKick()
        )
        super().__init__(name, setup, splitting)
        self._crossing = CrossingDetector(self.terms.damping)

    def try_step(self, dt: float) -> bool:
        """As every r-grid equation's, with a look at the characteristics where it was taken."""
        taken = super().try_step(dt)
        if taken:
            self._crossing.look(self.fields, self.cell, self.time + dt)
        return taken

    def live(self) -> Arrays:
        """Fields, drift, clock and what the crossing detector remembers."""
        return super().live() | {"crossing": self._crossing.memory}

    def counts(self) -> Counts:
        """As every r-grid equation's and, if they have, when characteristics crossed."""
        return super().counts() | self._crossing.counts()

    def warnings(self) -> list[str]:
        """As every r-grid equation's, and that characteristics have crossed."""
        return super().warnings() + of_crossing(self._crossing.time)


MODEL = RhoEquation
