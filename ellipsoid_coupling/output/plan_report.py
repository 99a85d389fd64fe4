"""What ``ellipsoid plan`` prints of a run's size, and with --flow of a flow."""

from __future__ import annotations

from ellipsoid_coupling.flow import FlowField, known_flow
from ellipsoid_coupling.models import plan_flow, plan_numbers, plan_patches
from ellipsoid_coupling.output.tables import print_table
from ellipsoid_coupling.scenes import Scene


def print_flow(scene: Scene, field: FlowField, viscosity: float | None) -> None:
    """Print what a flow means for the particles of a scene, and its patches.

    viscosity : nu of the fluid, where it is known

    Raises
    ------
    InputError
        As `plan_flow` and `plan_patches`.
    """
    facts = plan_flow(scene, field, viscosity)
    patches = [
        (patch.name, patch.patch_type, patch.kind, str(patch.edges), f"{patch.outflow:.3g}")
        for patch in plan_patches(scene, field)
    ]
    print_table("The flow and the particles", ("", "", ""), facts)
    if patches:
        print_table("Patches", ("patch", "type in the case", "kind", "edges", "flows out"), patches)


def print_numbers(scene: Scene, model: str, scheme: str, field: FlowField | None) -> None:
    """Print how large a run is, and the numbers that decide about models.

    field : the flow that was given; None for the scene's own, as far as it is known without a solver
    """
    part = scene.flow
    if field is None and part is not None:
        field = known_flow(part, scene.domain)
    facts = plan_numbers(scene, model, scheme, field)
    print_table(f"In numbers, {scheme}", ("", "", ""), facts)
