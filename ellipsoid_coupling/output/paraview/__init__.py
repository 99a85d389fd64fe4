"""ParaView files: `.pvd` series of fields and particles, and the flow at all places that use it."""

from ellipsoid_coupling.files.extras import require
from ellipsoid_coupling.output.paraview.export import export
from ellipsoid_coupling.output.paraview.flow import export_flow

__all__ = ["export", "export_flow"]

# At once, and not after the first files have been written.
require("pyvista")
