"""Anderson's iteration for a fixed point x = g(x).

    x_{n+1} = sum_j a_j [x_j + mixing (g(x_j) - x_j)],    sum_j a_j = 1,

over the last few x_j, where the a_j make sum_j a_j (g(x_j) - x_j) least in the given norm.
(D. G. Anderson, J. ACM 12, 1965; H. F. Walker and P. Ni, SIAM J. Numer. Anal. 49, 2011.)
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Differences that depend on one another to this part are left out of the fit.
_LEAST_SINGULAR = 1e-12


class Anderson:
    """The iteration's memory.

    Parameters
    ----------
    depth : int
        How many earlier steps are combined; 0 is plain damped iteration.
    mixing : float
        In (0, 1]: the part of g(x) - x that is added.
    """

    def __init__(self, depth: int, mixing: float) -> None:
        self._mixing = mixing
        self._points: deque[Floats] = deque(maxlen=depth + 1)
        self._changes: deque[Floats] = deque(maxlen=depth + 1)

    def next(self, point: Floats, image: Floats, weight: Floats) -> Floats:
        """The next x from x (`point`), g(x) (`image`) and the weight of each entry in the norm.

        Three arrays of one shape, the same at every call.
        """
        change = image - point
        self._points.append(point)
        self._changes.append(change)
        step: Floats = point + self._mixing * change
        if len(self._points) == 1:
            return step
        past = np.diff(np.array(self._changes), axis=0)
        moved = np.diff(np.array(self._points), axis=0)
        matrix = (past * weight).reshape(len(past), -1).T
        share, *_ = np.linalg.lstsq(matrix, (change * weight).ravel(), rcond=_LEAST_SINGULAR)
        return np.asarray(step - np.tensordot(share, moved + self._mixing * past, 1))
