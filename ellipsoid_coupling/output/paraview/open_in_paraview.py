"""Open the files of this folder in ParaView (5.7 or later): flow, walls, ellipses, fields, in time.

    paraview --script=open_in_paraview.py          or File > Load State ... and this file

Written by ``ellipsoid export`` beside the files that it opens; what is not there is left out.
"""

from __future__ import annotations

from pathlib import Path

# Where the files are if ParaView does not tell where this script is; filled in by the export, as the next.
FOLDER = "."
# Length of the lines that show mean axes where S is 1, in units of the scene.
LINE = 0.1
# Colours of axes: angle in radian, red, green, blue, and so on.
AXIS_COLOURS = [-1.5707963267948966, 1.0, 0.5, 0.0, 1.5707963267948966, 1.0, 0.5, 0.0]
# Towards the eye, and up for it: across the plane of the files, and along its second axis.
NORMAL = [0.0, 0.0, 1.0]
UP = [0.0, 1.0, 0.0]
# So many lines at most.
LINES = 1500

# Layers above each other, in lengths of a line, so that none hides what lies below it in the plane.
FLOW, FIELDS, AXES, GHOSTS, ELLIPSES, WALLS = -2.0, -1.0, 0.5, 1.0, 2.0, 4.0


def path_of(name: str) -> str | None:
    """The series or the file of that name; None without either."""
    # ParaView does not always tell a script where it is.
    told = globals().get("__file__")
    folders = [Path(told).absolute().parent] if told else []
    paths = [f / f"{name}.{end}" for f in (*folders, Path(FOLDER)) for end in ("pvd", "vti", "vtp")]
    return next((str(path) for path in paths if path.exists()), None)


def opened(name: str) -> object | None:
    """The reader of a file of this folder, or None."""
    from paraview import simple

    path = path_of(name)
    if path is None:
        return None
    source: object = simple.OpenDataFile(path)
    simple.RenameSource(name, source)
    return source


def show(
    source: object,
    layer: float,
    where: str,
    array: str | None,
    look: dict[str, object] | None = None,
) -> None:
    """Show a source in a layer, coloured by an array of its POINTS or CELLS; None leaves it as it is.

    look : properties of its display, by name
    """
    from paraview import simple

    view = simple.GetActiveViewOrCreate("RenderView")
    display = simple.Show(source, view)
    # Plane images are shown as slices otherwise, which have one place for all layers.
    display.Representation = "Surface"
    display.Position = [layer * LINE * part for part in NORMAL]
    for name, value in (look or {}).items():
        setattr(display, name, value)
    if array is None:
        simple.ColorBy(display, None)
        return
    simple.ColorBy(display, (where, array))
    table = simple.GetColorTransferFunction(array)
    if array == "angle":
        table.AutomaticRescaleRangeMode = "Never"
        table.ColorSpace = "RGB"
        table.RGBPoints = AXIS_COLOURS
    else:
        table.ApplyPreset("Viridis (matplotlib)" if array == "density" else "Grayscale", True)
        display.RescaleTransferFunctionToDataRange(False, True)
    display.SetScalarBarVisibility(view, True)


def show_ellipses(source: object, layer: float, name: str, array: str | None) -> None:
    """Spheres stretched to length and width, turned into the main axes."""
    from paraview import simple

    glyph = simple.Glyph(Input=source, GlyphType="Sphere")
    glyph.GlyphType.Radius = 0.5
    glyph.GlyphType.ThetaResolution = 32
    glyph.GlyphType.PhiResolution = 16
    glyph.OrientationArray = ["POINTS", "orientation"]
    glyph.ScaleArray = ["POINTS", "scale"]
    glyph.VectorScaleMode = "Scale by Components"
    glyph.ScaleFactor = 1.0
    glyph.GlyphMode = "All Points"
    simple.RenameSource(name, glyph)
    show(glyph, layer, "POINTS", array)


def show_axes(source: object, layer: float) -> None:
    """Lines without head along the mean axes of cells, as long as S says."""
    from paraview import simple

    centres = simple.CellCenters(Input=source)
    centres.VertexCells = 1
    glyph = simple.Glyph(Input=centres, GlyphType="Line")
    glyph.OrientationArray = ["POINTS", "orientation"]
    glyph.ScaleArray = ["POINTS", "S"]
    glyph.ScaleFactor = LINE
    glyph.GlyphMode = "Uniform Spatial Distribution (Bounds Based)"
    glyph.MaximumNumberOfSamplePoints = LINES
    simple.RenameSource("mean axes", glyph)
    show(glyph, layer, "POINTS", "angle", {"LineWidth": 2.0})


def main() -> None:
    """Build the pipeline, and go to the last time."""
    from paraview import simple

    flow = opened("flow")
    if flow is not None:
        show(flow, FLOW, "POINTS", "speed")
    for name in ("fields", "histogram"):
        cells = opened(name)
        if cells is not None:
            show(cells, FIELDS, "CELLS", "density", {"Opacity": 0.7})
            show_axes(cells, AXES)
    ghosts = opened("flow_ghost_particles")
    if ghosts is not None:
        show_ellipses(ghosts, GHOSTS, "ghost ellipses", None)
    particles = opened("particles")
    if particles is not None:
        show_ellipses(particles, ELLIPSES, "particles as ellipses", "angle")
    walls = opened("walls")
    if walls is not None:
        black = [0.0, 0.0, 0.0]
        look = {"LineWidth": 3.0, "AmbientColor": black, "DiffuseColor": black}
        show(walls, WALLS, "CELLS", None, look)
    view = simple.GetActiveViewOrCreate("RenderView")
    view.InteractionMode = "2D"
    view.CameraFocalPoint, view.CameraPosition, view.CameraViewUp = [0.0, 0.0, 0.0], NORMAL, UP
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.GoToLast()
    # From where it looks to all of it, in the same direction.
    simple.ResetCamera(view)
    simple.Render(view)


# ParaView runs scripts under either name; the package imports nothing of this file.
if __name__ in ("__main__", "__vtkconsole__"):
    main()
