"""Open the files of this folder in ParaView (5.7 or later): flow, walls, ellipses, fields, in time.

    paraview --script=open_in_paraview.py          or File > Load State ... and this file

Written by ``ellipsoid export`` beside the files that it opens; what is not there is left out. Densities of
particles are opened as well, but not shown: click on the eye beside histogram.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

# Where the files are if ParaView does not tell where this script is; filled in by the export, as the next.
FOLDER = "."
# Length of the lines that show mean axes where S is 1, in units of the scene.
LINE = 0.1
# The density at which colours end.
DENSITY = 1.0
# Colours of axes: angle in radian, red, green, blue, and so on.
AXIS_COLOURS = [-1.5707963267948966, 1.0, 0.5, 0.0, 1.5707963267948966, 1.0, 0.5, 0.0]
# Towards the eye, and up for it: across the plane of the files, and along its second axis.
NORMAL = [0.0, 0.0, 1.0]
UP = [0.0, 1.0, 0.0]
# From nothing to the largest speed and the largest density; the latter from clear to dense.
SPEED_COLOURS = [0.0, 1.0, 1.0, 1.0, 1.0, 0.6, 0.75, 0.95]
DENSITY_COLOURS = [0.0, 0.9, 0.9, 0.9, DENSITY, 0.45, 0.45, 0.45]
DENSITY_OPACITY = [0.0, 0.0, 0.5, 0.0, 0.05 * DENSITY, 0.5, 0.5, 0.0, DENSITY, 1.0, 0.5, 0.0]
# So many lines at most, and none where the density is below this part.
LINES, THIN = 1500, 0.02
GREY, BLACK = [0.6, 0.6, 0.6], [0.0, 0.0, 0.0]
TITLES = {"angle": "angle of the axis, rad", "density": "density", "speed": "speed of the fluid"}
# Lower ends of the bars that explain colours, in parts of the window.
BARS = {"angle": 0.7, "density": 0.38, "speed": 0.06}

# Layers above each other, in lengths of a line, so that none hides what lies below it in the plane.
FLOW, FIELDS, AXES, GHOSTS, ELLIPSES, WALLS = -2.0, -1.0, 0.5, 1.0, 2.0, 4.0


def path_of(name: str) -> str | None:
    """The series or the file of that name; None without either."""
    # ParaView does not always tell a script where it is.
    told = globals().get("__file__")
    folders = [Path(told).absolute().parent] if told else []
    paths = [f / f"{name}.{end}" for f in (*folders, Path(FOLDER)) for end in ("pvd", "vti", "vtp")]
    return next((str(path) for path in paths if path.exists()), None)


def opened(name: str) -> Any | None:
    """The reader of a file of this folder, or None."""
    from paraview import simple

    path = path_of(name)
    if path is None:
        return None
    source: Any = simple.OpenDataFile(path)
    simple.RenameSource(name, source)
    return source


def show(source: Any, layer: float, colour: list[float] | None = None, shade: float = 0.0) -> Any:
    """Show a source in a layer, in one colour if one is given; returns its display.

    shade : the part of its light that comes from a lamp
    """
    from paraview import simple

    display = simple.Show(source, simple.GetActiveViewOrCreate("RenderView"))
    # Plane images are shown as slices otherwise, which have one place for all layers.
    display.Representation = "Surface"
    display.Position = [layer * LINE * part for part in NORMAL]
    # Colours as they are; on spheres a little shade, which tells one from the other.
    display.Ambient, display.Diffuse = (1.0 - shade), shade
    if colour is not None:
        simple.ColorBy(display, None)
        display.AmbientColor = display.DiffuseColor = colour
    return display


def colour_by(display: Any, where: str, array: str) -> None:
    """Colour a display by an array of its POINTS or CELLS, and explain the colours beside it."""
    from paraview import simple

    view = simple.GetActiveViewOrCreate("RenderView")
    simple.ColorBy(display, (where, array))
    table = simple.GetColorTransferFunction(array)
    table.AutomaticRescaleRangeMode = "Never"
    table.ColorSpace = "RGB"
    if array == "angle":
        table.RGBPoints = AXIS_COLOURS
    elif array == "density":
        table.RGBPoints = DENSITY_COLOURS
        table.EnableOpacityMapping = 1
        simple.GetOpacityTransferFunction(array).Points = DENSITY_OPACITY
    else:
        table.RGBPoints = SPEED_COLOURS
        display.RescaleTransferFunctionToDataRange(False, True)
    display.SetScalarBarVisibility(view, True)
    bar = simple.GetScalarBar(table, view)
    bar.Title, bar.ComponentTitle = TITLES[array], ""
    # Written in one word up to ParaView 5.9.
    places = bar.GetProperty("WindowLocation").GetAvailable()
    bar.WindowLocation = next(p for p in places if p.replace(" ", "") == "AnyLocation")
    bar.Position, bar.ScalarBarLength = [0.84, BARS[array]], 0.2
    bar.Orientation, bar.HorizontalTitle = "Vertical", 1
    # Of printf up to ParaView 5.13, later of Python.
    bar.RangeLabelFormat = "%.3g" if "%" in bar.RangeLabelFormat else "{:.3g}"
    bar.ScalarBarThickness, bar.TitleFontSize, bar.LabelFontSize = 12, 12, 12


def show_ellipses(source: Any, layer: float, name: str) -> Any:
    """Spheres stretched to length and width, turned into the main axes; returns their display."""
    from paraview import simple

    glyph = simple.Glyph(Input=source, GlyphType="Sphere")
    glyph.GlyphType.Radius = 0.5
    # Corners on both axes: an even number around, an odd one from pole to pole.
    glyph.GlyphType.ThetaResolution = 32
    glyph.GlyphType.PhiResolution = 17
    glyph.OrientationArray = ["POINTS", "orientation"]
    glyph.ScaleArray = ["POINTS", "scale"]
    glyph.VectorScaleMode = "Scale by Components"
    glyph.ScaleFactor = 1.0
    glyph.GlyphMode = "All Points"
    simple.RenameSource(name, glyph)
    return show(glyph, layer, GREY, shade=0.3)


def show_axes(source: Any, layer: float) -> Any:
    """Lines without head along the mean axes of cells, as long as S says; returns their display."""
    from paraview import simple

    # The axis of nearly nothing is chance, and would be a line as long as any.
    filled = simple.Threshold(Input=source, Scalars=["CELLS", "density"])
    if hasattr(filled, "LowerThreshold"):
        filled.LowerThreshold, filled.UpperThreshold = THIN * DENSITY, float("inf")
    else:
        filled.ThresholdRange = [THIN * DENSITY, float("inf")]  # up to ParaView 5.9
    simple.RenameSource("filled cells", filled)
    centres = simple.CellCenters(Input=filled)
    centres.VertexCells = 1
    simple.RenameSource("centres of cells", centres)
    glyph = simple.Glyph(Input=centres, GlyphType="Line")
    glyph.OrientationArray = ["POINTS", "orientation"]
    glyph.ScaleArray = ["POINTS", "S"]
    glyph.ScaleFactor = LINE
    glyph.GlyphMode = "Uniform Spatial Distribution (Bounds Based)"
    glyph.MaximumNumberOfSamplePoints = LINES
    simple.RenameSource("mean axes", glyph)
    display = show(glyph, layer)
    display.LineWidth = 2.0
    return display


def build() -> None:
    """The pipeline, as of the time that the view shows."""
    from paraview import simple

    flow, fields, histogram = opened("flow"), opened("fields"), opened("histogram")
    ghosts, particles, walls = opened("flow_ghost_particles"), opened("particles"), opened("walls")
    simple.GetAnimationScene().UpdateAnimationUsingDataTimeSteps()
    simple.GetAnimationScene().GoToLast()
    if not any((flow, fields, particles)):
        print(f"No files of an export in {FOLDER}: name their folder as FOLDER in this script.")
    if flow is not None:
        colour_by(show(flow, FLOW), "POINTS", "speed")
    if fields is not None:
        colour_by(show(fields, FIELDS), "CELLS", "density")
        colour_by(show_axes(fields, AXES), "POINTS", "angle")
    if histogram is not None:
        display = show(histogram, FIELDS)
        colour_by(display, "CELLS", "density")
        simple.Hide(histogram)
        display.SetScalarBarVisibility(simple.GetActiveView(), False)
    if ghosts is not None:
        show_ellipses(ghosts, GHOSTS, "ghost ellipses")
    if particles is not None:
        colour_by(show_ellipses(particles, ELLIPSES, "particles as ellipses"), "POINTS", "angle")
    if walls is not None:
        show(walls, WALLS, BLACK).LineWidth = 3.0
    simple.Show(simple.AnnotateTime(), simple.GetActiveView())


def main() -> None:
    """Build the pipeline, at the last time, seen straight from above on white."""
    from paraview import simple

    simple.LoadPalette("WhiteBackground")
    view = simple.GetActiveViewOrCreate("RenderView")
    view.InteractionMode = "2D"
    view.CameraParallelProjection = 1
    view.CameraFocalPoint, view.CameraPosition, view.CameraViewUp = [0.0, 0.0, 0.0], NORMAL, UP
    build()
    # From where it looks to all of it, in the same direction.
    simple.ResetCamera(view)
    # Room for the bars on the right.
    aside = 0.15 * view.CameraParallelScale
    (ux, uy, uz), (nx, ny, nz) = UP, NORMAL
    right = (uy * nz - uz * ny, uz * nx - ux * nz, ux * ny - uy * nx)
    for name in ("CameraPosition", "CameraFocalPoint"):
        seen = getattr(view, name)
        setattr(view, name, [at + aside * part for at, part in zip(seen, right, strict=True)])
    simple.Render(view)


# ParaView runs scripts under either name; the package imports nothing of this file.
if __name__ in ("__main__", "__vtkconsole__"):
    main()
