"""Small results of every layout, made of plain arrays, and a flow with a moving lid."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.flow import FlowField, WallVelocity
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, load_scene

TIMES = (0.1, 1.0 / 3.0)
NX, NY = 8, 6


def small_scene(name: str = "cavity") -> Scene:
    """Cells of 1/8; the domain is 1 wide and 3/4 high, so that x and y cannot be mixed up."""
    settings = {
        "times": list(TIMES),
        "domain.y": [0.0, 0.75],
        "numerics.cell": 0.125,
        "particles.number": 30,
    }
    return load_scene(name, settings)


def lopsided_density() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(T, ny, nx), different in x and y and time; cell [1, 6] of time 0 holds 7."""
    density = np.zeros((2, NY, NX))
    density[0, 1, 6] = 7.0
    density[0, 4, 2:5] = 3.0
    density[1, 2:, :3] = 1.5
    return density


@pytest.fixture
def scene() -> Scene:
    return small_scene()


@pytest.fixture
def particle_result(scene: Scene) -> Result:
    rng = np.random.default_rng(1)
    shape = (2, 3, 30)
    names = ("angle", "velocity_x", "velocity_y", "angular_velocity")
    variables = {"x": rng.uniform(0.2, 0.9, shape), "y": rng.uniform(0.1, 0.5, shape)}
    variables |= {name: rng.normal(size=shape) for name in names}
    attributes = {"status": "completed", "seed": 0, "resolution": "30 x 3 particles"}
    times = np.array(TIMES)
    return Result(scene, "microscopic", "accurate", "particles", times, variables, {}, attributes)


@pytest.fixture
def rho_result(scene: Scene) -> Result:
    rng = np.random.default_rng(2)
    names = ("mean_angle", "velocity_x", "velocity_y", "angular_velocity")
    variables = {name: rng.normal(size=(2, NY, NX)) for name in names}
    variables["density"] = lopsided_density()
    coordinates = {"y": (np.arange(NY) + 0.5) / 8, "x": (np.arange(NX) + 0.5) / 8}
    attributes = {"status": "completed", "seed": 0, "resolution": "h = 0.125"}
    times = np.array(TIMES)
    return Result(
        scene, "rho_mono_kinetic", "accurate", "rho", times, variables, coordinates, attributes
    )


@pytest.fixture
def q_result(scene: Scene) -> Result:
    """Twelve angles; all of a cell's mass at 330 and 0 degrees in equal parts."""
    density = np.zeros((2, 12, NY, NX))
    density[:, [11, 0]] = lopsided_density()[:, None]
    velocity = np.zeros_like(density)
    velocity[:, 11], velocity[:, 0] = 1.0, 3.0
    names = ("velocity_x", "velocity_y", "angular_velocity")
    variables = {"density": density} | dict.fromkeys(names, velocity)
    coordinates = {"angle": np.arange(12) * np.pi / 6}
    attributes = {"status": "completed", "seed": 0, "resolution": "h = 0.125, 12 angles"}
    times = np.array(TIMES)
    return Result(
        scene, "q_mono_kinetic", "accurate", "q", times, variables, coordinates, attributes
    )


@pytest.fixture
def lid_flow() -> FlowField:
    """A lid that moves with sin(pi x)^2 over a box of 1 x 0.75."""
    x, y = np.linspace(0.0, 1.0, 17), np.linspace(0.0, 0.75, 13)
    along, up = np.sin(np.pi * x) ** 2, y / 0.75
    psi = np.outer(0.75 * up**2 * (up - 1.0), along)
    walls = WallVelocity(bottom=np.zeros(17), top=along, left=np.zeros(13), right=np.zeros(13))
    return FlowField.from_stream_function(psi, x, y, "made for a test", walls)


@pytest.fixture
def png_size() -> Callable[[Path], tuple[int, int]]:
    return read_png_size


def read_png_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels, from the header."""
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", head[16:])
    return width, height
