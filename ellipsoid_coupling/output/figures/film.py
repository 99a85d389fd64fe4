"""A film of a result, a frame a saved time: ellipses over the flow, or fields of density and angle."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from subprocess import CalledProcessError
from typing import Protocol, cast

import numpy as np
from matplotlib import rcParams
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.collections import PolyCollection
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.quiver import Quiver
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.files.limits import MOST_GIF_FRAMES
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.orientation import as_axis, mean_axis
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures.angle_bar import add_angle_bar
from ellipsoid_coupling.output.figures.canvas import (
    Extent,
    new_figure,
    settings,
    show_domain,
    show_multiples_of_pi,
    time_title,
    wrapped,
)
from ellipsoid_coupling.output.figures.density import common_maximum
from ellipsoid_coupling.output.figures.ellipses import (
    come_by_the_end,
    enlarged,
    enlargement,
    thinned,
)
from ellipsoid_coupling.output.figures.flow import add_arrows
from ellipsoid_coupling.output.figures.style import DENSITY_COLOURS, axis_map
from ellipsoid_coupling.output.figures.walls import add_walls
from ellipsoid_coupling.output.labels import literal, model_name
from ellipsoid_coupling.output.orientation import axis_moment
from ellipsoid_coupling.output.outlines import drawn_outline, ellipse_outlines
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]
Report = Callable[[str, float], None]

MP4, GIF = ".mp4", ".gif"
# Inch; the height goes with the domain.
_WIDTH, _GRID_WIDTH = 6.0, 9.0
_DOTS_PER_INCH = 100
# More ellipses are a blot, and take a second a frame.
MOST_PARTICLES = 2000
_ARROWS = 20
# Thin density beside the dense part of the start: colours go with its root.
_POWER = 0.5
# Of the largest density: the angle of less is not shown.
_LEAST_DENSITY = 1e-3


class _Film(Protocol):
    """A figure, and how it comes to show a saved time."""

    figure: Figure

    def show(self, k: int) -> None:
        """Show saved time number k."""


def find_ffmpeg() -> str | None:
    """The ffmpeg on the path, else that of the package imageio-ffmpeg where it is installed."""
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        program: str = import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except (ImportError, RuntimeError):  # not installed, or without a program for this machine
        return None
    return program


def draw_film(
    result: Result,
    path: Path,
    *,
    flow: FlowField | None = None,
    frames_per_second: float = 10.0,
    report: Report | None = None,
) -> int:
    """Write a film, a frame a saved time, and return how many frames it has.

    Particles are ellipses to scale in the colours of their axes, over the flow and its walls, those of the
    first realisation; outlines stand where particles have left the flow. Of grids one panel shows the
    density, with one scale of colours for all times, and one the mean axis, in its colour.

    Parameters
    ----------
    result : with a saved time
    path : .mp4, for which an ffmpeg is needed, or .gif
    flow : that of the run; without it there are no arrows, and the sides of the domain are drawn
    frames_per_second : above 0
    report : called with the stage and its finished part

    Raises
    ------
    InputError
        For a result without saved times, another ending, no ffmpeg, or too many frames for a GIF.
    RunError
        If ffmpeg fails.
    WriteError
        If the file cannot be written; an older one stays.
    """
    count = result.times.size
    if not count:
        raise InputError("film", "a result with a saved time", "none", "Run it again.")
    with settings():
        writer = _writer(path, frames_per_second, count)
        with whole_file(path) as beside:
            _write(_film(result, flow), writer, path, beside, count, report)
    return count


def _write(
    film: _Film,
    writer: AbstractMovieWriter,
    path: Path,
    beside: Path,
    count: int,
    report: Report | None,
) -> None:
    """Write the frames to `beside`, which becomes `path`."""
    film.show(0)
    # Laid out once, so that nothing moves from frame to frame but what the film shows.
    film.figure.draw_without_rendering()
    film.figure.set_layout_engine("none")
    try:
        with writer.saving(film.figure, str(beside), _DOTS_PER_INCH):
            for k in range(count):
                film.show(k)
                writer.grab_frame()
                if report is not None:
                    report("film", (k + 1) / count)
    except CalledProcessError as error:
        said = str(error.stderr or "no reason given").strip().splitlines()[-1:]
        raise RunError(
            f"ffmpeg could not make {path}: {' '.join(said)}. Take --out "
            f"{path.with_suffix(GIF)}, which needs no ffmpeg."
        ) from None


def _writer(path: Path, frames_per_second: float, count: int) -> AbstractMovieWriter:
    """What writes a file of this ending; called within `settings`."""
    # Matplotlib's types say whole numbers; both writers take any.
    fps = cast("int", frames_per_second)
    if path.suffix == GIF:
        if count > MOST_GIF_FRAMES:
            remedy = f"Name a file that ends in {MP4}, which needs ffmpeg."
            expected = f"at most {MOST_GIF_FRAMES} saved times for a GIF"
            raise InputError(str(path), expected, str(count), remedy)
        return PillowWriter(fps=fps)
    if path.suffix != MP4:
        found = path.suffix or "no ending"
        raise InputError(str(path), f"a name that ends in {MP4} or {GIF}", found, "Change it.")
    program = find_ffmpeg()
    if program is None:
        raise InputError(
            str(path), f"an ffmpeg for {MP4}", "none",
            f"Install it (apt-get install ffmpeg, or pip install imageio-ffmpeg), or take {GIF}.",
        )  # fmt: skip
    rcParams["animation.ffmpeg_path"] = program  # back at the end of `settings`
    return FFMpegWriter(fps=fps, codec="h264")


def _film(result: Result, flow: FlowField | None) -> _Film:
    return (_ParticleFilm if result.layout == "particles" else _GridFilm)(result, flow)


def _extent(result: Result) -> Extent:
    return (*result.scene.domain.x, *result.scene.domain.y)


def _height(result: Result, panel: float, around: float) -> float:
    """Of a figure whose panel has this width, in inch: the panel's, and of what stands around it."""
    domain = result.scene.domain
    return panel * min(2.0, max(0.25, domain.height / domain.width)) + around


