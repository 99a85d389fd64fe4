"""The diffusive limit `eq:difflimit`, with sigma as the errata have it.

    d_t rho       + div(rho v)     = 0              v     = sigma_1 [gamma u - K1/m - grad V1]
    d_t (rho phi) + div(rho phi v) = rho omega      omega = sigma_2 [gamma_bar g - K2/I_c - dV2]

    sigma_1 = 2/(2 gamma + A^2)      sigma_2 = 2/(2 gamma_bar + B^2)

v and omega follow from rho and phi at every moment, they are no unknowns: the system of the
rho-equation with slaved velocities, which `finite_volume.splitting` steps by its overdamped schemes.
"""

from __future__ import annotations

from typing import ClassVar

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.from_scene import scene_rates
from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.r_grid import RGridEquation
from ellipsoid_coupling.models.summation import on_r_grid


class Diffusive(RGridEquation):
    """`Model` of the diffusive limit.

    Raises
    ------
    InputError
        Where nothing damps the velocity (gamma = A = 0) or the rotation (gamma_bar = B = 0) of
        particles that turn: there is no such limit.
    """

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "diffusive",
            label="diffusive limit",
            layout="rho",
            rank=6,
            solves="the limit of strong damping, over (x, y)",
            needs="numerics.cell that divides the domain; drag or noise on all that moves",
            style=LineStyle("#CC79A7", (0.0, (2.0, 1.0)), "v"),
            summation=on_r_grid,
            overdamped=True,
        ),
    )

    slaved: ClassVar[bool] = True

    @classmethod
    def require_fit(cls, setup: Setup) -> None:
        """Raise InputError for a grid or a flux that does not fit, or where nothing damps."""
        super().require_fit(setup)
        _require_damping(setup)


def _require_damping(setup: Setup) -> None:
    damping = scene_rates(setup).damping
    undamped = "velocity" if damping[0] == 0.0 else "rotation"
    if not damping.all():
        raise InputError(
            f"scene {setup.scene.name}, model diffusive",
            "drag or noise on everything that moves (gamma + A^2/2 > 0, gamma_bar + B^2/2 > 0)",
            f"no damping of the {undamped}, hence no diffusive limit",
            "Add [flow] with a drag, or [noise], or choose another model.",
        )


MODEL = Diffusive
