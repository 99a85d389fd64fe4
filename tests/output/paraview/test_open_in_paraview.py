"""The script that opens an export in ParaView, run with a stand-in that records what it asks for.

For where ParaView is not installed: it shows files that are not there, and arrays that their data do not
have. test_in_paraview.py opens exports in ParaView itself.
"""

from __future__ import annotations

import runpy
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import pyvista

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.paraview import export
from ellipsoid_coupling.result import Result


class Recorder:
    """`paraview.simple` as far as the script uses it."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.glyphs: list[Any] = []
        self.shown: list[tuple[Any, Any]] = []
        self.coloured: list[tuple[Any, Any]] = []
        self.tables: dict[str, Any] = {}
        self.opacities: dict[str, Any] = {}
        self.hidden: list[str] = []
        self.view = SimpleNamespace(
            CameraParallelScale=1.0,
            CameraPosition=[0.5, 0.5, 3.0],
            CameraFocalPoint=[0.5, 0.5, 0.0],
        )
        self.scene = SimpleNamespace(
            UpdateAnimationUsingDataTimeSteps=lambda: None, GoToLast=lambda: None
        )

    def OpenDataFile(self, path: str) -> Any:
        series = path.endswith(".pvd")
        data = pyvista.PVDReader(path).read()[0] if series else pyvista.read(path)
        return SimpleNamespace(path=path, data=data, made_of=None)

    def RenameSource(self, name: str, source: Any) -> None:
        source.name = name
        self.names.append(name)

    def Glyph(self, Input: Any, GlyphType: str) -> Any:
        glyph = SimpleNamespace(GlyphType=SimpleNamespace(name=GlyphType), made_of=Input)
        glyph.data = Input.data
        self.glyphs.append(glyph)
        return glyph

    def Threshold(self, Input: Any, Scalars: list[str]) -> Any:
        assert Scalars[1] in Input.data.cell_data
        return SimpleNamespace(made_of=Input, data=Input.data, LowerThreshold=0.0)

    def CellCenters(self, Input: Any) -> Any:
        centres = Input.data.cell_centers()
        return SimpleNamespace(made_of=Input, data=centres)

    def LoadPalette(self, name: str) -> None: ...

    def GetActiveViewOrCreate(self, kind: str) -> Any:
        self.view.kind = kind
        return self.view

    def GetActiveView(self) -> Any:
        return self.view

    def GetAnimationScene(self) -> Any:
        return self.scene

    def Show(self, source: Any, view: Any) -> Any:
        assert view is self.view
        display = SimpleNamespace(
            RescaleTransferFunctionToDataRange=lambda *_: None,
            SetScalarBarVisibility=lambda *_: None,
            source=source,
        )
        self.shown.append((source, display))
        return display

    def AnnotateTime(self) -> Any:
        return SimpleNamespace(made_of="the view")

    def Hide(self, source: Any) -> None:
        self.hidden.append(source.name)

    def ColorBy(self, display: Any, what: tuple[str, str] | None) -> None:
        self.coloured.append((display.source, what))

    def GetColorTransferFunction(self, array: str) -> Any:
        return self.tables.setdefault(array, SimpleNamespace())

    def GetOpacityTransferFunction(self, array: str) -> Any:
        return self.opacities.setdefault(array, SimpleNamespace())

    def GetScalarBar(self, table: Any, view: Any) -> Any:
        assert table in self.tables.values()
        assert view is self.view
        places = SimpleNamespace(GetAvailable=lambda: ["Lower Right Corner", "Any Location"])
        return SimpleNamespace(GetProperty=lambda _: places, RangeLabelFormat="%-#6.1e")

    def ResetCamera(self, view: Any) -> None: ...

    def Render(self, view: Any) -> None: ...


def opened(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Recorder:
    """What the folder's script asks ParaView for."""
    recorder = Recorder()
    package, simple = ModuleType("paraview"), ModuleType("paraview.simple")
    for name in dir(recorder):
        if name[0].isupper():
            setattr(simple, name, getattr(recorder, name))
    vars(package)["simple"] = simple
    monkeypatch.setitem(sys.modules, "paraview", package)
    monkeypatch.setitem(sys.modules, "paraview.simple", simple)
    runpy.run_path(str(folder / "open_in_paraview.py"), run_name="__main__")
    return recorder