class _ParticleFilm:
    """Ellipses of the first realisation."""

    def __init__(self, result: Result, flow: FlowField | None) -> None:
        self._result, self._flow = result, flow
        self.figure = new_figure(_WIDTH, _height(result, _WIDTH - 1.6, 1.2), layout="compressed")
        self._axes = self.figure.add_subplot()
        show_domain(self._axes, _extent(result))
        self._axes.set(xlabel="x", ylabel="y")
        come = come_by_the_end(result, 0)
        self._chosen = come[thinned(come.size, MOST_PARTICLES)]
        part = f"{self._chosen.size} of " if self._chosen.size < come.size else ""
        title = result.scene.title or result.scene.name
        particles = result.scene.particles
        times = enlargement(particles.length, _extent(result), _WIDTH - 1.0)
        self._size = times * particles.length, times * particles.width
        told = f"{part}{come.size} particles{enlarged(times)}"
        self._title = f"{title}\n{model_name(result.model)}, {told}"
        self._inside = PolyCollection([], edgecolors="black", linewidths=0.3, alpha=0.8)
        self._left = PolyCollection([], facecolors="none", edgecolors="0.4", linewidths=0.6)
        for ellipses in (self._inside, self._left):
            self._axes.add_collection(ellipses, autolim=False)
        self._arrows: Quiver | None = None
        self._shown: FlowField | None = None
        add_walls(self._axes, drawn_outline(result.scene, flow), _extent(result))
        add_angle_bar(self.figure, [self._axes])

    def show(self, k: int) -> None:
        result = self._result
        time = float(result.times[k])
        none = np.zeros(result.variables["x"].shape[2], np.bool_)
        gone, unborn = (
            none if flags is None else flags[k, 0] for flags in (result.frozen, result.unborn)
        )
        inside, left = (self._chosen[flags[self._chosen]] for flags in (~gone, gone & ~unborn))
        self._inside.set_verts(self._outlines(k, inside))
        angle = as_axis(result.variables["angle"][k, 0][inside])
        self._inside.set(facecolor=axis_colours(angle))
        self._left.set_verts(self._outlines(k, left))
        self._show_flow(time)
        self._axes.set_title(f"{wrapped(self.figure, self._title)}\n{time_title(time)}")

    def _outlines(self, k: int, chosen: NDArray[np.int64]) -> list[Floats]:
        x, y, angle = (self._result.variables[name][k, 0][chosen] for name in ("x", "y", "angle"))
        return list(ellipse_outlines(x, y, angle, self._size))

    def _show_flow(self, time: float) -> None:
        """Arrows of the flow at that time, drawn anew only where it changes."""
        if self._flow is None:
            return
        now = self._flow.at(time)
        if now is self._shown:
            return
        if self._arrows is not None:
            self._arrows.remove()
        extent = _extent(self._result)
        self._arrows = add_arrows(self._axes, now, extent, colour="0.8", count=_ARROWS)
        self._shown = now


class _GridFilm:
    """The density, and the mean axis where there is mass."""

    def __init__(self, result: Result, flow: FlowField | None) -> None:
        self._result, self._density = result, result.cell_density()
        panel = (_GRID_WIDTH - 2.0) / 2.0
        self.figure = new_figure(_GRID_WIDTH, _height(result, panel, 1.7), layout="compressed")
        engine = self.figure.get_layout_engine()
        if isinstance(engine, ConstrainedLayoutEngine):
            engine.set(wspace=0.06)  # the numbers below one panel keep clear of the other's
        extent = _extent(result)
        panels = self.figure.subplots(1, 2, sharey=True)
        top = common_maximum(list(self._density))
        empty = np.zeros(self._density.shape[1:])
        looks = (
            {"cmap": DENSITY_COLOURS, "norm": PowerNorm(_POWER, vmin=0.0, vmax=top)},
            {"cmap": axis_map(), "vmin": -0.5 * np.pi, "vmax": 0.5 * np.pi},
        )
        labels = ("density", "mean axis in rad, modulo $\\pi$")
        self._images = []
        for axes, look, label in zip(panels, looks, labels, strict=True):
            show_domain(axes, extent)
            image = axes.imshow(
                empty, origin="lower", extent=extent, interpolation="nearest", **look
            )
            add_walls(axes, drawn_outline(result.scene, flow), extent)
            axes.set(xlabel="x", title=label)
            beyond = label == "density" and self._density.max() > top
            bar = self.figure.colorbar(
                image,
                ax=axes,
                location="bottom",
                aspect=30,
                extend="max" if beyond else "neither",
                ticks=MaxNLocator(4),
            )
            self._images.append(image)
        show_multiples_of_pi(bar.ax.xaxis, 0.25)
        panels[1].set_facecolor("0.95")
        panels[0].set_ylabel("y")
        self._title = f"{result.scene.title or result.scene.name}\n{model_name(result.model)}"

    def show(self, k: int) -> None:
        density = self._density[k]
        axis = mean_axis(axis_moment(self._result, k, (density.shape[0], density.shape[1])))
        thin = density <= _LEAST_DENSITY * density.max()
        self._images[0].set_data(density)
        self._images[1].set_data(np.ma.masked_array(axis, thin))
        time = time_title(float(self._result.times[k]))
        self.figure.suptitle(f"{wrapped(self.figure, self._title)}, {literal(time)}")
