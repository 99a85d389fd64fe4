"""Options that several commands share, and the reading of whole numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, Token

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import LONGEST_RUN

if TYPE_CHECKING:
    from ellipsoid_coupling.flow import FlowField, Wanted
    from ellipsoid_coupling.scenes import Scene
    from ellipsoid_coupling.storage.run_folder import RunFolder

Settings = Annotated[
    list[str] | None,
    Parameter(name="--set", consume_multiple=True, negative="", help="Scene values: key=value ..."),
]
Names = Annotated[list[str], Parameter(negative="")]


def _whole(_kind: object, tokens: Sequence[Token]) -> int:
    """A whole number as it stands; cyclopts' own reading of 1.5 is 2."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number, found {text!r}") from None


Whole = Annotated[int, Parameter(converter=_whole)]
OptionalWhole = Annotated[int | None, Parameter(converter=_whole)]


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """The folder that a command leaves its results in."""

    out: Annotated[Path | None, Parameter(help="Folder of the results.")] = None
    force: Annotated[
        bool, Parameter(negative="", help="Write into --out even if it holds something already.")
    ] = False

    def check(self) -> None:
        """Refuse, before anything is computed, a folder that holds something."""
        from ellipsoid_coupling.storage.run_folder import require_free

        if self.out is not None:
            require_free(self.out, force=self.force)

    @contextmanager
    def folder(self, name: str) -> Iterator[Path]:
        """`out`, or a new results/`name` with the first free number behind it.

        The latter is removed at the end if nothing was written into it.
        """
        from ellipsoid_coupling.storage.run_folder import numbered_folder

        if self.out is not None:
            yield self.out
        else:
            with numbered_folder(Path("results") / name) as folder:
                yield folder


@Parameter(name="*")
@dataclass(frozen=True)
class Keeping(Output):
    """The options of a run's folder and checkpoints."""

    resume: Annotated[
        bool, Parameter(negative="", help="Continue the interrupted run in --out, bit for bit.")
    ] = False
    checkpoint_seconds: Annotated[
        float, Parameter(help="Seconds between checkpoints: the most that a kill loses.")
    ] = 15.0
    stop_after: Annotated[
        float | None,
        Parameter(help="Write a checkpoint and stop (status 1) after this many seconds."),
    ] = None
    longest: Annotated[
        float,
        Parameter(help="Stop likewise if the run would take more seconds in all at its pace."),
    ] = LONGEST_RUN

    def check(self) -> None:
        """Refuse numbers out of range, and a folder that holds something."""
        if self.resume and self.out is None:
            raise InputError("--resume", "--out with the run's folder", "none", "Add --out.")
        if not 0.0 <= self.checkpoint_seconds < math.inf:
            found = f"{self.checkpoint_seconds:g}"
            raise InputError("--checkpoint-seconds", "seconds, 0 or more", found, "Change it.")
        if self.stop_after is not None and not 0.0 < self.stop_after < math.inf:
            found = f"{self.stop_after:g}"
            raise InputError("--stop-after", "seconds above 0", found, "Change it.")

        if not self.longest > 0.0:
            raise InputError("--longest", "seconds above 0", f"{self.longest:g}", "Change it.")

    def run_folder(self, name: str) -> RunFolder:
        """The run folder, `out` or a new results/`name`, which the run itself makes and claims."""
        from ellipsoid_coupling.storage.run_folder import RunFolder

        path = self.out if self.out is not None else Path("results") / name
        limits = self.checkpoint_seconds, self.stop_after, self.longest
        return RunFolder(path, self.resume, self.force, *limits, numbered=self.out is None)


@Parameter(name="*")
@dataclass(frozen=True)
class FlowChoice:
    """Which flow to take instead of the scene's own."""

    flow: Annotated[
        Path | None,
        Parameter(
            help="A solved 2-D OpenFOAM case, the output of foamToVTK, or a saved flow (.npz)."
        ),
    ] = None
    allow_misfit: Annotated[
        bool, Parameter(negative="", help="Take a flow even if it is far off the solver's U.")
    ] = False

    solve: Annotated[
        bool,
        Parameter(
            negative="",
            help="Mesh and solve the case of --flow first; the solution is kept in the cache.",
        ),
    ] = False

    def wanted(self, name: str, scene: Scene) -> Wanted | FlowField:
        """The flow of --flow; without it, for the run.toml of an earlier run, that run's own flow."""
        from ellipsoid_coupling.storage.run_flow import repeated_flow

        before = repeated_flow(name, scene) if self.flow is None and not self.solve else None
        return before or self.given()

    def given(self) -> Wanted:
        """The flow of --flow."""
        from ellipsoid_coupling.flow import Wanted

        return Wanted(self.flow, self.allow_misfit, self.solve)
