"""How near each other the nodes of the samples' interaction must be, and how many harmonics fit.

The norm is that of `forces`. The spline's error in it was measured over all pairs of angles and
all places of both particles between the nodes, for aspect ratios from 1 to 8. It falls faster than
h^3 down to some 16 nodes a width, since finer and finer parts of the potential's steep flank come to
be resolved, and like h^3 beyond: the slope of a cubic spline. At aspect ratios L/D above 5/4 it falls
like (L/D)^(-2/3), because the flank becomes a smaller part of the potential.

Splines of order 6 and 8 were measured as well: with 4, 8 and 12 nodes their error is 0.8, 0.66 and 0.5
of the cubic one's, order 8 hardly less than 6. They would save a tenth of the nodes at tolerances
down to 1e-3, and a sample would go through 36 or 64 nodes instead of 16.
"""

from __future__ import annotations

import math

import numpy as np

from ellipsoid_coupling.physics.potential import PotentialShape

# Of a tolerance, the part that the spline may use; the rest is the angular series'. Halves cost least:
# the work goes like (spline's error)^(-0.5) and (series' error)^(-0.5).
SPLINE_PART = 0.5
# No series is tried beyond.
MOST_HARMONICS = 60
# Numbers in the spectra, 4 or 8 bytes each.
MOST_ENTRIES = 5e8

# Nodes within the width D; the largest error of force or torque times (L/D)^(2/3), a tenth added for
# angles and places between those that were tried.
_NODES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
_ERRORS = (0.33, 0.153, 0.076, 0.0246, 0.0099, 0.0022, 6.8e-4, 1.7e-4)
_MOST_SLENDER = 5.0  # beyond this L/D the error was found to fall no further
_ORDER = 3.0
# Numbers of the tables that spectra are made of, as those of the spectra, per squared nodes in reach:
# coefficients at every distance, and three copies of them at every offset of one quadrant, in double.
_TABLES = 7.0


def slenderness(shape: PotentialShape, width: float) -> float:
    """L/D, from the potential's reach sqrt(2) 2L."""
    return shape.reach / (2.0 * math.sqrt(2.0) * width)


def nodes_per_width(shape: PotentialShape, width: float, tolerance: float) -> float:
    """Nodes within the width D for which the spline errs by `SPLINE_PART` of the tolerance at most.

    Parameters
    ----------
    shape : PotentialShape
    width : float
        D, in the scene's unit.
    tolerance : float
        `numerics.harmonics_tolerance`.
    """
    slender = min(slenderness(shape, width), _MOST_SLENDER)
    allowed = SPLINE_PART * tolerance * slender ** (2.0 / 3.0)
    if allowed < _ERRORS[-1]:
        return float(_NODES[-1] * (_ERRORS[-1] / allowed) ** (1.0 / _ORDER))
    # np.interp wants rising abscissae, and takes the first value beyond them.
    falling = np.interp(-math.log(allowed), -np.log(_ERRORS), np.log(_NODES))
    return float(np.exp(falling))


def most_harmonics(nodes: float, in_reach: float) -> int:
    """How many harmonics spectra of bounded size hold; -1 for none, not even the zeroth.

    Parameters
    ----------
    nodes : float
        Of the whole grid.
    in_reach : float
        Nodes within the potential's reach, along one direction.
    """
    numbers = max(0.25 * nodes, _TABLES * in_reach * in_reach, 1.0)
    functions = math.floor(math.sqrt(MOST_ENTRIES / numbers))
    return min(MOST_HARMONICS, (functions - 1) // 2) if functions else -1
