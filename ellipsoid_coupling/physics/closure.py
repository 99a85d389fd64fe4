"""Moment closures: what the velocities' spread adds to the momentum balance.

`eq:macro_q_max` and `eq:macro_q_mono` differ by one coefficient. With n the direction of a flux,

    f_n(U)_k = v_n U_k + pressure * density * (k is the momentum in direction n)

mono-kinetic (all particles at a point move alike): pressure 0, pressureless Euler; Maxwellian (a unit
Gaussian about the mean): pressure 1, isothermal Euler with sound speed 1. A closure with an equation of
its own (a temperature, say) is a `finite_volume.system.System` with a further component.
"""

from __future__ import annotations

PRESSURE: dict[str, float] = {"mono_kinetic": 0.0, "maxwellian": 1.0}
