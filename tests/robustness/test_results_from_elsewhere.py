"""Forged results with a right checksum: one line, nothing opened, no crash, bounded memory.

They are loaded in a process of its own, which is given 4 GB.
"""

from __future__ import annotations

import dataclasses
import io
import json
import os
import random
import re
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.checksum import sealed
from ellipsoid_coupling.result import DIMENSIONS, MARKS, VARIABLES, Layout, Result
from ellipsoid_coupling.scenes import load_scene, scene_to_toml
from tests.known_axes import even_axis
from tests.robustness.conftest import within_limits
from tests.robustness.test_mutations import small_result

Forge = Callable[[h5py.File, Path], None]

# Loads every file named on its input, one a line, and answers with "loaded", or with the refusal.
READER = """
import json, resource, sys
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.result import Result
resource.setrlimit(resource.RLIMIT_AS, (4_000_000_000, 4_000_000_000))
for line in sys.stdin:
    try:
        Result.load(json.loads(line))
        answer = "loaded"
    except InputError as error:
        answer = f"refused: {error}"
    print(json.dumps(answer), flush=True)
"""


def answers(files: list[Path]) -> list[str]:
    """What the reader says of each; it may take a minute, where a sound one takes a second."""
    done = subprocess.run(
        [sys.executable, "-c", READER],
        input="".join(json.dumps(str(file)) + "\n" for file in files),
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    told = [str(json.loads(line)) for line in done.stdout.splitlines()]
    assert (done.returncode, len(told)) == (0, len(files)), (done.stderr[-2000:], told[-1:])
    return told


def small_file(path: Path) -> bytes:
    """A result's HDF5 without its checksum."""
    small_result().save(path)
    data = path.read_bytes()
    return data[: data.rindex(b"\nellipsoid_coupling sha256")]


def replace(file: h5py.File, name: str = "x", **kind: object) -> h5py.Dataset:
    del file[name]
    return file.create_dataset(name, **kind)


def external(file: h5py.File, folder: Path) -> None:
    replace(file, shape=(3, 1, 2), dtype="f8", external=[(str(folder / "pipe"), 0, 48)])


def virtual(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout(shape=(3, 1, 2), dtype="f8")
    layout[...] = h5py.VirtualSource(str(folder / "pipe"), "x", shape=(3, 1, 2))
    del file["x"]
    file.create_virtual_dataset("x", layout)


def huge(file: h5py.File, _folder: Path) -> None:
    replace(file, shape=(3, 10_000_000, 333_333), dtype="f8", chunks=(1, 1000, 1000))


def huge_dimension(file: h5py.File, _folder: Path) -> None:
    replace(file, "particle", shape=(10**13,), dtype="f4", chunks=(1000,))


def unwritten(file: h5py.File, _folder: Path) -> None:
    replace(file, shape=(3, 10_000_000, 333_333), dtype="f8")


def bomb(file: h5py.File, _folder: Path) -> None:
    shape = (3, 1, 1_000_000)
    data = replace(file, shape=shape, dtype="f8", chunks=shape, compression="gzip")
    data[...] = 0.0


def other_filter(file: h5py.File, _folder: Path) -> None:
    replace(file, data=np.zeros((3, 1, 2)), chunks=(3, 1, 2), fletcher32=True)


def named_type(file: h5py.File, _folder: Path) -> None:
    file["kind"] = np.dtype("f8")
    replace(file, shape=(3, 1, 2), dtype=file["kind"])


def type_instead(file: h5py.File, _folder: Path) -> None:
    del file["x"]
    file["x"] = np.dtype("f8")


def group_instead(file: h5py.File, _folder: Path) -> None:
    del file["x"]
    file.create_group("x")


def text_times(file: h5py.File, _folder: Path) -> None:
    replace(file, "time", data=np.array([b"0.1", b"0.2", b"0.3"]))


def free_text_times(file: h5py.File, _folder: Path) -> None:
    replace(file, "time", data=["0.1", "0.2", "0.3"], dtype=h5py.string_dtype())


def objects(file: h5py.File, _folder: Path) -> None:
    replace(file, shape=(3, 1, 2), dtype=h5py.ref_dtype)


def compound(file: h5py.File, _folder: Path) -> None:
    replace(file, shape=(3, 1, 2), dtype=[("a", "f8"), ("b", "f8")])


def soft_link(file: h5py.File, _folder: Path) -> None:
    del file["x"]
    file["x"] = h5py.SoftLink("/y")


def outer_link(file: h5py.File, folder: Path) -> None:
    del file["x"]
    file["x"] = h5py.ExternalLink(str(folder / "pipe"), "/x")


def escapes(file: h5py.File, _folder: Path) -> None:
    file.attrs["status"] = "completed\x1b]0;owned\x07"


def long_text(file: h5py.File, _folder: Path) -> None:
    file.attrs["resolution"] = "x" * 1_000_000


def object_attribute(file: h5py.File, _folder: Path) -> None:
    file.attrs["status"] = file["y"].ref


def text_as_seconds(file: h5py.File, _folder: Path) -> None:
    file.attrs["wall_seconds"] = "soon"


def nan_seed(file: h5py.File, _folder: Path) -> None:
    file.attrs["seed"] = np.nan


def no_status_text(file: h5py.File, _folder: Path) -> None:
    file.attrs["status"] = 3


def many_attributes(file: h5py.File, _folder: Path) -> None:
    for k in range(300):
        file.attrs[f"a{k}"] = k


def many_variables(file: h5py.File, _folder: Path) -> None:
    for k in range(100):
        file[f"a{k}"] = k


def strange_name(file: h5py.File, _folder: Path) -> None:
    file["x\x1b[31m"] = np.zeros((3, 1, 2))


def bytes_name(file: h5py.File, _folder: Path) -> None:
    file.id.links.create_soft(b"\xff\xfe", b"/y")


def no_scene(file: h5py.File, _folder: Path) -> None:
    del file.attrs["scene_toml"]


def nested_scene(file: h5py.File, _folder: Path) -> None:
    file.attrs["scene_toml"] = "a = " + "[" * 100_000


def scene_number(file: h5py.File, _folder: Path) -> None:
    file.attrs["scene_toml"] = 1.0


def integers(file: h5py.File, _folder: Path) -> None:
    replace(file, data=np.zeros((3, 1, 2), np.int64))


def shared_data(file: h5py.File, _folder: Path) -> None:
    file.create_dataset("z", data=np.zeros((3, 1, 2)))


FORGED: list[Forge] = [
    external, virtual, huge, huge_dimension, unwritten, bomb, other_filter, named_type,
    type_instead, group_instead, text_times, free_text_times, objects, compound, soft_link,
    outer_link, escapes, long_text, object_attribute, text_as_seconds, nan_seed, no_status_text,
    many_attributes, many_variables, strange_name, bytes_name, no_scene, nested_scene,
    scene_number, integers, shared_data,
]  # fmt: skip


def test_forged_results_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe that is opened would hang; a forged file that gets in would be "loaded"."""
    content = small_file(tmp_path / "whole.nc")
    os.mkfifo(tmp_path / "pipe")
    files = []
    monkeypatch.setattr(h5py.get_config(), "track_order", True)  # headers as results have them
    for forge in FORGED:
        memory = io.BytesIO(content)
        with h5py.File(memory, "r+", libver="latest" if forge is many_attributes else None) as file:
            forge(file, tmp_path)
        files.append(tmp_path / f"{forge.__name__}.nc")
        files[-1].write_bytes(sealed(memory.getvalue()))
    told = dict(zip((f.__name__ for f in FORGED), answers(files), strict=True))
    for name, answer in told.items():
        assert answer.startswith("refused: "), (name, answer)
        assert f"{name}.nc" in answer
        assert answer.isprintable()
    assert "in pieces, packed, or in another file" in told["external"]
    assert "a part that another program wrote" in told["virtual"]
    assert "as a link to something else" in told["outer_link"]


def test_results_that_xarray_wrote_are_read(tmp_path: Path) -> None:
    """As earlier versions did: in memory, by xarray's own writer."""
    result = small_result()
    small_file(tmp_path / "whole.nc")
    with xr.open_dataset(tmp_path / "whole.nc", engine="h5netcdf") as data:
        memory = io.BytesIO()
        data.load().to_netcdf(memory, engine="h5netcdf")
    (tmp_path / "again.nc").write_bytes(sealed(memory.getvalue()))
    loaded = Result.load(tmp_path / "again.nc")
    assert loaded.attributes == result.attributes
    assert all((loaded.variables[k] == v).all() for k, v in result.variables.items())


def test_forged_bytes(tmp_path: Path) -> None:
    """Some bytes changed, with a right checksum: loaded or refused, no crash, no endless loop.

    HDF5's own checksums are not looked at, so that its parts are reached here as well.
    """
    content = small_file(tmp_path / "whole.nc")
    chance = random.Random(1)
    files = []
    for k in range(1000):
        data = bytearray(content)
        for _ in range(chance.choice([1, 1, 2, 4])):
            place = chance.randrange(len(data))
            data[place] = chance.choice([0, 255, chance.randrange(256), data[place] ^ 1])
        files.append(tmp_path / f"{k}.nc")
        files[-1].write_bytes(sealed(bytes(data)))
    # The heap of texts: its size; the first part's index, four zeros, size.
    heap = content.index(b"GCOL")
    for k, place in enumerate((8, 16, 20, 24)):
        data = bytearray(content)
        data[heap + place] ^= 2
        files.append(tmp_path / f"heap{k}.nc")
        files[-1].write_bytes(sealed(bytes(data)))
    told = answers(files)
    assert all(answer == "loaded" or answer.startswith("refused: ") for answer in told)
    assert all(answer.isprintable() for answer in told)


def test_text_that_no_terminal_should_get_is_escaped_when_saved(tmp_path: Path) -> None:
    result = small_result()
    result.attributes["status"] = "failed: \x1b[2J \udcff \U0001f600"
    result.save(tmp_path / "result.nc")
    told = Result.load(tmp_path / "result.nc").status
    assert told == "failed: \\x1b[2J \\udcff \U0001f600"


def test_a_long_scene_is_kept(tmp_path: Path) -> None:
    """One of many points is longer than what HDF5 keeps in an attribute itself (64 kB)."""
    result = small_result()
    points = [[0.0001 * k, 0.5, 0.25] for k in range(5000)]
    settings = {"particles.number": 5000, "start": {"points": points}}
    scene = load_scene("top_bottom", settings)
    assert len(scene_to_toml(scene)) > 65_536
    dataclasses.replace(result, scene=scene).save(tmp_path / "result.nc")
    assert Result.load(tmp_path / "result.nc").scene == scene


@pytest.mark.parametrize("number", [3, 9, 60, 190])
def test_many_attributes_are_kept(tmp_path: Path, number: int) -> None:
    """HDF5 keeps many in blocks of a heap, under a tree of one level or two."""
    result = small_result()
    result.attributes.update({f"number {k}": 0.5 * k for k in range(number)})
    result.attributes.update({"of words": "\u00e9", "of many": [1, 2, 3]})
    result.save(tmp_path / "result.nc")
    assert Result.load(tmp_path / "result.nc").attributes == result.attributes


def test_what_is_read_is_not_given_to_the_hdf5_library(tmp_path: Path) -> None:
    """It came back from a file of 14 kB after 4 GB, or not at all."""
    small_result().save(tmp_path / "result.nc")
    code = f"""
import sys
from ellipsoid_coupling.result import Result
Result.load({str(tmp_path / "result.nc")!r})
print(sorted({{"h5py", "h5netcdf", "xarray"}} & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=600
    )
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


def test_texts_take_no_more_than_the_file_has(tmp_path: Path) -> None:
    """Of another length than told, or the same one of a megabyte told a thousand times."""
    memory = io.BytesIO(small_file(tmp_path / "whole.nc"))
    with h5py.File(memory, "r+") as file:
        # Few attributes lie in the header itself, where there is room for this one.
        for name in list(file.attrs):
            del file.attrs[name]
        texts = np.array(["x" * 900_000, *("y" * 17 for _ in range(999))], dtype=object)
        file.attrs.create("texts", texts, dtype=h5py.string_dtype())
    content = memory.getvalue()
    # The list of lengths and places, 16 bytes each; lengths stand before the texts themselves too.
    length, other = struct.pack("<I", 900_000), struct.pack("<I", 17)
    starts = (at.start() for at in re.finditer(re.escape(length), content))
    (place,) = (at for at in starts if content[at + 16 : at + 20] == other)
    first = content[place : place + 16]
    many = content[:place] + 1000 * first + content[place + 16_000 :]
    longer = content[:place] + struct.pack("<I", 2**32 - 1) + content[place + 4 :]
    for data in (many, longer):
        (tmp_path / "result.nc").write_bytes(sealed(data))
        with within_limits(), pytest.raises(InputError, match="too much of it"):
            Result.load(tmp_path / "result.nc")


def test_a_full_disk_is_told_and_leaves_what_was_there(tmp_path: Path) -> None:
    """A limit on the size of files stands for it: HDF5 would crash (signal 11)."""
    small_result().save(tmp_path / "result.nc")
    before = (tmp_path / "result.nc").read_bytes()
    code = f"""
import resource
from pathlib import Path
from tests.robustness.conftest import within_limits
from tests.robustness.test_mutations import small_result
from ellipsoid_coupling.errors import WriteError
resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, 5_000))
try:
    small_result().save(Path({str(tmp_path / "result.nc")!r}))
