"""What each key of a scene file means, and its unit: for the documentation, and for editors.

Names, types, ranges and defaults stand in `scene.py`; tests/scenes/test_meanings.py holds the two together.
Units are those of the scene, whatever they are: the paper's scenes are dimensionless.
"""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """One sentence without a full stop, and the unit, "1" for a bare number, "" for what is none."""

    text: str
    unit: str = ""


# By dotted key; the keys of a kind stand behind its name.
MEANINGS = {
    "name": Meaning("names the folders and files of results"),
    "title": Meaning("stands over figures"),
    "units": Meaning(
        "of lengths and times: SI for metres and seconds; without it those of results are 1"
    ),
    "times": Meaning("when results are saved, increasing; a run starts at 0", "time"),
    "domain.x": Meaning("[low, high] of the rectangle in x", "length"),
    "domain.y": Meaning("[low, high] of the rectangle in y", "length"),
    "domain.boundary": Meaning(
        "what happens at the sides that [boundaries] does not name: particles and mass bounce, leave, "
        "or come in at the opposite side"
    ),
    "boundaries.NAME.kind": Meaning(
        "what happens at the side left, right, bottom or top, or at a patch of the flow's case; other keys "
        "are the numbers of the kind"
    ),
    "boundaries.NAME.inlet.density": Meaning(
        "that the fluid carries in, where a mass of 1 starts", "1/length^2"
    ),
    "boundaries.NAME.inlet.angle": Meaning(
        "of what comes in; that of the start where it is not given", "rad"
    ),
    "particles.length": Meaning("L, the full length along the main axis", "length"),
    "particles.width": Meaning("D, the full width, at most the length", "length"),
    "particles.mass": Meaning("m of one particle", "mass"),
    "particles.inertia": Meaning("I_c, the moment of inertia of one particle", "mass length^2"),
    "particles.number": Meaning("N, the particles of one realisation", "1"),
    "particles.realisations": Meaning("independent copies; histograms take them together", "1"),
    "start.x": Meaning(
        "[low, high] of the box in x that particles fill evenly; not needed with points or file",
        "length",
    ),
    "start.y": Meaning("[low, high] of that box in y; not needed with points or file", "length"),
    "start.angle": Meaning("of the main axis against the x axis", "rad"),
    "start.points": Meaning(
        "one [x, y] or [x, y, angle] a particle; the box then follows from them", "length, rad"
    ),
    "start.velocity": Meaning("at rest, or as the fluid moves and turns there"),
    "start.file": Meaning(
        "result.nc of an earlier run whose last state is the start, relative to the scene's file; the "
        "earlier run had the same particles, the same cells, or particles that cells count"
    ),
    "flow.case": Meaning("path of a solved case, relative to the scene's file; in place of field"),
    "flow.time": Meaning(
        "which times of the case: latest, all, a number, or [t0, t1]; linear in time in between",
        "time",
    ),
    "flow.repeat": Meaning("whether the first time follows again after the last one"),
    "flow.divergence": Meaning(
        "whether sources of the fluid are kept, where the case's face fluxes phi do not close"
    ),
    "flow.source": Meaning("a solved OpenFOAM case, a formula, or a flow that the run is given"),
    "flow.field": Meaning("the name of the case or of the formula, or the path of a case"),
    "flow.cells": Meaning("cells a side when a case is solved or a formula is sampled", "1"),
    "flow.drag": Meaning("gamma, the rate at which velocities relax to the fluid's", "1/time"),
    "flow.angular_drag": Meaning("gamma_bar, the same for angular velocities", "1/time"),
    "flow.parameters": Meaning("numbers by name, those of a registered formula"),
    "interaction.strength": Meaning("eps0 of the pair potential", "mass length^2/time^2"),
    "walls.sides": Meaning(
        "the sides or patches that have ghost particles or ghost cells; all that reflect without it"
    ),
    "walls.strength_factor": Meaning("a ghost's strength over a particle's", "1"),
    "walls.ghost_density": Meaning(
        "of ghost cells: the ghost particles' strength along the wall, or 1/cell^2 as printed in the paper"
    ),
    "gravity.x": Meaning("acceleration of all particles along x", "length/time^2"),
    "gravity.y": Meaning("the same along y", "length/time^2"),
    "outer_potential.kind": Meaning("the formula V1(r); other keys are its numbers"),
    "outer_potential.harmonic.stiffness": Meaning("of V1 = stiffness r^2/2", "1/time^2"),
    "angular_potential.kind": Meaning("the formula V2(theta); other keys are its numbers"),
    "angular_potential.axis.amplitude": Meaning(
        "of V2 = -amplitude cos^2(theta - direction)", "1/time^2"
    ),
    "angular_potential.axis.direction": Meaning("that main axes turn to", "rad"),
    "angular_potential.sine.amplitude": Meaning("of V2 = amplitude sin(theta)", "1/time^2"),
    "noise.noise": Meaning("A of the kicks A dW, with damping A^2/2", "time^(-1/2)"),
    "noise.angular_noise": Meaning("B, the same for angular velocities", "time^(-1/2)"),
    "numerics.cell": Meaning("h, the width of a grid's cells", "length"),
    "numerics.angle_cells": Meaning("cells of a q-grid in [0, 2 pi)", "1"),
    "numerics.time_step": Meaning("dt of particles in the scheme `paper`", "time"),
    "numerics.tolerance": Meaning(
        "error that the scheme `accurate` allows a particle step", "particle lengths, rad"
    ),
    "numerics.cfl": Meaning("CFL number of the grids", "1"),
    "numerics.interaction": Meaning(
        "how a grid's interaction integral is summed; auto takes harmonics where they pay"
    ),
    "numerics.harmonics_tolerance": Meaning(
        "error of sums by harmonics, as a part of the largest possible force", "1"
    ),
    "numerics.flux": Meaning("numerical flux of the grids, by name; else the scheme's own"),
}
