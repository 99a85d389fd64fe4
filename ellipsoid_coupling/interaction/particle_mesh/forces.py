"""The interaction of a cloud of samples with its own density, by splines, harmonics and FFT.

Every one of S samples carries the mass 1/S, and lies in the potential of them all,

    phi(r, theta) = eps0/S sum_j U(r, r_j, theta, theta_j)
    force_i = -grad_r phi(r_i, theta_i),    torque_i = -dphi/dtheta (r_i, theta_i)

With U = sum_pq K_pq(delta) b_p(theta) b_q(thetabar) (`angular_series`), and K_pq replaced by its
interpolating cubic spline in both positions on nodes h apart (B: cubic B-spline, four nodes wide),

    1. deposit       s_q(node)   = sum_j B(r_j - node) b_q(theta_j) / S
    2. convolve      phi_p(node) = eps0 sum_q K~_pq * s_q,    K~ = K / (b_x b_y)^2 at every frequency
    3. slopes        force_i     = -sum_p b_p(theta_i) sum_nodes grad B(r_i - node) phi_p(node)
                     torque_i    = -sum_p b_p'(theta_i) sum_nodes B(r_i - node) phi_p(node)

b = (2 + cos(wave number))/3 is the B-spline's own transform at the nodes: dividing by it once turns
the deposit into that of the interpolating spline's basis, a second time the interpolation. The work
is O(S) + O(nodes log nodes); a direct sum takes O(S^2).

All forces and torques are slopes of one energy. The slope of the potential's spline is as near to the
force as the spline of the force, and one potential takes a third of the transforms. Action is reaction
within the spline's error, to rounding for a smooth density.

**Accuracy.** Let rho be the largest density of samples (mass per area, whatever their angles).
Everywhere and for all angles

    |force  - exact|  <=  tolerance * rho * eps0 * int max_angles |grad_r U| d(delta)
    |torque - exact|  <=  tolerance * rho * eps0 * int max_angles |dU/dtheta| d(delta)

The right-hand sides without the tolerance are the largest force and torque that such a density can
exert; grids keep the same (`angular_series`). Half of the tolerance is for the series in the angles,
half for the spline, from which follows how far apart the nodes are (`nodes`). Rounding adds
1e-6 in single precision, which is taken for tolerances from 1e-4 on.

A few scattered samples have no density. Measured at aspect ratio 2 and tolerances of 2e-2 and 2e-3 (6.9
and 13 nodes a width, 13 and 24 harmonics), errors as parts of the largest force and torque of the
cloud: for 60 independent samples at most 7e-3 and 1.1e-2, 8e-4 and 9e-4 (root mean squares, as parts
of those of force and torque, 0.45 and 0.66 %, 0.05 and 0.06 %), for 4000 at most 2e-3 and 3e-3, 2e-4 and
3e-4. A single pair errs by 2.7e-2 and 4e-3 of the largest force of any pair at most.
"""

from __future__ import annotations

import math

import numpy as np

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.angular_series import angular_series
from ellipsoid_coupling.interaction.convolution.fft_lengths import FittedSpectra
from ellipsoid_coupling.interaction.convolution.kernel_spectra import POTENTIAL, AngularKernel
from ellipsoid_coupling.interaction.convolution.spectra import Real, precision_for
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.particle_mesh.folding import Folding, fitting_spacing
from ellipsoid_coupling.interaction.particle_mesh.nodes import (
    MOST_ENTRIES,
    MOST_HARMONICS,
    SPLINE_PART,
    most_harmonics,
    nodes_per_width,
)
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.interaction.particle_mesh.splines import (
    STENCIL,
    Nodes,
    add_to,
    deposit,
    interpolate,
    sort_by_row,
)
from ellipsoid_coupling.interaction.rho_grid import Convolution
from ellipsoid_coupling.physics.potential import PotentialShape

# The spline's basis function decays by 0.27 a node: images this many nodes further are not felt, to 1e-7.
_TAIL = 12


