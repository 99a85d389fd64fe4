"""The plane of a case that a flow lies in: where the package's x and y are in the case's space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class CasePlane(NamedTuple):
    """A plane of the case's space; by default z = 0, in which formulas lie.

    The package's x and y are the other two axes of the case, in their order: x and z of a case in the
    x-z plane. Angles are those from the first of them to the second.

    Attributes
    ----------
    normal : int
        The axis across it: 0, 1 or 2 for the case's x, y or z.
    level : float
        Its place on that axis: for a mesh, the middle between its two planes.
    """

    normal: int = 2
    level: float = 0.0

    @property
    def axes(self) -> tuple[int, int]:
        """The case's axes that are the package's x and y."""
        first, second = (axis for axis in range(3) if axis != self.normal)
        return first, second

    def turned(self, flat: Array) -> Array:
        """Vectors (n, 3) of the package's space, along x, y and across the plane, as the case has them."""
        vectors = np.empty_like(flat)
        vectors[:, [*self.axes, self.normal]] = flat
        return vectors

    def facing(self) -> tuple[Array, Array]:
        """Unit vectors (3,): towards an eye that sees x run to the right and y up, and up for that eye."""
        right, up = np.eye(3)[list(self.axes)]
        return np.cross(right, up) + 0.0, up  # 0.0 and not -0.0


# Of flows without a case: z = 0.
FLAT = CasePlane()
