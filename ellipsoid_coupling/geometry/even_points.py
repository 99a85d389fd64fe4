"""Points that are spread evenly over a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def even_points(
    x_range: tuple[float, float], y_range: tuple[float, float], columns: int, rows: int
) -> NDArray[np.float64]:
    """The midpoints of columns x rows equal parts of a box: x and y, (2, rows, columns) float64.

    As quadrature points of a constant density they err like 1/(columns rows).
    """
    axes = (
        low + (high - low) * ((np.arange(count) + 0.5) / count)
        for (low, high), count in ((x_range, columns), (y_range, rows))
    )
    return np.stack(np.meshgrid(*axes))
