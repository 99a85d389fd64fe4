"""Watching a run: what may not happen stops it with words, instead of spoiling its result.

After every call of `advance` a model tells its `Health`. It must stay

    finite      every number of it
    positive    no density below 0
    conserved   the mass as it was; less where edges are open, never more
    bounded     no faster than its forces can have made it: with damping Gamma, the largest |F| so far
                and noise A the root mean square speed is below |F|/Gamma + A/sqrt(2 Gamma), or below
                |F| t where nothing damps

The last is a law of v' = F - Gamma v + A dW/dt, so a scheme that breaks it by ten times feeds energy
in: its step is too long. Particles outside the flow and steps that vanish are told by the models.
"""

from __future__ import annotations

import math

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.models import Health, Model, Setup
from ellipsoid_coupling.models.parts import scene_rates

# Sums over many cells round by less; leaks of a scheme are far more.
MASS_TOLERANCE = 1e-9
_SAFETY = 10.0


class Monitors:
    """The watch over one run.

    Parameters
    ----------
    name : str
        The model's.
    setup : Setup
    model : Model
        At the start, or restored.
    """

    def __init__(self, name: str, setup: Setup, model: Model) -> None:
        self._name, self._setup = name, setup
        self._mass = float(model.counts()["mass_start"])
        rates = scene_rates(setup)
        self._damping = float(rates.damping[0]), float(rates.damping[-1])
        self._noise = float(rates.amplitude[0]), float(rates.amplitude[-1])
        self._forces = model.health().forces

    def look(self, model: Model) -> None:
        """Look once.

        Raises
        ------
        RunError
            With what is wrong, since when, and what to do.
        """
        health = model.health()
        (force, torque), (more, harder) = self._forces, health.forces
        self._forces = max(force, more), max(torque, harder)
        wrong = self._look_at(health, model.time)
        if wrong is not None:
            raise RunError(
                f"{self._setup.scene.name}, {self._name}, t = {model.time:.6g}: {wrong}. "
                f"{model.spot()} {self._remedy()}"
            )

    def _look_at(self, health: Health, now: float) -> str | None:
        if not all(map(math.isfinite, (health.mass, *health.speeds))):
            return "the solution is no longer finite"
        if health.least_density < 0.0:
            return f"a density of {health.least_density:.3g}"
        change = health.mass / self._mass - 1.0
        if change > MASS_TOLERANCE or (change < -MASS_TOLERANCE and self._setup.terms.reflection):
            return f"the mass has changed by {change:.3g} of itself"
        return self._too_fast(health, now)

    def _too_fast(self, health: Health, now: float) -> str | None:
        for k, what in enumerate(("speed", "angular speed")):
            damping, noise = self._damping[k], self._noise[k]
            longest = 1.0 / damping if damping > 0.0 else now
            thermal = noise / math.sqrt(2.0 * damping) if noise > 0.0 else 0.0
            limit = _SAFETY * (self._forces[k] * longest + thermal)
            if health.speeds[k] > limit:
                return (
                    f"a root mean square {what} of {health.speeds[k]:.3g} is beyond what forces of "
                    f"{self._forces[k]:.3g} can give"
                )
        return None

    def _remedy(self) -> str:
        if self._setup.scheme == "paper":
            return "Use a smaller time step or CFL number, or the scheme `accurate`."
        return "Use a smaller tolerance or CFL number, or a finer grid."
