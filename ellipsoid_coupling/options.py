"""Options that several commands have in common. Nothing heavy is imported before it is needed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from ellipsoid_coupling.flow import FlowField, Wanted
    from ellipsoid_coupling.scenes import Scene


@Parameter(name="*")
@dataclass(frozen=True)
class FlowChoice:
    """Which flow to take instead of the scene's own."""

    flow: Annotated[
        Path | None,
        Parameter(help="A solved 2-D OpenFOAM case, what foamToVTK wrote, or a saved flow (.npz)."),
    ] = None
    allow_misfit: Annotated[
        bool, Parameter(negative="", help="Take a flow even if it is far off the solver's U.")
    ] = False

    def wanted(self, name: str, scene: Scene) -> Wanted | FlowField:
        """What --flow names; for the run.toml of an earlier run, else, that run's own flow."""
        from ellipsoid_coupling.flow import Wanted
        from ellipsoid_coupling.run_flow import repeated_flow

        before = repeated_flow(name, scene) if self.flow is None else None
        return before or Wanted(self.flow, self.allow_misfit)
