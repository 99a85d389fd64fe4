"""Options that several commands share, and the reading of whole numbers."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, Token

from ellipsoid_coupling.errors import InputError, shown
from ellipsoid_coupling.files.limits import LONGEST_RUN, MOST_SEED

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


def _span(_kind: object, tokens: Sequence[Token]) -> int | range:
    """A whole number, or A:B and A:B:STEP as a range."""
    return _read_span(tokens[0].value)


def _read_span(text: str) -> int | range:
    try:
        bounds = [int(part) for part in text.split(":")]
    except ValueError:
        bounds = []
    if len(bounds) == 1:
        return bounds[0]
    first, end, step = (*bounds, 0, 0, 1)[:3] if len(bounds) != 2 else (*bounds, 1)
    if len(bounds) not in (2, 3) or not 0 <= first < end <= MOST_SEED or not 1 <= step <= MOST_SEED:
        expected = f"a whole number, A:B or A:B:STEP with 0 <= A < B <= {MOST_SEED:g}"
        raise ValueError(f"expected {expected}, found {text!r}")
    return range(first, end, step)


Span = Annotated[int | range | None, Parameter(converter=_span)]


def _seeds(_kind: object, tokens: Sequence[Token]) -> tuple[int, ...]:
    """Whole numbers, a,b,c or A:B."""
    parts = [_read_span(part) for part in tokens[0].value.split(",")]
    spread = [[part] if isinstance(part, int) else part for part in parts]
    return tuple(seed for some in spread for seed in some)


def _task(_kind: object, tokens: Sequence[Token]) -> tuple[int, int]:
    """I/N with 1 <= I <= N."""
    text = tokens[0].value
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise ValueError(f"expected I/N with 1 <= I <= N, found {text!r}")
    return int(number), int(count)


@Parameter(name="*")
@dataclass(frozen=True)
class SweepLists:
    """What a sweep runs through, besides models and values of the scene."""

    zip_: Annotated[
        bool,
        Parameter(name="--zip", negative="", help="Take the lists in pairs, not their product."),
    ] = False
    seeds: Annotated[
        tuple[int, ...] | None,
        Parameter(converter=_seeds, n_tokens=1, help="a,b,c or A:B (B is not one of them)."),
    ] = None
    realisations: Annotated[
        int | range | None,
        Parameter(
            converter=_span,
            help="A:B or A:B:SIZE splits those of one large run among points, SIZE a point.",
        ),
    ] = None

    def table(self) -> dict[str, object]:
        """The entries of sweep.toml; None for what was left out."""
        split = self.realisations
        if isinstance(split, int):
            split = range(0, split, split)
        return {
            "zipped": self.zip_ or None,
            "seeds": self.seeds,
            "realisations": None if split is None else (split.start, split.stop, split.step),
        }


@Parameter(name="*")
@dataclass(frozen=True)
class SweepPlace:
    """Where a sweep runs and what it keeps."""

    workers: Annotated[
        int | None,
        Parameter(converter=_whole, help="Processes of this machine; all cores if left out."),
    ] = None
    scheduler: Annotated[
        str | None, Parameter(help="Run on a Dask cluster: its scheduler, as in tcp://host:8786.")
    ] = None
    task: Annotated[
        tuple[int, int] | None,
        Parameter(
            converter=_task, n_tokens=1, help="I/N: run the share of task I of a batch queue."
        ),
    ] = None
    out: Annotated[Path | None, Parameter(help="Folder of the sweep.")] = None
    resume: Annotated[
        bool, Parameter(negative="", help="Go on with the sweep in --out; repeat what has failed.")
    ] = False
    collect: Annotated[
        bool, Parameter(negative="", help="Run nothing: put together what is in --out.")
    ] = False

    @contextmanager
    def folder(self, name: str) -> Iterator[Path]:
        """As `Output.folder`."""
        with Output(self.out).folder(name) as folder:
            yield folder

    def check(self) -> None:
        """Refuse options that do not go together."""
        named = [k for k in ("workers", "scheduler", "task") if getattr(self, k) is not None]
        named += ["collect"] if self.collect else []
        if len(named) > 1:
            found = " and ".join(f"--{name}" for name in named)
            raise InputError("sweep", "one place to run", found, "Leave out the others.")
        if self.out is None and (self.resume or self.collect or self.task):
            option = "--task" if self.task else "--collect" if self.collect else "--resume"
            raise InputError(option, "--out with the sweep's folder", "none", "Add --out.")


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

    def table(self) -> dict[str, object]:
        """The entries of sweep.toml; None for what was left out."""
        path = None if self.flow is None else str(self.flow.absolute())
        return {"flow": path, "allow_misfit": self.allow_misfit or None}

    def of_earlier_run(self, name: str | None, scene: Scene) -> FlowField | None:
        """The flow of the run.toml that is called `name`; None for another scene, or with --flow."""
        from ellipsoid_coupling.flow import FlowField

        found = None if name is None else self.wanted(name, scene)
        return found if isinstance(found, FlowField) else None

    def wanted(self, name: str, scene: Scene) -> Wanted | FlowField:
        """The flow of --flow; without it, for the run.toml of an earlier run, that run's own flow."""
        from ellipsoid_coupling.storage.run_flow import repeated_flow

        before = repeated_flow(name, scene) if self.flow is None and not self.solve else None
        return before or self.given()

    def given(self) -> Wanted:
        """The flow of --flow."""
        from ellipsoid_coupling.flow import Wanted

        return Wanted(self.flow, self.allow_misfit, self.solve)


def chosen_scene(name: str, settings: list[str] | None) -> Scene:
    """The scene of that name, or of that file, with the user's settings, "key=value" each."""
    from ellipsoid_coupling.scenes import load_scene, parse_setting

    if settings == []:
        raise InputError("--set", "key=value", "nothing", "Example: --set particles.number=100.")
    return load_scene(name, dict(parse_setting(text) for text in settings or []))


def print_lines(*lines: str) -> None:
    """Lines on standard output, without what a terminal would obey."""
    for line in lines:
        sys.stdout.write(shown(line) + "\n")


@Parameter(name="*")
@dataclass(frozen=True)
class NewParticles:
    """What is known of the particles of a new scene."""

    length: Annotated[
        float | None,
        Parameter(help="In the units of the case; a 50th of its shorter side if left out."),
    ] = None
    width: Annotated[float | None, Parameter(help="Half the length if left out.")] = None
    density: Annotated[float, Parameter(help="The particles', in units of the fluid's.")] = 2.0
