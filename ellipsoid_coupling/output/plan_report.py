"""What ``ellipsoid plan --flow`` prints of a flow."""

from __future__ import annotations

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import plan_flow, plan_patches
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
