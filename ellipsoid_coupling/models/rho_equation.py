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

from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.r_grid import RGridEquation
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
            solves="the closure over (x, y) with one velocity and one angle in each cell",
            needs="numerics.cell that divides the domain",
            style=LineStyle("#D55E00", (0.0, (4.0, 1.5)), "^"),
            summation=on_r_grid,
            pressure=PRESSURE["mono_kinetic"],
        ),
    )


MODEL = RhoEquation
