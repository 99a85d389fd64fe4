"""`ellipsoid movie`: a finished run as a film."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.options import print_lines
from ellipsoid_coupling.output.progress import ProgressReporter

# Frames a second, where the user says nothing: the film takes about ten seconds, within these bounds.
_LENGTH, _SLOWEST, _FASTEST = 10.0, 2.0, 25.0
# GIF counts in hundredths of a second, and shows no more than fifty frames in one.
_LEAST, _MOST = 0.05, 50.0


def movie(
    run: Path,
    /,
    *,
    out: Path | None = None,
    fps: float | None = None,
    seconds: float | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make a film of a finished run: particles to scale over the flow, or fields of density and angle.

    It has one frame for each saved time. For more of them run with more: times = [...] in the scene, or
    --set times=[...].

    Parameters
    ----------
    run
        A finished run folder.
    out
        The file, .mp4 (needs ffmpeg) or .gif; if left out, movie.mp4 or, without ffmpeg, movie.gif in the
        run folder.
    fps
        Frames a second, 0.05 to 50; if left out, as many as make ten seconds, but 2 to 25.
    seconds
        How long the film takes; instead of --fps.
    force
        Overwrite the file.
    """
    from ellipsoid_coupling.output.figures.film import GIF, MP4, draw_film, find_ffmpeg
    from ellipsoid_coupling.output.new_scene import require_new
    from ellipsoid_coupling.storage.run_flow import load_runs

    _check(fps, seconds)
    with ProgressReporter("movie") as report:
        (result,), (flow,) = load_runs([run])
        ending = MP4 if find_ffmpeg() is not None else GIF
        path = out or (run if run.is_dir() else run.parent) / f"movie{ending}"
        require_new(path, force=force)
        speed = frames_per_second(result.times.size, fps, seconds)
        count = draw_film(result, path, flow=flow, frames_per_second=speed, report=report)
    print_lines(
        f"{count} frames, {count / speed:.3g} s. More saved times make more of them: "
        "ellipsoid run SCENE --set times=[...]",
        str(path),
    )


def _check(fps: float | None, seconds: float | None) -> None:
    """Refuse numbers that make no film."""
    if fps is not None and seconds is not None:
        raise InputError("movie", "--fps or --seconds", "both", "Leave one out.")
    if fps is not None and not _LEAST <= fps <= _MOST:
        raise InputError(
            "--fps", f"a number from {_LEAST:g} to {_MOST:g}", f"{fps:g}", "Change it."
        )
    if seconds is not None and not 0.0 < seconds < math.inf:
        raise InputError("--seconds", "finite seconds above 0", f"{seconds:g}", "Change it.")


def frames_per_second(count: int, fps: float | None, seconds: float | None) -> float:
    """How fast a film of `count` frames runs.

    Raises
    ------
    InputError
        If `seconds` is too short, or too long, for that many frames.
    """
    if fps is not None:
        return fps
    if seconds is None:
        return min(_FASTEST, max(_SLOWEST, count / _LENGTH))
    if count and not _LEAST <= count / seconds <= _MOST:
        expected = f"{count / _MOST:.3g} to {count / _LEAST:.3g} s for {count} frames"
        raise InputError("--seconds", expected, f"{seconds:g}", "Change it.")
    return max(count / seconds, _LEAST)
