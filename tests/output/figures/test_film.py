"""Films: their frames, what the frames show, and what is refused."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField, FlowSeries
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures import film
from ellipsoid_coupling.output.figures.film import draw_film, find_ffmpeg
from ellipsoid_coupling.result import Result

FFMPEG = find_ffmpeg()


def frames(path: Path) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    """The frames of a GIF, (height, width, 3) each."""
    with Image.open(path) as image:
        pictures = []
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            pictures.append(np.asarray(image.convert("RGB")))
        return pictures


@pytest.mark.parametrize("layout", ["particle", "rho", "q"])
def test_a_frame_a_saved_time(
    layout: str, request: pytest.FixtureRequest, lid_flow: FlowField, tmp_path: Path
) -> None:
    """All of one size, none of one colour, no two alike."""
    result: Result = request.getfixturevalue(f"{layout}_result")
    told: list[float] = []
    count = draw_film(
        result, tmp_path / "f.gif", flow=lid_flow, report=lambda _stage, part: told.append(part)
    )
    pictures = frames(tmp_path / "f.gif")
    assert count == len(pictures) == result.times.size
    assert told == [0.5, 1.0]
    sizes = {picture.shape for picture in pictures}
    assert len(sizes) == 1
    height, width, _ = sizes.pop()
    assert width == (600 if layout == "particle" else 900)
    assert 300 < height < 700
    assert all(picture.std() > 10.0 for picture in pictures)
    assert (pictures[0] != pictures[1]).any()


def test_ellipses_stand_where_the_particles_are(particle_result: Result) -> None:
    """The middle of each outline is a particle of the first realisation; to rounding."""
    shown = film._ParticleFilm(particle_result, None)
    for k in range(2):
        shown.show(k)
        outlines = [np.asarray(path.vertices)[:-1] for path in shown._inside.get_paths()]
        middles = np.array([outline.mean(axis=0) for outline in outlines])
        places = np.stack([particle_result.variables[name][k, 0] for name in "xy"], axis=1)
        np.testing.assert_allclose(middles, places, atol=1e-12)
    assert "t = 0.333" in shown._axes.get_title()


def test_who_has_left_is_an_outline_and_who_has_not_come_is_nothing(
    particle_result: Result,
) -> None:
    fate: Any = np.zeros((2, 3, 30), np.int32)  # the one variable of whole numbers
    fate[0, 0, :10], fate[0, 0, 10:14] = -1, 1
    variables = particle_result.variables | {"fate": fate}
    shown = film._ParticleFilm(replace(particle_result, variables=variables), None)
    shown.show(0)
    assert len(shown._inside.get_paths()) == 16
    assert len(shown._left.get_paths()) == 4
    shown.show(1)
    assert len(shown._inside.get_paths()) == 30


def test_cells_show_their_mean_axis(q_result: Result, rho_result: Result) -> None:
    """Half at 330 degrees and half at 0: -15 degrees, modulo half a turn; to rounding."""

    def axes_shown(result: Result, k: int) -> np.ma.MaskedArray[Any, Any]:
        shown = film._GridFilm(result, None)
        shown.show(k)
        return np.ma.asarray(shown._images[1].get_array())

    axis, there = axes_shown(q_result, 0), q_result.cell_density()[0] > 0.0
    np.testing.assert_array_equal(np.ma.getmaskarray(axis), ~there)
    np.testing.assert_allclose(axis[there], np.deg2rad(-15.0), atol=1e-12)
    axis = axes_shown(rho_result, 1)
    there = rho_result.variables["density"][1] > 0.0
    told = rho_result.variables["mean_angle"][1][there]
    np.testing.assert_allclose(np.exp(2j * axis[there]), np.exp(2j * told), atol=1e-12)


def test_ellipses_have_the_colours_of_their_axes(particle_result: Result) -> None:
    """As in `draw_ellipses`; to rounding."""
    shown = film._ParticleFilm(particle_result, None)
    for k in range(2):
        shown.show(k)
        faces = np.asarray(shown._inside.get_facecolor())[:, :3]
        angle = particle_result.variables["angle"][k, 0]
        np.testing.assert_allclose(faces, axis_colours(angle), atol=1e-9)


def test_the_flow_is_drawn_anew_only_where_it_changes(
    particle_result: Result, lid_flow: FlowField
) -> None:
    shown = film._ParticleFilm(particle_result, lid_flow)
    shown.show(0)
    first = shown._arrows
    shown.show(1)
    assert shown._arrows is first
    # One that turns round between the two times.
    back = replace(
        lid_flow, arrays=lid_flow.arrays._replace(coefficients=-lid_flow.arrays.coefficients)
    )
    series = FlowSeries.of_fields(particle_result.times, (lid_flow, back))
    shown = film._ParticleFilm(particle_result, series)
    shown.show(0)
    first = shown._arrows
    shown.show(1)
    assert first is not None
    assert shown._arrows is not None
    before, after = np.asarray(first.U, np.float64), np.asarray(shown._arrows.U, np.float64)
    np.testing.assert_allclose(after, -before, atol=1e-12)
    assert np.abs(before).max() > 0.0
    assert first not in shown._axes.collections


@pytest.mark.skipif(FFMPEG is None, reason="no ffmpeg")
def test_an_mp4_has_a_frame_a_saved_time(rho_result: Result, tmp_path: Path) -> None:
    assert FFMPEG is not None
    path = tmp_path / "f.mp4"
    assert draw_film(rho_result, path, frames_per_second=2.0) == 2
    command = [FFMPEG, "-i", str(path), "-f", "null", "-"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert re.findall(r"frame= *(\d+)", said)[-1] == "2"
    width, height = map(int, re.findall(r", (\d+)x(\d+)", said)[0])
    assert (width % 2, height % 2) == (0, 0)
    assert width == 900
    assert "yuv420p" in said


def test_an_ffmpeg_that_fails_is_told_in_one_message(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\ncat >/dev/null\necho Unknown encoder >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(film, "find_ffmpeg", lambda: str(program))
    with pytest.raises(RunError, match=r"Unknown encoder\. Take --out .*f\.gif"):
        draw_film(rho_result, tmp_path / "f.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_what_makes_no_film_is_refused(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "find_ffmpeg", lambda: None)
    with pytest.raises(InputError, match="expected an ffmpeg"):
        draw_film(rho_result, tmp_path / "f.mp4")
    with pytest.raises(InputError, match="ends in"):
        draw_film(rho_result, tmp_path / "f.avi")
    monkeypatch.setattr(film, "MOST_GIF_FRAMES", 1)
    with pytest.raises(InputError, match="at most 1 saved times"):
        draw_film(rho_result, tmp_path / "f.gif")
    variables = {name: values[:0] for name, values in rho_result.variables.items()}
    empty = replace(rho_result, times=np.empty(0), variables=variables)
    with pytest.raises(InputError, match="saved time"):
        draw_film(empty, tmp_path / "f.gif")
    assert not list(tmp_path.iterdir())
