"""The q-equation with Maxwellian closure, `eq:macro_q_max`.

    d_t q         + div_r(q v)               + d_theta(q omega)         = 0
    d_t (q v)     + div_r(q v (x) v + q I) + d_theta(q v omega)       = q S_1 - (A^2/2) q v
    d_t (q omega) + div_r(q v omega)         + d_theta(q omega^2 + q) = q S_2 - (B^2/2) q omega

Particles at a place and angle have velocities of a unit Gaussian about the mean:
pressure 1. See `q_equation` for the equation and its schemes.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.q_equation import QEquation
from ellipsoid_coupling.models.summation import on_q_grid
from ellipsoid_coupling.physics.closure import PRESSURE


class QMaxwellian(QEquation):
    """`Model` of the q-equation with Maxwellian closure."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "q_maxwellian",
            label="q, Maxwellian",
            layout="q",
            rank=3,
            solves="the closure over (x, y, theta) whose velocities spread like a Gaussian",
            needs="numerics.cell that divides the domain",
            style=LineStyle("#E69F00", (0.0, (3.0, 1.0, 1.0, 1.0, 1.0, 1.0)), "D"),
            summation=partial(on_q_grid, pressure=PRESSURE["maxwellian"]),
            pressure=PRESSURE["maxwellian"],
        ),
    )


MODEL = QMaxwellian