class SampleInteraction:
    """Forces among the samples of a density.

    Samples outside the region neither act nor feel anything. The same bits come out for any number of
    threads.

    Parameters
    ----------
    region : Region
    shape : PotentialShape
    width : float
        The particles' width D, which the potential's steepness goes with.
    strength : float
        eps0.
    tolerance : float
        Of force and torque, see above.
    most : int
        So many harmonics may be taken.

    Attributes
    ----------
    nodes_per_width : float
        Nodes within the width D.
    harmonics : int
        M.
    precision : float32 or float64
        Of the transforms.
    spectra_bytes : float
        Of samples all over the rectangle; fewer where they are closer together.

    Raises
    ------
    InputError
        If the tolerance takes more than 60 harmonics, or spectra of more than 5e8 numbers; if no
        spacing of nodes divides both periods.
    """

    def __init__(
        self,
        region: Region,
        shape: PotentialShape,
        width: float,
        strength: float,
        tolerance: float,
        most: int = MOST_HARMONICS,
    ) -> None:
        h = _spacing(region, width / nodes_per_width(shape, width, tolerance))
        self.nodes_per_width = width / h
        area = region.width * region.height
        # Bounded before the series is searched: a long search takes minutes.
        most = min(most, most_harmonics(area / h**2, shape.reach / h))
        _require(most >= 0, shape, tolerance)
        self.nodes = _cover(region, h)
        series = angular_series(shape, h, (1.0 - SPLINE_PART) * tolerance, most)
        _require(series is not None, shape, tolerance)
        # `_require` has raised, which a type checker does not see.
        assert series is not None
        self.harmonics = series.harmonics
        self.precision = precision_for(tolerance, h * h, shape.size, strength)
        # Cells' spectra have h^2 in them; a sample has its whole mass.
        kernel = AngularKernel(series, strength / h**2, self.precision, POTENTIAL, _undo_splines)
        self._folding = Folding((self.nodes.rows, self.nodes.columns), region.periods)
        spectra = FittedSpectra(self._folding.own, kernel.cells + _TAIL, kernel, region.periods)
        rows, columns = spectra.longest
        bytes_each = np.dtype(self.precision).itemsize
        self.spectra_bytes = (2.0 * series.harmonics + 1.0) ** 2 * rows * columns / 4 * bytes_each
        self._convolve = Convolution(spectra, self.precision, POTENTIAL)
        self._pool = BufferPool()

    def add_forces(self, position: Array, weights: tuple[float, float], force: Array) -> None:
        """Add the interaction to the drift of all samples, in place.

        Parameters
        ----------
        position : (K, D, B) float64
            x, y and, with D = 3, the angle of K blocks of B samples.
        weights : (1/m, 1/I_c)
        force : (K, D, B)
            Per mass and per inertia.
        """
        pool, nodes = self._pool, self.nodes
        slots = pool.array("slots", (position.shape[0] * position.shape[2],), np.int64)
        here = sort_by_row(position, nodes, slots, pool)
        if len(here.samples) == 0:
            return
        functions = 2 * self.harmonics + 1
        # Masses 1/S of all samples, also of those that left the rectangle.
        sources = deposit(here, nodes, functions, 1.0 / slots.size, pool)
        folding = self._folding
        shape = *folding.extent(here.extent), round_up_to_vectors(functions)
        potential: Real = pool.array("potential", shape, self.precision)
        sources = folding.fold(sources, here.corner, pool)
        columns = sources.shape[2]

        def take(part: slice, fields: Real) -> None:
            # Functions become the last axis: `interpolate` sums over them in vectors.
            potential[part, :columns, :functions] = fields[0, :, :, :columns].transpose(1, 2, 0)
            potential[part, :columns, functions:] = 0.0

        self._convolve(sources.shape, lambda part: sources[:, part].astype(self.precision), take)
        folding.unfold(potential)
        # Along a periodic axis all of the period has been unfolded, from its first node on.
        corner = folding.corner(here.corner)
        found = interpolate(here.samples, nodes, corner, potential, functions, pool)
        add_to(force, found, weights, slots)


def _require(holds: bool, shape: PotentialShape, tolerance: float) -> None:
    if not holds:
        raise InputError(
            "interaction of samples by harmonics",
            f"a tolerance that {MOST_HARMONICS} harmonics and spectra of {MOST_ENTRIES:.0e} numbers reach",
            f"{tolerance} for a shape factor of {shape.shape_factor:.3g}",
            'Raise numerics.harmonics_tolerance, or set numerics.interaction = "direct".',
        )


def _spacing(region: Region, h: float) -> float:
    """The nodes' spacing, up to `h`.

    Raises
    ------
    InputError
        If none divides both periods.
    """
    width, height = region.width, region.height
    found = fitting_spacing(width, height, h, region.periods)
    if found is None:
        raise InputError(
            "interaction of samples by harmonics",
            "periods with a common divisor, for nodes of one spacing along both",
            f"{width:g} and {height:g}",
            'Change domain, or set numerics.interaction = "direct".',
        )
    return found


def _cover(region: Region, h: float) -> Nodes:
    """Nodes such that every point of the rectangle lies between the inner two of four."""
    # A side of a whole number of spacings gets none more for a rounding.
    columns, rows = (math.ceil(size / h - 1e-9) + STENCIL for size in (region.width, region.height))
    return Nodes(region.x_range[0] - h, region.y_range[0] - h, 1.0 / h, rows, columns)


def _undo_splines(length: int) -> Array:
    """1/b^2 at the frequencies of a transform, (length//2 + 1,)."""
    waves = 2.0 * np.pi * np.arange(length // 2 + 1) / length
    # b = (2 + cos)/3, undone once for the deposit and once for the interpolation.
    return np.asarray((3.0 / (2.0 + np.cos(waves))) ** 2)
