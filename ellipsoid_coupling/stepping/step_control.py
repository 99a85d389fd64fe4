"""Step control: how every model's steps are chosen, repeated, counted and, in the end, given up.

A scheme says how long a step it allows and what for; from there on all models do the same:

    choose    the fewest equal steps to the end (particles: to the next save time), none longer than
              allowed; grids reach save times on the way by a short step aside, see `Aside`
    accept    time and counts go on; the next step is what the scheme plans
    repeat    a step that turned out too long is taken back and tried shorter
    stop      below a millionth of a millionth of the time to reach, a step cannot be meant

What has been counted is one row of numbers (a clock) per realisation, so that compiled loops can
keep it, and checkpoints hold all of it.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.stepping.status import NOT_FINITE, RUNNING, STEP_TOO_SMALL

Floats = NDArray[np.float64]

# Columns of a clock. NEXT_STEP is planned because of the reason PLANNED_BY; SHORTEST was at
# SHORTEST_AT; LARGEST_FORCE and LARGEST_TORQUE of all steps so far, of particles. Where the step is held:
# WORST_ERROR of the steps since SEEN_SINCE; whether it GREW since it was last shortened; how often a
# growth was TAKEN_BACK. From FIRST_COUNT on stand the numbers of steps that each reason has limited.
TIME, NEXT_STEP, PLANNED_BY, STEPS, REJECTED, STATUS = range(6)
SHORTEST, SHORTEST_AT, LONGEST, LARGEST_FORCE, LARGEST_TORQUE = range(6, 11)
WORST_ERROR, SEEN_SINCE, GREW, TAKEN_BACK, FIRST_COUNT = range(11, 16)

# What limits a step.
SAVE_TIME, GIVEN, CFL_LIMIT, FORCE_LIMIT, ROTATION_LIMIT = range(5)
POSITION_ERROR, ANGLE_ERROR, REPEATED, COLLISION = range(5, 9)
REASONS = (
    "save times",
    "given step",
    "CFL number",
    "force",
    "rotation",
    "position error",
    "angle error",
    "repeated step",
    "collision",
)
CLOCK_COLUMNS = FIRST_COUNT + len(REASONS)

# A step below this part of the time to reach cannot be meant.
SMALLEST_STEP = 1e-12
# Part of the domain. A larger one gives smaller errors and more steps after the start.
_AHEAD = 1.0 / 32.0
# A step that was refused is tried again at this part; after each accepted one it may grow likewise.
_SHORTER = 0.5
# A held step doubles as soon as the last step allows it, until so many doublings were taken back; from then
# on each further one makes it wait for so many times more steps.
_FREE_DOUBLINGS, _LONGER_WAIT = 8.0, 16.0
# Steps this much shorter than planned were cut to meet a save time.
_CUT = 1.0 - 1e-9


def new_clock(rows: int, first_step: float, reason: int) -> Floats:
    """Clocks at time 0, (rows, CLOCK_COLUMNS) float64, whose first step is planned."""
    clock = np.zeros((rows, CLOCK_COLUMNS))
    clock[:, NEXT_STEP], clock[:, PLANNED_BY], clock[:, SHORTEST] = first_step, reason, np.inf
    return clock


def clock_fault(clock: Floats, low: float, high: float) -> str:
    """What clocks (rows, CLOCK_COLUMNS) from a file have that no run between two times has, or "".

    Kernels take the reason as an index and divide by the step, without looking.
    """
    reason, step = clock[:, PLANNED_BY], clock[:, NEXT_STEP]
    if not np.isin(reason, np.arange(len(REASONS))).all():
        return f"a reason {reason.max():g} of {len(REASONS)}"
    if not (step > 0.0).all():
        return f"a next step of {step.min():g}"
    if not ((low <= clock[:, TIME]) & (clock[:, TIME] <= high)).all():
        return f"t = {clock[:, TIME].max():g} beyond [{low:g}, {high:g}]"
    if (clock[:, STATUS] != RUNNING).any() or (clock < 0.0).any():
        return "a status or a count that no run has"
    return ""


def looking_ahead(cell: float, cells: int) -> float:
    """How far ahead a second-order scheme looks for the speed that its step must suit, a length.

    From rest, with acceleration a, a step that goes a part of a cell takes sqrt(2 h/a), and its error
    of dt^3 is one of h^(3/2) at the end. The speed reached over a fixed part of the domain bounds the
    step by a multiple of h from the first one on, however slow all is: at the start, or where it turns.

    cells : how many there are along the direction, or the longer side of the domain
    """
    return cell * cells * _AHEAD


@kernel
def equal_steps(remaining: float, largest: float) -> float:
    """The step that reaches the end in the fewest equal steps, none above `largest`."""
    if largest >= remaining:
        return remaining
    return remaining / math.ceil(remaining / largest * (1.0 - 1e-12))


@kernel
def time_after(t: float, until: float, dt: float) -> float:
    """Where a step of dt from the time t leads; `until` exactly where it ends there."""
    return until if dt >= until - t else t + dt


@kernel
def accept(clock: Floats, until: float, dt: float, next_step: float, reason: int) -> None:
    """A step of dt is done; plan `next_step`, which `reason` limits, or give up. One row, in place.

    A step cut short to meet `until` says nothing against the longer one that was planned.
    """
    planned = clock[NEXT_STEP]
    limit = int(clock[PLANNED_BY])
    remaining = until - clock[TIME]
    if dt >= remaining and dt < _CUT * planned:
        limit = SAVE_TIME
    clock[FIRST_COUNT + limit] += 1.0
    clock[STEPS] += 1.0
    if dt < clock[SHORTEST]:
        clock[SHORTEST], clock[SHORTEST_AT] = dt, clock[TIME]
    clock[LONGEST] = max(clock[LONGEST], dt)
    clock[TIME] = time_after(clock[TIME], until, dt)
    if next_step < dt or next_step > planned:
        clock[NEXT_STEP], clock[PLANNED_BY] = next_step, reason
    # With noise steps are never repeated, so that `reject` cannot see this.
    if clock[TIME] < until and next_step < dt and not next_step > SMALLEST_STEP * until:
        clock[STATUS] = STEP_TOO_SMALL


@kernel
def shorten(clock: Floats, until: float, shorter: float, reason: int) -> None:
    """Plan a shorter step, or give up. One row, in place."""
    clock[NEXT_STEP], clock[PLANNED_BY] = shorter, reason
    clock[WORST_ERROR], clock[SEEN_SINCE] = 0.0, clock[STEPS]
    clock[TAKEN_BACK] += clock[GREW]
    clock[GREW] = 0.0
    if not shorter > SMALLEST_STEP * until:
        clock[STATUS] = STEP_TOO_SMALL


@kernel
def reject(clock: Floats, until: float, shorter: float, reason: int) -> None:
    """A step was too long: plan a shorter one, or give up. One row, in place."""
    clock[REJECTED] += 1.0
    shorten(clock, until, shorter, reason)


@kernel
def step_factor(error: float) -> float:
    """How much longer the next step may be: the estimate is of third order in dt, 0.9 aims below."""
    if not math.isfinite(error):
        return 0.1
    return min(2.0, max(0.3, float(0.9 * (error + 1e-6) ** (-1.0 / 3.0))))


@kernel
def halved_step(dt: float, error: float) -> float:
    """The held step to try after a refused one of dt: halved until the estimate allows it."""
    shorter, left = 0.5 * dt, 0.125 * error
    while not left <= 1.0 and shorter > 0.1 * dt:
        shorter, left = 0.5 * shorter, 0.125 * left
    return shorter


@kernel
def held_step(clock: Floats, dt: float, error: float) -> float:
    """The step to plan after one of dt where each change of it changes the energy. One row, in place.

    A change at a point z adds (dt_new^2 - dt^2) G(z) to the energy. Those of a collision cancel, on the way
    in and on the way out, if the step is nearly a function of z: so it only halves and doubles, and both
    where the error of the longer step passes the tolerance. Over many collisions what does not cancel
    adds up. So doublings that were taken back make the next one wait: their number goes with the logarithm
    of the steps, and with it the energy's error.
    """
    clock[WORST_ERROR] = max(clock[WORST_ERROR], error)
    done = clock[STEPS] + 1.0
    waits = _LONGER_WAIT ** max(0.0, clock[TAKEN_BACK] - _FREE_DOUBLINGS)
    if done - clock[SEEN_SINCE] < waits:
        return float(clock[NEXT_STEP])
    longer = 2.0 * dt if 8.0 * clock[WORST_ERROR] <= 1.0 else 0.0
    clock[WORST_ERROR], clock[SEEN_SINCE] = 0.0, done
    if longer > clock[NEXT_STEP]:
        clock[GREW] = 1.0
    return max(longer, float(clock[NEXT_STEP]))


class Aside:
    """What a grid goes on from after a save time.

    A step that was cut short to meet a save time would change all that follows. So the state is copied,
    a short step leads to the save time, and after that the run goes on from the copy: the times that
    are saved do not change the others.

    Attributes
    ----------
    arrays : dict or None
        The state before the short step; None while there is none.
    until : float
        The save time that it leads to.
    """

    def __init__(self) -> None:
        self.arrays: dict[str, NDArray[Any]] | None = None
        self.until = math.inf

    def keep(self, arrays: dict[str, NDArray[Any]], until: float) -> None:
        """Copy a state, before a short step to the time `until`."""
        self.arrays, self.until = {name: array.copy() for name, array in arrays.items()}, until


class Steppable(Protocol):
    """What `advance_by_limits` steps: an equation on a grid.

    clock : (1, CLOCK_COLUMNS); aside : empty at first.
    """

    clock: Floats
    aside: Aside

    @property
    def end(self) -> float:
        """What the steps end at: the last save time, or an earlier time at which the flow is given."""
        ...

    def live(self) -> dict[str, NDArray[Any]]:
        """The arrays that are stepped, all that `restore` needs."""
        ...

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from a copy of `live`, and empty `aside`."""
        ...

    def allowed_step(self) -> tuple[float, int]:
        """The step that the present state allows and its reason; 0 if it is not finite."""
        ...

    def try_step(self, dt: float, after: float) -> bool:
        """Step by dt to the time `after`; False if that was too long, everything as before."""
        ...


