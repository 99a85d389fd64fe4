"""What becomes of a particle, as a whole number: in the fluid, not there yet, or ended at a boundary."""

from __future__ import annotations

# FIRST_PATCH + p for one that ended at boundary p, in the order of `FluidEdges.names`.
NOT_YET, INSIDE, FIRST_PATCH = -1, 0, 1
