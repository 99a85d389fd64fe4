"""The q-equation with mono-kinetic closure, `eq:macro_q_mono`.

    d_t q         + div_r(q v)               + d_theta(q omega)         = 0
    d_t (q v)     + div_r(q v (x) v) + d_theta(q v omega)       = q S_1 - (A^2/2) q v
    d_t (q omega) + div_r(q v omega)         + d_theta(q omega^2) = q S_2 - (B^2/2) q omega

All particles at a place and angle move alike: pressure 0. See `q_equation` for the
equation and its schemes.
"""

from __future__ import annotations

from typing import ClassVar

from ellipsoid_coupling.models.q_equation import QEquation


class QMonoKinetic(QEquation):
    """`Model` of the q-equation with mono-kinetic closure."""

    names: ClassVar[tuple[str, ...]] = ("q_mono_kinetic",)
    closure: ClassVar[str] = "mono_kinetic"


MODEL = QMonoKinetic
