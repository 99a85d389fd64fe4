"""A flow at several times, linear in time in between; its fields stay in a file but for those in use.

times    0       1       2              n-1            repeat: the last time is the first one,
         f_0 --- f_1 --- f_2 --- ... --- f_n-1                 one period later, and f_n-1 is f_0

interval     0       1       2   ...    n-2   n-1 ...          numbered on and on where they repeat
"""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_SERIES_BYTES, MOST_SERIES_TIMES
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow.field import FlowArrays, FlowField, FlowSample
from ellipsoid_coupling.flow.interval import Interval, blend, without_a_time
from ellipsoid_coupling.flow.saved import outline_arrays
from ellipsoid_coupling.flow.saved_series import (
    digest_of,
    is_series,
    read_coefficients,
    read_index,
    write_series,
)
from ellipsoid_coupling.scenes.summary import Summary

Array = NDArray[np.float64]

# The flow that repeats may differ at both ends of the period by this part of its largest coefficient's
# size, rms over rms: a vortex street's period seldom is a whole number of folders.
LARGEST_JUMP = 0.05
# Such a difference is not told.
_ROUNDING = 1e-9


class _Scratch:
    """A folder for a series without one; it goes when the last one that uses it goes."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="ellipsoid-"))
        weakref.finalize(self, _remove, self.path, os.getpid())


def _remove(folder: Path, owner: int) -> None:
    # Not by a process that was forked off meanwhile.
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)


@dataclass(frozen=True, repr=False)
class FlowSeries(FlowField):
    """A flow at several times; see the module, and `at` for one of them.

    Its `arrays` are at rest: the mesh's place and cells, but no velocity. The outflow of its `outline`
    is the mean of all times.

    Attributes
    ----------
    path : Path
        The file that holds its fields, see `saved_series`.
    times : (n,) float64
        Ascending, in the scene's time.
    repeat : bool
    digests : (n,) str
        Of the coefficients at each time.
    scratch : object or None
        What keeps `path` from being removed.
    """

    path: Path = field(kw_only=True)
    times: Array = field(kw_only=True)
    repeat: bool = field(kw_only=True)
    digests: tuple[str, ...] = field(kw_only=True)
    scratch: object = field(default=None, repr=False, compare=False, kw_only=True)

    @classmethod
    def of_fields(
        cls,
        times: Iterable[float],
        fields: Iterable[FlowField],
        origin: str = "a series of flows",
        *,
        repeat: bool = False,
        allow_jump: bool = False,
        told: Callable[[], str] = str,
    ) -> FlowSeries:
        """The series of these flows, which are taken one by one and kept in a temporary file.

        Parameters
        ----------
        times : ascending, as many as there are `fields`, two at least
        fields : of one mesh
        origin : one line
        repeat : whether the last time is the first one, one period later
        allow_jump : take a flow that repeats although it is another one after a period
        told : gives what stands behind the line, once all flows have been taken

        Raises
        ------
        InputError
            For times that do not ascend, flows on other meshes, too many of them, or a flow that is more
            than `LARGEST_JUMP` another one after a period.
        """
        at = np.array([float(time) for time in times])
        if at.size < 2 or not (np.diff(at) > 0.0).all() or at.size > MOST_SERIES_TIMES:
            expected = f"from two to {MOST_SERIES_TIMES} ascending times"
            found = ", ".join(f"{time:g}" for time in at[:5]) or "none"
            raise InputError("a series of flows", expected, found, "Choose other times.")
        scratch = _Scratch()
        path, writer = scratch.path / "flow.npz", _Writer(at, repeat, origin, allow_jump, told)
        write_series(path, writer.index, writer.coefficients(fields))
        return replace(cls.load(path), scratch=scratch)

    @classmethod
    def load(cls, path: Path) -> FlowSeries:
        """Read what `save` wrote, but for the fields; InputError where the file is something else."""
        saved = read_index(path)
        first = saved.first
        x0, y0, gx, gy, x_low, x_high, y_low, y_high = first.numbers
        limits = (x_low, x_high, y_low, y_high)
        # At rest: one number stands for all coefficients.
        still = np.broadcast_to(np.zeros(()), first.coefficients.shape)
        arrays = FlowArrays(still, x0, y0, gx, gy, *limits, first.mask, first.chi)
        return cls(
            arrays,
            first.origin,
            first.outline,
            plane=first.plane,
            path=path,
            times=saved.times,
            repeat=saved.repeat,
            digests=saved.digests,
        )

    def save(self, path: Path) -> None:
        """Write a file that `load` reads; a kill at any moment leaves the old file or the new."""
        with whole_file(path) as beside:
            shutil.copyfile(self.path, beside)

    @functools.cached_property
    def digest(self) -> str:
        """What tells two series apart: a hash of all that they hold."""
        whole = (self._frame.digest, self.times.tobytes().hex(), self.repeat, self.digests)
        return hashlib.sha256(repr(whole).encode()).hexdigest()[:16]

    @property
    def _frame(self) -> FlowField:
        """At rest: all that does not change."""
        return FlowField(self.arrays, self.origin, self.outline, plane=self.plane)

    @property
    def in_time(self) -> FlowArrays | Interval:
        """Nothing: a run takes those of `window.open_window`. Raises RunError."""
        raise without_a_time()

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> FlowSample:
        """Nothing: without a time there is no velocity. Raises RunError."""
        del x, y
        raise without_a_time()

    @property
    def covers(self) -> tuple[float, float]:
        """The times of the scene that it is known at."""
        return float(self.times[0]), np.inf if self.repeat else float(self.times[-1])

    # Intervals.

    def time_of(self, interval: int) -> float:
        """When an interval starts."""
        parts = self.times.size - 1
        if not self.repeat:
            return float(self.times[interval])
        rounds, place = divmod(interval, parts)
        return float(self.times[place] + rounds * (self.times[-1] - self.times[0]))

    def interval_at(self, t: float) -> int:
        """The interval that a time lies in, at the end of one the next; the nearest one from outside."""
        parts = self.times.size - 1
        if not self.repeat:
            return int(np.clip(np.searchsorted(self.times, t, "right") - 1, 0, parts - 1))
        period = self.times[-1] - self.times[0]
        number = parts * int((t - self.times[0]) // period)
        # Rounding, and then the place within the period.
        while self.time_of(number) > t:
            number -= 1
        while self.time_of(number + 1) <= t:
            number += 1
        return number

    def coefficients(self, start: int) -> Array:
        """Those at the start of interval `start`, a new array; InputError where the file has changed."""
        number = start % (self.times.size - 1) if self.repeat else start
        (found,) = read_coefficients(self.path, [number], self.times, self.digests)
        return found

    def at(self, t: float) -> FlowField:
        """The flow at a time; at the nearest one from outside."""
        number = self.interval_at(t)
        start, end = self.time_of(number), self.time_of(number + 1)
        part = min(max((t - start) / (end - start), 0.0), 1.0)
        mean = blend(part, self.coefficients(number), self.coefficients(number + 1))
        return self._with(mean)

    def _summary(self) -> Summary:
        head, rows = super()._summary()
        span = f"{self.times.size} from {self.times[0]:g} to {self.times[-1]:g}"
        return Summary(head, [*rows, ("times", span + ", repeated" * self.repeat)])

    def steady_fields(self) -> Iterator[FlowField]:
        """The flow at each of its times."""
        numbers = range(self.times.size - (1 if self.repeat else 0))
        yield from map(self._with, read_coefficients(self.path, numbers, self.times, self.digests))

    def given_times(self, until: float) -> tuple[Array, NDArray[np.int64]]:
        """As `FlowField.given_times`."""
        numbers = np.arange(self.interval_at(0.0), self.interval_at(until) + 2)
        fields = numbers % (self.times.size - 1) if self.repeat else numbers
        return np.array([self.time_of(int(number)) for number in numbers]), fields

    def _with(self, coefficients: Array) -> FlowField:
        arrays = self.arrays._replace(coefficients=coefficients)
        return FlowField(arrays, self.origin, self.outline, plane=self.plane)


def require_covered(where: str, covers: tuple[float, float], until: float) -> None:
    """Refuse a flow that is not known from the scene's time 0 to its last one.

    covers : the times of the scene that it is known at

    Raises
    ------
    InputError
    """
    if not covers[0] <= 0.0 or not until <= covers[1]:
        raise InputError(
            where, f"a flow that covers the scene's times [0, {until:g}]",
            f"one at [{covers[0]:g}, {covers[1]:g}] of them",
            "Change times, name other times of the case (flow.time), solve on, or set flow.repeat = true "
            "where the flow is periodic.",
        )  # fmt: skip


def load_flow(path: Path) -> FlowField:
    """A saved flow, at one time or at several; InputError where the file is something else."""
    return FlowSeries.load(path) if is_series(path) else FlowField.load(path)


class _Writer:
    """Gives the coefficients of fields one by one, and fills in the index of their file.

    Two fields are held at once, the first and the present one.
    """

    def __init__(
        self, times: Array, repeat: bool, origin: str, allow_jump: bool, told: Callable[[], str]
    ) -> None:
        self.index: dict[str, NDArray[Any]] = {"times": times}
        self._times, self._repeat, self._origin = times, repeat, origin
        self._allow_jump, self._told = allow_jump, told

    def coefficients(self, fields: Iterable[FlowField]) -> Iterator[Array]:
        """Of each field."""
        digests, count, outflow = [], self._times.size, np.zeros(())
        source = iter(fields)
        first = next(source)
        _require_room(first, count)
        for number in range(count):
            now = first if number == 0 else next(source)
            _require_same_mesh(first, now, float(self._times[number]))
            outflow = outflow + (0.0 if now.outline is None else now.outline.outflow / count)
            if number == count - 1 and self._repeat:
                self._close_period(first, now)
            digests.append(digest_of(now.arrays.coefficients))
            yield now.arrays.coefficients
        self._fill_index(first, digests, outflow)

    def _fill_index(self, first: FlowField, digests: list[str], outflow: Array) -> None:
        self.index |= {
            "repeat": np.array([self._repeat], np.uint8),
            "digests": np.array(digests, "<U16"),
            "numbers": np.array(first.arrays[1:9]),
            "mask": first.arrays.mask,
            "plane": np.array(first.plane, np.float64),
            "origin": np.array(self._origin + self._told()),
        }
        if first.outline is not None:
            self.index |= outline_arrays(first.outline._replace(outflow=outflow))

    def _close_period(self, first: FlowField, last: FlowField) -> None:
        """Tell how far the flow is another one after a period, or refuse it."""
        jump = difference(first, last)
        period = self._times[-1] - self._times[0]
        if not (jump <= LARGEST_JUMP or self._allow_jump):
            raise InputError(
                "flow.repeat",
                f"a flow that is the same after its period {period:g}, to {LARGEST_JUMP:.0%}",
                f"U that differs by {100.0 * jump:.2g} % (rms)",
                "Choose times of a whole period; --allow-misfit (allow_misfit=True) takes it as it is.",
            )  # fmt: skip
        self._origin += f", repeated every {period:g}"
        if jump > _ROUNDING:
            self._origin += f" (its U then is {100.0 * jump:.2g} % off)"


def difference(one: FlowField, other: FlowField) -> float:
    """How far the velocities of two flows on one mesh differ, rms over the larger rms."""

    def velocity(coefficients: Array) -> float:
        # Psi and, in a flow with sources, chi.
        parts = coefficients.reshape(-1, one.arrays.mask.shape[0] + 3, coefficients.shape[1])
        slopes = (np.diff(parts, axis=axis) for axis in (1, 2))
        per = one.arrays.inverse_dy, one.arrays.inverse_dx
        return float(np.sqrt(sum(np.mean((g * s) ** 2) for g, s in zip(per, slopes, strict=True))))

    first, second = one.arrays.coefficients, other.arrays.coefficients
    largest = max(velocity(first), velocity(second))
    return velocity(second - first) / largest if largest > 0.0 else 0.0


def _require_room(field: FlowField, count: int) -> None:
    size = field.arrays.coefficients.nbytes * count
    if size > MOST_SERIES_BYTES:
        raise InputError(
            "a series of flows", f"at most {MOST_SERIES_BYTES / 1e9:g} GB of them",
            f"{count} times with {size / count / 1e6:.3g} MB each", "Choose fewer times.",
        )  # fmt: skip


def _require_same_mesh(first: FlowField, now: FlowField, time: float) -> None:
    same = first.arrays[1:9] == now.arrays[1:9] and np.array_equal(
        first.arrays.mask, now.arrays.mask
    )
    same = same and first.arrays.chi == now.arrays.chi and first.plane == now.plane
    if (first.outline is None) != (now.outline is None):
        same = False
    elif first.outline is not None and now.outline is not None:
        pairs = zip(first.outline[:2], now.outline[:2], strict=True)
        same = same and all(np.array_equal(*pair) for pair in pairs)
        same = same and first.outline[3:] == now.outline[3:]
    if not same:
        raise InputError(
            f"a series of flows, time {time:g}", "the mesh of the first time, sources as there", "others",
            "Give flows on one mesh, all with sources or none.",
        )  # fmt: skip