except WriteError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stderr
    assert "could not be written: File too large" in done.stdout
    assert (tmp_path / "result.nc").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["result.nc"]


@pytest.mark.parametrize("layout", ["particles", "rho", "q"])
def test_results_of_every_layout_are_read_back(layout: Layout, tmp_path: Path) -> None:
    scene = small_result().scene
    sizes = {"time": len(scene.times), "realisation": 2, "particle": 3, "angle": 4, "y": 5, "x": 6}
    shape = tuple(sizes[name] for name in DIMENSIONS[layout])
    count = int(np.prod(shape))
    names = (*VARIABLES[layout], *MARKS[layout])
    values = {
        name: np.arange(float(count)).reshape(shape) + 0.1 * k + 1.0 for k, name in enumerate(names)
    }
    values |= {name: values[name].astype(np.int32) for name in values if name == "fate"}
    axes = [] if layout == "particles" else DIMENSIONS[layout][1:]
    coordinates = {name: even_axis(scene, name, sizes[name]) for name in axes}
    attributes = {"status": "completed", "seed": 2**62, "mass_end": 1e-300, "warnings": "a, \u00e9"}
    times = np.array(scene.times)
    made = Result(scene, "a", "accurate", layout, times, values, coordinates, attributes)
    made.save(tmp_path / "result.nc")
    read = Result.load(tmp_path / "result.nc")
    assert (read.layout, read.attributes) == (layout, attributes)
    for one, other in ((read.variables, values), (read.coordinates, coordinates)):
        assert one.keys() == other.keys()
        assert all(one[name].tobytes() == array.tobytes() for name, array in other.items())