def advance_by_limits(equation: Steppable, until: float, steps: int) -> int:
    """At most `steps` steps of an equation whose state tells beforehand how long they may be.

    After a refused step the following ones grow back by doubling.

    Returns
    -------
    int
        A status of `stepping.status`.
    """
    if equation.aside.arrays is not None and until > equation.aside.until:
        equation.restore(equation.aside.arrays)
    aside = equation.aside
    clock = equation.clock[0]
    end = max(until, equation.end) if aside.arrays is None else until
    for _ in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0:
            break
        allowed, reason = equation.allowed_step()
        if not allowed > SMALLEST_STEP * until:
            return STEP_TOO_SMALL if allowed > 0.0 else NOT_FINITE
        held = clock[NEXT_STEP] if clock[PLANNED_BY] == REPEATED else np.inf
        if held <= allowed:
            allowed, reason = held, REPEATED
        dt = equal_steps(end - clock[TIME], allowed)
        if dt > remaining:
            aside.keep(equation.live(), until)
            end, dt = until, equal_steps(remaining, allowed)
        clock[NEXT_STEP], clock[PLANNED_BY] = allowed, reason
        while not equation.try_step(dt, time_after(clock[TIME], end, dt)):
            reject(clock, end, _SHORTER * dt, REPEATED)
            if clock[STATUS] != RUNNING:
                return int(clock[STATUS])
            dt = equal_steps(end - clock[TIME], clock[NEXT_STEP])
        grown = dt / _SHORTER if clock[PLANNED_BY] == REPEATED else np.inf
        accept(clock, end, dt, grown, REPEATED)
    return RUNNING


def step_log(clock: Floats) -> dict[str, Any]:
    """What the result file says of the steps: counts, extremes, and what limited them.

    Parameters
    ----------
    clock : (rows, CLOCK_COLUMNS) float64

    Returns
    -------
    dict
        steps (of the row that took most), rejected_steps (of all), shortest_step, longest_step,
        shortest_step_time, and step_limits, such as "CFL number 83 %, save times 17 %".
    """
    log: dict[str, Any] = {
        "steps": float(clock[:, STEPS].max()),
        "rejected_steps": float(clock[:, REJECTED].sum()),
    }
    counts = clock[:, FIRST_COUNT:].sum(axis=0)
    if not counts.any():
        return log
    row = int(clock[:, SHORTEST].argmin())
    order = [int(k) for k in np.argsort(-counts, kind="stable") if counts[k] > 0.0]
    parts = [f"{REASONS[k]} {100.0 * counts[k] / counts.sum():.3g} %" for k in order]
    return log | {
        "shortest_step": float(clock[row, SHORTEST]),
        "shortest_step_time": float(clock[row, SHORTEST_AT]),
        "longest_step": float(clock[:, LONGEST].max()),
        "step_limits": ", ".join(parts),
    }