def check_arrays(recorder: Recorder) -> None:
    """Every array that something is coloured, turned or scaled by is there."""
    for source, what in recorder.coloured:
        if what is not None:
            data = source.data.point_data if what[0] == "POINTS" else source.data.cell_data
            assert what[1] in data, what
    for glyph in recorder.glyphs:
        for where, name in (glyph.OrientationArray, glyph.ScaleArray):
            assert where == "POINTS"
            assert name in glyph.data.point_data


@pytest.fixture
def walled(lid_flow: FlowField) -> FlowField:
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.0, 0.75]])
    return FlowField(lid_flow.arrays, "walled", polygon_outline([("walls", "wall", box, True)]))


def test_particles_become_ellipses_over_flow_and_walls(
    particle_result: Result,
    walled: FlowField,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorder = opened(export(particle_result, tmp_path / "paraview", walled), monkeypatch)
    wanted = {"flow", "histogram", "particles", "walls", "particles as ellipses", "ghost ellipses"}
    assert wanted <= set(recorder.names)
    check_arrays(recorder)
    spheres = [glyph for glyph in recorder.glyphs if glyph.GlyphType.name == "Sphere"]
    for glyph in spheres:
        # A sphere of diameter 1 becomes (L, D, D).
        assert (glyph.GlyphType.Radius, glyph.ScaleFactor) == (0.5, 1.0)
        assert glyph.VectorScaleMode == "Scale by Components"
        assert glyph.GlyphMode == "All Points"
    assert {tuple(map(float, row)) for row in spheres[-1].data.point_data["scale"]} == {
        (0.05, 0.025, 0.025)
    }
    layers = [
        display.Position[2] for source, display in recorder.shown if source.made_of != "the view"
    ]
    assert len(set(layers)) == len(layers)
    # What is seen at first are the ellipses.
    assert recorder.hidden == ["histogram"]


@pytest.mark.parametrize("kind", ["rho_result", "q_result"])
def test_fields_have_lines_along_their_mean_axes(
    kind: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = opened(export(request.getfixturevalue(kind), tmp_path), monkeypatch)
    assert recorder.names == ["fields", "filled cells", "centres of cells", "mean axes"]
    check_arrays(recorder)
    (lines,) = recorder.glyphs
    assert lines.GlyphType.name == "Line"
    assert lines.ScaleArray == ["POINTS", "S"]


def test_colours_of_axes_are_those_of_the_figures(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = np.array(opened(export(rho_result, tmp_path), monkeypatch).tables["angle"].RGBPoints)
    angles, colours = table.reshape(-1, 4)[:, 0], table.reshape(-1, 4)[:, 1:]
    np.testing.assert_allclose(colours, axis_colours(angles), atol=1e-3)
    np.testing.assert_allclose(angles[[0, -1]], [-0.5 * np.pi, 0.5 * np.pi], atol=1e-4)


def test_colours_of_densities_are_those_of_all_times(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They end at the 99.5th percentile, above which a cell in two hundred lies."""
    table = opened(export(rho_result, tmp_path), monkeypatch).tables["density"]
    wanted = np.percentile(rho_result.variables["density"], 99.5)
    assert (table.RGBPoints[0], table.RGBPoints[4]) == (0.0, pytest.approx(wanted))
    assert 0.0 < wanted < 7.0


def test_a_folder_that_was_moved_still_opens(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.move(export(rho_result, tmp_path / "here"), tmp_path / "there")
    recorder = opened(tmp_path / "there", monkeypatch)
    assert all("there" in str(s.path) for s, _ in recorder.shown if s.made_of is None)


def test_an_empty_folder_opens_as_nothing(
    rho_result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = export(rho_result, tmp_path)
    for path in folder.glob("fields*"):
        path.unlink()
    assert opened(folder, monkeypatch).names == []
