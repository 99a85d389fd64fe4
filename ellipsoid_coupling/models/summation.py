"""How a model sums its interaction, in words for `ellipsoid plan`.

Each function calls the functions that choose the interaction of a run, with the same arguments.
"""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.finite_volume.grid import scene_grid
from ellipsoid_coupling.geometry.boundaries import periodic_axes
from ellipsoid_coupling.interaction.convolution.spectra import Precision, precision_for
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.select import choose_samples, scene_samples
from ellipsoid_coupling.interaction.rho_grid import HarmonicInteraction
from ellipsoid_coupling.interaction.select import choose_interaction
from ellipsoid_coupling.physics.closure import Pressure
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene


def pair_by_pair(scene: Scene) -> str:
    """For particles that interact with each other and are few."""
    del scene
    return "pair by pair, to rounding"


def among_samples(scene: Scene) -> str:
    """For samples of one density (`choose_samples`)."""
    samples = scene_samples(scene, scene.particles.number * scene.particles.realisations)
    assert samples is not None
    chosen = choose_samples(samples)
    if not isinstance(chosen, SampleInteraction):
        return "pair by pair of samples, to rounding"
    return (
        f"force and torque within {samples.tolerance:g} of the largest that a density can exert: "
        f"{chosen.harmonics} harmonics, {chosen.nodes_per_width:.3g} nodes a particle width, "
        f"{_words(chosen.precision)}"
    )


def on_r_grid(scene: Scene) -> str:
    """For a density over space with one angle in each cell (`choose_interaction`)."""
    assert scene.interaction is not None
    grid, numerics = scene_grid(scene), scene.numerics
    chosen = choose_interaction(
        grid.shape,
        grid.cell,
        potential_shape(scene.particles.length, scene.particles.width),
        scene.interaction.strength,
        tolerance=numerics.harmonics_tolerance,
        method=numerics.interaction,
        periods=periodic_axes(scene),
    )
    if not isinstance(chosen, HarmonicInteraction):
        return "pair by pair of cells, to rounding"
    return (
        f"within {numerics.harmonics_tolerance:g} of its largest value: "
        f"{chosen.series.harmonics} harmonics, {_words(chosen.precision)}"
    )


def q_tolerance(scene: Scene, pressure: Pressure) -> float:
    """The tolerance of the interaction of a density over space and angle; 0 for rounding alone.

    Under pressure a model has equilibria, which persist only if the interaction is exact to rounding.
    """
    numerics = scene.numerics
    exact = pressure != 0.0 or numerics.interaction == "direct"
    return 0.0 if exact else numerics.harmonics_tolerance


def on_q_grid(scene: Scene, pressure: Pressure) -> str:
    """For a density over space and angle (transforms in space, a sum over all pairs of angles)."""
    assert scene.interaction is not None
    tolerance = q_tolerance(scene, pressure)
    if tolerance == 0.0:
        return "by transforms, to rounding"
    shape = potential_shape(scene.particles.length, scene.particles.width)
    sizes = scene.numerics.cell**2, shape.size, scene.interaction.strength
    precision = precision_for(tolerance, *sizes)
    return f"by transforms, within {tolerance:g} of its largest value, {_words(precision)}"


def _words(precision: Precision) -> str:
    return "single precision" if precision is np.float32 else "double precision"
