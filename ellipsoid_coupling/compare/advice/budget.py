"""The seconds that probing may take, and how they are counted."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from ellipsoid_coupling.compare.resolutions import Level, Refinement
from ellipsoid_coupling.compare.timing import PATIENCE, Bench, Timed

# Shorter runs are timed three times: on a machine that does something else as well they vary most.
_SHORT, _REPEATS = 0.2, 3


class Budget:
    """Seconds for all probing together: what runs take is counted, and none may take more than is left.

    Compiling is not counted, nor the very short run that warms each model up. A run looks at the clock once
    a call of `Model.advance`, some hundredths of a second of work: by so much the budget may be exceeded.

    Attributes
    ----------
    seconds : float
        In all.
    spent : float
        So far.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.spent = seconds, 0.0

    @property
    def left(self) -> float:
        """Seconds, 0 or more."""
        return max(0.0, self.seconds - self.spent)

    def charge(self, seconds: float) -> None:
        """Count seconds."""
        self.spent += seconds

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count the seconds that are spent inside."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.charge(time.perf_counter() - began)

    def run(
        self,
        bench: Bench,
        refinement: Refinement,
        level: Level,
        allowed: float,
        *,
        once: bool = True,
    ) -> Timed:
        """Time a level; it may take `allowed` seconds at most. Unless `once`, a short run is repeated.

        Raises
        ------
        RunError
            If the run fails, or takes longer; the seconds that it took are counted.
        InputError
            If the level does not fit the scene or the memory.
        """
        first = self._timed(bench, refinement, level, allowed)
        if once or first.best > min(_SHORT, self.left / _REPEATS):
            return first
        times = [first.best]
        times += [
            self._timed(bench, refinement, level, self.left).best for _ in range(_REPEATS - 1)
        ]
        return replace(
            first, best=min(times), median=sorted(times)[_REPEATS // 2], repeats=_REPEATS
        )

    def _timed(self, bench: Bench, refinement: Refinement, level: Level, allowed: float) -> Timed:
        seen: list[float] = []

        def tell(stage: str, part: float) -> None:
            seen.append(time.perf_counter())
            bench.tell(stage, part)

        longest = min(allowed, self.left) / PATIENCE
        try:
            timed = replace(bench, longest=longest, report=tell).run(refinement, level, repeats=1)
        except BaseException:
            # A failed run has no time of its own: from its first report, which comes after compiling.
            self.charge(seen[-1] - seen[0] if seen else 0.0)
            raise
        self.charge(timed.best)
        return timed
