"""Relaxation rates of a small spheroid in a viscous fluid: from sizes and densities to a scene's numbers.

The particle is a prolate spheroid, long axis 2a = length, the other two 2b = width; its axis stays in the
plane of the flow. With e^2 = 1 - b^2/a^2, L = ln((1 + e)/(1 - e)) and mu = nu rho_f, the fluid resists with
(Oberbeck 1876, Jeffery 1922; Kim and Karrila, Microhydrodynamics, table 3.4)

    along the axis       6 pi mu a X,   X = (8/3)  e^3 / (-2e + (1 + e^2) L)
    across it            6 pi mu a Y,   Y = (16/3) e^3 / (2e + (3e^2 - 1) L)
    turning the axis     8 pi mu a^3 Z, Z = (4/3)  e^3 (2 - e^2) / (-2e + (1 + e^2) L)

The package has one drag for all directions. It is that of the mean mobility over all angles in the plane,
1/R = (1/(6 pi mu a)) (1/X + 1/Y)/2: with it a particle whose angle takes all values alike drifts, under any
force, as far as the spheroid does on average (Perrin's mean, which has 1/3 and 2/3 for angles in space).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError

# Below this e^2 the denominators are summed as series: their terms cancel otherwise.
_SERIES = 0.1
# Terms of e^2, of which the last is below rounding.
_TERMS = 20
# Beyond this Reynolds number of a particle its drag is no longer Stokes': 15 % above it for a sphere
# (Schiller and Naumann), as OpenFOAM's sphereDrag has it.
LARGEST_REYNOLDS = 1.0


class StokesRates(NamedTuple):
    """The numbers of [flow] and [particles] in a scene.

    drag, angular_drag : gamma and gamma_bar, per time
    mass, inertia : m, and I_c about an axis across the long one
    """

    drag: float
    angular_drag: float
    mass: float
    inertia: float


def stokes_rates(
    length: float, width: float, particle_density: float, fluid_density: float, viscosity: float
) -> StokesRates:
    """The relaxation rates, mass and inertia of a prolate spheroid, see the module.

    Parameters
    ----------
    length, width : float
        Axes 2a >= 2b.
    particle_density, fluid_density : float
        Masses per volume.
    viscosity : float
        nu, the fluid's kinematic viscosity, as in constant/transportProperties: length^2 per time.

    Returns
    -------
    StokesRates
        In the units of the arguments. For a sphere of diameter d the rates are 18 nu rho_f/(rho_p d^2)
        and 60 nu rho_f/(rho_p d^2).

    Raises
    ------
    InputError
        For numbers that are not above 0 and finite, or a width above the length.
    """
    given = {
        "length": length, "width": width, "particle_density": particle_density,
        "fluid_density": fluid_density, "viscosity": viscosity,
    }  # fmt: skip
    for name, value in given.items():
        if not 0.0 < value < math.inf:
            raise InputError(name, "a finite number above 0", f"{value:g}", "Change it.")
    if width > length:
        raise InputError("width", f"at most the length {length:g}", f"{width:g}", "Exchange them.")
    a, b = 0.5 * length, 0.5 * width
    along, across, turning = resistances(width / length)
    mass = 4.0 / 3.0 * math.pi * a * b**2 * particle_density
    inertia = mass * (a**2 + b**2) / 5.0
    mobility = 0.5 * (1.0 / along + 1.0 / across)
    mu = viscosity * fluid_density
    return StokesRates(
        drag=6.0 * math.pi * mu * a / mobility / mass,
        angular_drag=8.0 * math.pi * mu * a**3 * turning / inertia,
        mass=mass,
        inertia=inertia,
    )


def resistances(aspect: float) -> tuple[float, float, float]:
    """X, Y and Z of the module for b/a = `aspect`, above 0 and at most 1; all are 1 for a sphere."""
    e2 = (1.0 - aspect) * (1.0 + aspect)
    if e2 <= _SERIES:
        # L = 2 (e + e^3/3 + e^5/5 + ...): both denominators are e^3 times a power series of e^2.
        powers = [(e2**k, 2 * k + 1, 2 * k + 3) for k in range(_TERMS)]
        first = 2.0 * math.fsum(power * (1.0 / m + 1.0 / n) for power, n, m in powers)
        second = 2.0 * math.fsum(power * (3.0 / n - 1.0 / m) for power, n, m in powers)
    else:
        e = math.sqrt(e2)
        # (1 + e)/(1 - e) = ((1 + e) a/b)^2, also where 1 - e is below rounding.
        log = 2.0 * math.log((1.0 + e) / aspect)
        first = (-2.0 * e + (1.0 + e2) * log) / e**3
        second = (2.0 * e + (3.0 * e2 - 1.0) * log) / e**3
    return 8.0 / 3.0 / first, 16.0 / 3.0 / second, 4.0 / 3.0 * (2.0 - e2) / first
