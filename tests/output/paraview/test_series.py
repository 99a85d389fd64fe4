"""The .pvd: exact times, relative names, data on disk first."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyvista

from ellipsoid_coupling.output.paraview.series import save_series, vectors, write_pvd

TIMES = [0.1, 1.0 / 3.0, 5.0]


def test_times_read_back_exactly(tmp_path: Path) -> None:
    meshes = ((time, pyvista.PolyData(np.full((1, 3), time))) for time in TIMES)
    path = save_series(meshes, tmp_path / "new", "dots", ".vtp")
    reader = pyvista.PVDReader(str(path))
    assert list(reader.time_values) == TIMES
    reader.set_active_time_value(TIMES[1])
    block = reader.read()[0]
    assert isinstance(block, pyvista.PolyData)
    assert block.points[0, 0] == TIMES[1]
    assert block.field_data["TimeValue"][0] == TIMES[1]
    assert sorted(file.name for file in path.parent.iterdir()) == [
        "dots.pvd",
        "dots_0000.vtp",
        "dots_0001.vtp",
        "dots_0002.vtp",
    ]


def test_folder_can_be_moved(tmp_path: Path) -> None:
    save_series([(1.0, pyvista.PolyData(np.zeros((1, 3))))], tmp_path / "a", "dots", ".vtp")
    moved = (tmp_path / "a").rename(tmp_path / "b")
    assert pyvista.PVDReader(str(moved / "dots.pvd")).read().n_blocks == 1


def test_names_are_quoted_and_an_empty_series_is_valid(tmp_path: Path) -> None:
    path = write_pvd([(1.0, 'a&"b".vtp')], tmp_path / "a.pvd")
    datasets = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    assert [dataset.get("file") for dataset in datasets] == ['a&"b".vtp']
    empty = ElementTree.parse(write_pvd([], tmp_path / "empty.pvd")).getroot()
    assert empty.findall("Collection/DataSet") == []


def test_vectors_have_three_components_in_c_order() -> None:
    x = np.array([[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(
        vectors(x, 10 * x), [[1, 10, 0], [2, 20, 0], [3, 30, 0], [4, 40, 0]]
    )
