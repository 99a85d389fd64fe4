"""The contents of a checkpoint: the model's state, snapshots so far, seconds, and the monitors' bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.writing import Arrays
from ellipsoid_coupling.models import Model, kind_named
from ellipsoid_coupling.stepping.step_control import CLOCK_COLUMNS, clock_fault

Floats = NDArray[np.float64]

_STATE, _SNAPSHOT, _SECONDS, _FORCES = "state.", "snapshot.", "seconds", "forces"


class Progress(NamedTuple):
    """The state of a run besides its model's.

    Attributes
    ----------
    snapshots : list of dict
        One for each save time that the run has passed.
    seconds : (2,) float64
        Of running and of compiling.
    forces : (float, float)
        The largest force and torque that the monitors have seen.
    """

    snapshots: list[Arrays]
    seconds: Floats
    forces: tuple[float, float]


def pack(model: Model, progress: Progress) -> Arrays:
    """All that a run needs to continue, as named arrays."""
    arrays: Arrays = {_SECONDS: progress.seconds, _FORCES: np.array(progress.forces)}
    arrays |= {_STATE + name: array for name, array in model.state().items()}
    for i, snapshot in enumerate(progress.snapshots):
        arrays |= {f"{_SNAPSHOT}{i}.{name}": array for name, array in snapshot.items()}
    return arrays


def unpack(arrays: Arrays, model: Model, times: Sequence[float], where: str) -> Progress:
    """Put a model, fresh from its start, into the state of a checkpoint.

    Parameters
    ----------
    arrays : dict
        As `pack` made them.
    times : sequence of float
        The scene's save times.
    where : str
        The file, for messages.

    Raises
    ------
    InputError
        If names, shapes, dtypes or times are not those of this model on this scene, or if a run cannot
        have such numbers. Compiled loops check none of this.
    """
    snapshots = _numbered(arrays)
    if len(snapshots) >= len(times) or sorted(snapshots) != list(range(len(snapshots))):
        raise _unfit(where, f"fewer than {len(times)} snapshots", f"{sorted(snapshots)}")
    own = {k: a for k, a in arrays.items() if not k.startswith((_STATE, _SNAPSHOT))}
    # Under pressure the monitors know no bound of the forces and keep infinity.
    _require_alike(where, own, {_SECONDS: np.zeros(2), _FORCES: np.full(2, np.inf)})
    state = state_of(arrays)
    _require_alike(where, state, model.state())
    for snapshot in snapshots.values():
        _require_alike(where, snapshot, model.snapshot())
    count = len(snapshots)
    # Grids continue from a time before the last save, see `stepping.step_control.Aside`.
    reached = times[count - 1] if count and not kind_named(model.name).is_grid else 0.0
    for clock in (a for a in state.values() if a.shape[1:] == (CLOCK_COLUMNS,)):
        wrong = clock_fault(np.asarray(clock, np.float64), reached, times[count])
        if wrong:
            raise _unfit(where, "clocks of a run between its snapshots", wrong)
    model.restore(state)
    if not reached <= model.time <= times[count]:
        raise _unfit(where, "a time that fits its snapshots", f"t = {model.time:g}")
    force, torque = map(float, arrays[_FORCES])
    seconds = np.asarray(arrays[_SECONDS], np.float64)
    return Progress([snapshots[i] for i in range(count)], seconds, (force, torque))


def state_of(arrays: Arrays) -> Arrays:
    """What the model goes on from, of a checkpoint's arrays."""
    return {k.removeprefix(_STATE): a for k, a in arrays.items() if k.startswith(_STATE)}


def _numbered(arrays: Arrays) -> dict[int, Arrays]:
    """The snapshots, by number and name."""
    snapshots: dict[int, Arrays] = {}
    for key, array in arrays.items():
        number, _, name = key.removeprefix(_SNAPSHOT).partition(".")
        if key.startswith(_SNAPSHOT) and number.isdecimal() and len(number) < 10:
            snapshots.setdefault(int(number), {})[name] = array
    return snapshots


def _require_alike(where: str, found: Arrays, expected: Arrays) -> None:
    """The same names, shapes and dtypes, and finite wherever a run's start is finite."""
    if found.keys() != expected.keys():
        raise _unfit(where, f"arrays {', '.join(expected)}", ", ".join(found) or "none")
    for name, array in expected.items():
        other = found[name]
        if other.shape != array.shape or other.dtype != array.dtype:
            wanted = f"{name} of {array.dtype} {array.shape}"
            raise _unfit(where, wanted, f"{other.dtype} {other.shape}")
        wrong = ~np.isfinite(other) & np.isfinite(array)
        if wrong.any():
            index = [int(i) for i in np.argwhere(wrong)[0]]
            raise _unfit(where, f"a finite number at {name}{index}", f"{other[tuple(index)]}")


def _unfit(where: str, expected: str, found: str) -> InputError:
    return InputError(
        where, f"a checkpoint of this run: {expected}", found, "Remove it to start again."
    )
