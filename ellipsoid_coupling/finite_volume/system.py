"""What an equation on cells is made of: its components, its axes, its pressure, its further sources.

    mean angle carried (rho)        density, velocity_x, velocity_y, mean_angle, angular_velocity
    angle as an axis (q)            density, velocity_x, velocity_y, angular_velocity
    nothing turns (either)          density, velocity_x, velocity_y

Fields hold the density and the density times every other component. Steppers, sources and step limits
ask a `System` and nothing else what there is; an equation with a further component, a temperature say,
is a longer tuple of names, the source of that component, and a pressure that may depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from ellipsoid_coupling.physics.closure import Pressure

if TYPE_CHECKING:
    from ellipsoid_coupling.finite_volume.cells import CellFields

DENSITY = "density"
VELOCITIES = ("velocity_x", "velocity_y", "angular_velocity")
MEAN_ANGLE = "mean_angle"

# Of whatever has no forces and no Newton step of its own: (cells, dt), in place.
Source = Callable[["CellFields", float], None]


class System(NamedTuple):
    """One equation on cells.

    Attributes
    ----------
    components : tuple of str
        The density first. Velocities have the names in `VELOCITIES`, a carried angle is `MEAN_ANGLE`;
        any other one comes last, is transported like these and changed by `source` only.
    axes : tuple of int
        The directions of transport: -1 (x), -2 (y) and, where the angle is an axis, -3.
    pressure : float or record
        A number times the density, 1 Maxwellian, 0 mono-kinetic; or a law of `physics.closure`.
    slaved : bool
        Velocities follow from the drift at every moment, v = F/Gamma, and are no unknowns.
    source : callable or None
        (cells, dt): sources of further components over dt, in place, exact or of the scheme's order.
    """

    components: tuple[str, ...]
    axes: tuple[int, ...]
    pressure: Pressure = 0.0
    slaved: bool = False
    source: Source | None = None

    @property
    def velocities(self) -> tuple[int, ...]:
        """Which components are velocities, (2 or 3,): of x, y and, where something turns, the angle."""
        return tuple(self.components.index(name) for name in VELOCITIES if name in self.components)

    @property
    def carried_angle(self) -> tuple[int, ...]:
        """Which component is the mean angle, (1,); () where a cell's plane tells the angle."""
        return tuple(k for k, name in enumerate(self.components) if name == MEAN_ANGLE)

    @property
    def further(self) -> tuple[int, ...]:
        """Which components are neither density, velocities nor an angle."""
        # By name: only what steppers know by a name of its own has forces or a Newton step.
        known = (DENSITY, MEAN_ANGLE, *VELOCITIES)
        return tuple(k for k, name in enumerate(self.components) if name not in known)

    def place(self, name: str) -> int:
        """Where the component called `name` stands.

        Raises
        ------
        ValueError
            If there is none.
        """
        if name not in self.components:
            raise ValueError(f"no component is called {name}, but {', '.join(self.components)}")
        return self.components.index(name)

    @property
    def single_stream(self) -> bool:
        """Whether all mass in a cell moves alike and keeps to that, so that characteristics can cross."""
        return self.pressure == 0.0 and not self.slaved


def rho_system(turns: bool, slaved: bool = False) -> System:
    """The components of the rho-equations: the mean angle is carried along."""
    # Nothing turns circles: neither the angle nor its rate is computed.
    angle = (MEAN_ANGLE, VELOCITIES[2]) if turns else ()
    return System((DENSITY, *VELOCITIES[:2], *angle), (-1, -2), slaved=slaved)


def q_system(turns: bool, resolved: bool, pressure: Pressure) -> System:
    """The components of the q-equations; the angle is an axis where something turns and it is resolved."""
    angle = VELOCITIES[2:] if turns else ()
    axes = (-1, -2, -3) if turns and resolved else (-1, -2)
    return System((DENSITY, *VELOCITIES[:2], *angle), axes, pressure)
