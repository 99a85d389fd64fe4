"""What of a case is taken as the flow: which times, and whether its sources."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Divergence(Enum):
    """Whether a flow keeps its sources: not at all, where its phi does not close, or in any case."""

    NONE = 0
    WHERE_OPEN = 1
    ALWAYS = 2


class When(NamedTuple):
    """See `scenes.scene.Flow`.

    Attributes
    ----------
    time : "latest", "all", a time, or (t_0, t_1)
    repeat : bool
        The last time is the first one, one period later.
    until : float
        The scene's last time.
    divergence : bool
        Sources are kept, where phi does not close.
    """

    time: str | float | tuple[float, float] = "latest"
    repeat: bool = False
    until: float = 0.0
    divergence: bool = False

    @property
    def is_latest(self) -> bool:
        """Whether the case's last time is taken, for ever."""
        return self.time == "latest"


LATEST = When()
