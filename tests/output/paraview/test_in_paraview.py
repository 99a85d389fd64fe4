"""An export opened by ParaView itself, where `pvbatch` is installed: what is there, and what is seen."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.paraview import export
from ellipsoid_coupling.result import Result

PVBATCH, XVFB = shutil.which("pvbatch"), shutil.which("Xvfb")
# Of a run that hangs; it takes four seconds of a quiet core.
SECONDS = 300
SIZE = (600, 500)

pytestmark = pytest.mark.skipif(PVBATCH is None or XVFB is None, reason="no pvbatch or no Xvfb")

# Opens a folder's script, and tells what it has made: script, picture, report, width, height.
DRIVER = """
import json, runpy, sys
from paraview import simple

script, picture, report = sys.argv[1:4]
size = [int(part) for part in sys.argv[4:6]]
runpy.run_path(script, run_name="__main__")
view = simple.GetActiveView()
view.ViewSize = size
simple.SaveScreenshot(picture, view, ImageResolution=size)
shown = [d.Input for d in view.Representations if hasattr(d, "Input") and d.Visibility]
sources = {}
for (name, _), source in simple.GetSources().items():
    source.UpdatePipeline(view.ViewTime)
    told = source.GetDataInformation()
    sources[name] = {
        "bounds": told.GetBounds(),
        "cells": told.GetNumberOfCells(),
        "shown": any(source == one for one in shown),
    }
told = {
    "sources": sources,
    "times": list(simple.GetTimeKeeper().TimestepValues),
    "time": view.ViewTime,
    "flat": bool(view.CameraParallelProjection),
    "middle": list(view.CameraFocalPoint),
    "half": view.CameraParallelScale,
}
with open(report, "w") as file:
    json.dump(told, file)
"""


@contextmanager
def screen() -> Iterator[dict[str, str]]:
    """The environment of a screen that nobody sees, without network."""
    assert XVFB is not None
    read, write = os.pipe()
    command = [XVFB, "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    # Nor does it start anew when ParaView closes its first window.
    command.append("-noreset")
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        try:
            # It names its number when it is ready.
            with os.fdopen(read) as told:
                yield os.environ | {"DISPLAY": f":{told.readline().strip()}"}
        finally:
            server.terminate()


def opened(folder: Path) -> tuple[dict[str, Any], np.ndarray[Any, np.dtype[np.float64]]]:
    """What ParaView tells of the folder's script, and the picture, colours from 0 to 1."""
    driver, picture, report = (folder / name for name in ("driver.py", "seen.png", "told.json"))
    driver.write_text(DRIVER)
    assert PVBATCH is not None
    given = [driver, folder / "open_in_paraview.py", picture, report, *SIZE]
    with screen() as environment:
        done = subprocess.run(
            [PVBATCH, *map(str, given)],
            capture_output=True, text=True, timeout=SECONDS, check=False, env=environment,
        )  # fmt: skip
    told = done.stdout + done.stderr
    assert done.returncode == 0, told
    assert "rror" not in told, told
    assert "arn" not in told, told
    with Image.open(picture) as image:
        seen = np.asarray(image.convert("RGB"), np.float64) / 255.0
    return json.loads(report.read_text()), seen


def test_particles_are_ellipses_to_scale_in_the_colours_of_their_axes(
    particle_result: Result, lid_flow: FlowField, tmp_path: Path
) -> None:
    """At the last time. Chords of 11 degrees lie within 0.5 % of the ellipse; colours have some shade."""
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.0, 0.75]])
    flow = FlowField(lid_flow.arrays, "walled", polygon_outline([("walls", "wall", box, True)]))
    told, seen = opened(export(particle_result, tmp_path / "paraview", flow))
    assert told["times"] == pytest.approx(list(particle_result.times))
    assert told["time"] == pytest.approx(particle_result.times[-1])
    x, y, angle = (particle_result.variables[name][-1, 0] for name in ("x", "y", "angle"))
    particles = particle_result.scene.particles
    along, across = 0.5 * particles.length, 0.5 * particles.width
    half_x = np.hypot(along * np.cos(angle), across * np.sin(angle))
    half_y = np.hypot(along * np.sin(angle), across * np.cos(angle))
    wanted = [min(x - half_x), max(x + half_x), min(y - half_y), max(y + half_y)]
    sources = told["sources"]
    bounds = sources["particles as ellipses"]["bounds"]
    np.testing.assert_allclose(bounds[:4], wanted, atol=0.006 * along)
    assert sources["walls"]["bounds"][:4] == pytest.approx([0.0, 1.0, 0.0, 0.75])
    shown = {name for name, source in sources.items() if source["shown"]}
    assert shown >= {"flow", "walls", "ghost ellipses", "particles as ellipses"}
    assert not shown & {"particles", "histogram", "flow_ghost_particles"}
    # Seen straight from above: layers above each other do not shift.
    assert told["flat"]
    pixel = 2.0 * told["half"] / SIZE[1]
    column = np.floor(0.5 * SIZE[0] + (x - told["middle"][0]) / pixel).astype(int)
    row = np.floor(0.5 * SIZE[1] - (y - told["middle"][1]) / pixel).astype(int)
    alone = [np.sort(np.hypot(x - x[k], y - y[k]))[1] > particles.length for k in range(x.size)]
    assert sum(alone) > 10
    found = seen[row[alone], column[alone]]
    np.testing.assert_allclose(found, axis_colours(angle[alone]), atol=0.1)


def test_fields_have_lines_along_their_mean_axes(rho_result: Result, tmp_path: Path) -> None:
    """Below one line a filled cell, within the domain."""
    told, _ = opened(export(rho_result, tmp_path / "paraview"))
    sources = told["sources"]
    shown = {name for name, source in sources.items() if source["shown"]}
    assert shown >= {"fields", "mean axes"}
    assert 0 < sources["mean axes"]["cells"] <= rho_result.cell_density()[-1].size
    assert sources["fields"]["bounds"][:4] == pytest.approx([0.0, 1.0, 0.0, 0.75])
