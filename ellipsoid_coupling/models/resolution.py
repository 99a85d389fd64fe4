"""The resolution of a run in words, as it stands in result files, tables and figures."""

from __future__ import annotations

from ellipsoid_coupling.models.registry import kind_named
from ellipsoid_coupling.models.schemes import scheme_named
from ellipsoid_coupling.scenes import Scene


def resolution_text(model: str, scheme: str, scene: Scene, realisations: int) -> str:
    """Cells of a grid, "h = 0.02, 60 angles"; or "1000 x 128 particles, dt = 0.01".

    Parameters
    ----------
    model, scheme : names
    scene : Scene
    realisations : int
        Of the run, which may differ from the scene's.
    """
    kind, numerics = kind_named(model), scene.numerics
    if kind.is_grid:
        angles = f", {numerics.angle_cells} angles" if kind.layout == "q" else ""
        return f"h = {numerics.cell:g}{angles}"
    steps = scheme_named(scheme)
    step = f"{steps.step_symbol} = {steps.step(numerics):g}"
    return f"{scene.particles.number} x {realisations} particles, {step}"
