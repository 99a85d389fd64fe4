"""The q-equation with mono-kinetic closure, `eq:macro_q_mono`.

    d_t q         + div_r(q v)               + d_theta(q omega)         = 0
    d_t (q v)     + div_r(q v (x) v) + d_theta(q v omega)       = q S_1 - (A^2/2) q v
    d_t (q omega) + div_r(q v omega)         + d_theta(q omega^2) = q S_2 - (B^2/2) q omega

All particles at a place and angle move alike: pressure 0. See `q_equation` for the
equation and its schemes.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.q_equation import QEquation
from ellipsoid_coupling.models.summation import on_q_grid
from ellipsoid_coupling.physics.closure import PRESSURE


class QMonoKinetic(QEquation):
    """`Model` of the q-equation with mono-kinetic closure."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "q_mono_kinetic",
            label="q, mono-kinetic",
            layout="q",
            rank=4,
            solves="the closure over (x, y, theta) with one velocity in each cell",
            needs="numerics.cell that divides the domain",
            style=LineStyle("#009E73", (0.0, (5.0, 1.0, 1.0, 1.0)), "s"),
            summation=partial(on_q_grid, pressure=PRESSURE["mono_kinetic"]),
            pressure=PRESSURE["mono_kinetic"],
        ),
    )


MODEL = QMonoKinetic
