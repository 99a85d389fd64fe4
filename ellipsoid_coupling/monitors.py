"""Watching a run: a broken law of the physics stops the run with a message.

After every call of `advance` the monitors check the model's `Health`, which must stay

    finite      every number of it
    positive    no density below 0
    conserved   the mass as at the start; less where edges are open, never more
    inside      no particle beyond reflecting walls
    bounded     no faster than its forces can have made it: with damping Gamma, the largest |F| so far
                and noise A the root mean square speed is below |F|/Gamma + A/sqrt(2 Gamma), or below
                |F| t where nothing damps

The last is a law of v' = F - Gamma v + A dW/dt. A scheme that exceeds the bound ten times feeds energy
in, because its step is too long. For particles |F| is the largest force of all steps since the start, so
the phase of a motion in which the monitors look does not matter. The models themselves report particles
that leave the flow and steps that vanish. `Pace` watches the wall clock: it stops a run that would take
far longer than its user can have meant.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.files.limits import time_in_words
from ellipsoid_coupling.models import Health, Model, Setup, scheme_named
from ellipsoid_coupling.models.from_scene import scene_rates

# Rounding in sums over many cells is smaller; a scheme that leaks loses far more.
MASS_TOLERANCE = 1e-9
_SAFETY = 10.0
# The window in seconds over which the pace is measured, at most and at first; its largest part of the
# seconds that the run may take; and the calls of `advance` that the first estimate takes.
_WINDOW, _FIRST_WINDOW, _PART_OF_LONGEST, _FIRST_CALLS = 60.0, 1.0, 0.1, 10


class Monitors:
    """The checks of one run.

    Parameters
    ----------
    name : str
        The model's.
    setup : Setup
    model : Model
        At the start.

    Attributes
    ----------
    forces : (float, float)
        The largest force and torque so far, which a restart needs: a particle that a force has
        accelerated stays fast after the force has gone.
    """

    def __init__(self, name: str, setup: Setup, model: Model) -> None:
        self._name, self._setup = name, setup
        self._mass = float(model.counts()["mass_start"])
        rates = scene_rates(setup)
        self._damping = float(rates.damping[0]), float(rates.damping[-1])
        self._noise = float(rates.amplitude[0]), float(rates.amplitude[-1])
        start = model.health()
        self.forces, self._start_speeds = start.forces, start.speeds

    def look(self, model: Model) -> None:
        """Check the model once.

        Raises
        ------
        RunError
            With the broken law, the time, the position and a remedy.
        """
        health = model.health()
        (force, torque), (more, harder) = self.forces, health.forces
        self.forces = max(force, more), max(torque, harder)
        wrong = self._look_at(health, model.time)
        if wrong is not None:
            raise RunError(
                f"{self._setup.scene.name}, {self._name}, t = {model.time:.6g}: {wrong}. "
                f"{model.failure_site()} {self._remedy()}"
            )

    def _look_at(self, health: Health, now: float) -> str | None:
        if not all(map(math.isfinite, (health.mass, *health.speeds))):
            return "the solution is no longer finite"
        if health.least_density < 0.0:
            return f"a density of {health.least_density:.3g}"
        if health.outside:
            return f"{health.outside} coordinates of particles are outside the walls"
        scene = self._setup.scene
        change = (health.mass + health.left) / self._mass - 1.0
        closed = not scene.has_sides("leave")
        if change > MASS_TOLERANCE or (change < -MASS_TOLERANCE and closed):
            return f"the mass has changed by {change:.3g} of itself"
        # What comes in has a speed that no force gave it.
        return None if scene.has_inflow else self._too_fast(health, now)

    def _too_fast(self, health: Health, now: float) -> str | None:
        for k, what in enumerate(("speed", "angular speed")):
            damping, noise = self._damping[k], self._noise[k]
            longest = 1.0 / damping if damping > 0.0 else now
            thermal = noise / math.sqrt(2.0 * damping) if noise > 0.0 else 0.0
            limit = _SAFETY * (self.forces[k] * longest + thermal + self._start_speeds[k])
            if health.speeds[k] > limit:
                return (
                    f"a root mean square {what} of {health.speeds[k]:.3g} is beyond what forces of "
                    f"{self.forces[k]:.3g} can give"
                )
        return None

    def _remedy(self) -> str:
        return scheme_named(self._setup.scheme).remedy


class Pace:
    """The check of the wall time: the seconds that remain at the present pace.

    left = (end - t) dseconds/dt

    The pace is measured over the first calls of `advance`, then over one second, then over windows that
    double up to a minute. A short window at the start may mislead, so an estimate from less than a
    minute counts only if the next one agrees. A run without an end is thus stopped within seconds.

    Parameters
    ----------
    end : float
        The last save time.
    longest : float
        Seconds that the run may take in all, by default `limits.LONGEST_RUN`.
    """

    def __init__(self, end: float, longest: float) -> None:
        self._end, self._longest = end, longest
        self._enough = min(_WINDOW, _PART_OF_LONGEST * longest)
        self._window = min(_FIRST_WINDOW, self._enough)
        self._due = time.perf_counter() + self._window
        self._calls_left = _FIRST_CALLS
        self._since: tuple[float, float] | None = None
        self._was_slow = False

    def look(self, model: Model, seconds: Callable[[], float]) -> str | None:
        """A message if the run is too slow; `seconds` returns those spent so far without compiling."""
        self._calls_left -= 1
        due = time.perf_counter() >= self._due
        if self._since is not None and not due and self._calls_left != 0:
            return None
        if due:
            self._due = time.perf_counter() + self._window
            self._window = min(2.0 * self._window, self._enough)
        spent, before = seconds(), self._since
        self._since = (spent, model.time)
        # The time of an equilibrium stands still while it iterates; its own count of iterations ends it.
        if before is None or model.time == before[1]:
            return None
        lasted = spent - before[0]
        left = (self._end - model.time) * lasted / (model.time - before[1])
        was_slow, self._was_slow = self._was_slow, spent + left > self._longest
        if not self._was_slow or not (was_slow or lasted >= self._enough):
            return None
        limits = model.counts().get("step_limits", "nothing")
        return (
            f"it would take {time_in_words(left)} more at the pace of the last "
            f"{time_in_words(lasted)}. Steps are limited by: {limits}. {model.failure_site()} "
            "Relax that (a larger tolerance or CFL number, fewer cells or particles), or allow it the "
            "time with --longest"
        )
