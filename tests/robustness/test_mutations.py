"""Mutations of valid input: each is accepted and valid, or an InputError whose text names the file.

2300 in all: 600 of scenes, 850 of solved cases (ascii, binary, gzip, foamToVTK), 350 of saved flows,
200 of results, 300 of checkpoints.
"""

from __future__ import annotations

import gzip
import io
import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.checksum import sealed
from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.models import Model, Setup, build_model, model_terms
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import builtin_scenes, load_scene, scene_to_toml
from ellipsoid_coupling.stepping.step_control import clock_fault
from ellipsoid_coupling.storage.checkpoint import Progress, pack, unpack
from ellipsoid_coupling.storage.run_folder import CHECKPOINT_FILE, RunFolder
from tests.robustness.conftest import within_limits
from tests.robustness.reading import Worker

DATA = Path(__file__).parents[1] / "data"
Mutation = Callable[[bytes], bytes]

WORDS = [
    b"nan", b"inf", b"-inf", b"1e300", b"-1", b"0", b"1000000000000", b"9" * 400, b"1e-300", b"",
    b"(", b")", b"{", b"}", b"[", b"]", b";", b'"', b"#", b"$", b"/*", b"//", b"\0", b"\xff\xfe",
    b"../../etc/passwd", b"=", b"\n",
]  # fmt: skip


def _within(data: bytes, part: float) -> int:
    return min(int(part * len(data)), max(len(data) - 1, 0))


@st.composite
def mutations(draw: st.DrawFn) -> Mutation:
    """Cut, flip bits, put a word in or over a number, leave a part out, double a part, empty."""
    kind = draw(st.sampled_from(["cut", "flip", "word", "number", "leave", "double", "empty"]))
    first, second = (draw(st.floats(0.0, 1.0)) for _ in range(2))
    word, bit = draw(st.sampled_from(WORDS)), draw(st.integers(0, 7))

    def mutate(data: bytes) -> bytes:
        a, b = sorted((_within(data, first), _within(data, second)))
        if kind == "flip":
            return data[:a] + bytes([data[a] ^ 1 << bit]) + data[a + 1 :]
        if kind == "word":
            return data[:a] + word + data[a:]
        if kind == "number":
            numbers = list(re.finditer(rb"\d+", data))
            place = numbers[_within(bytes(len(numbers)), first)]
            return data[: place.start()] + word + data[place.end() :]
        parts = {"cut": data[:a], "leave": data[:a] + data[b:], "double": data[:b] + data[a:]}
        return parts.get(kind, b"")

    return mutate


def trials(number: int) -> settings:
    """So many, the same ones every time; each has its own limit of 10 s."""
    checks = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
    return settings(
        max_examples=number, derandomize=True, deadline=None, database=None,
        suppress_health_check=checks,
    )  # fmt: skip


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


def refused(read: Callable[[], object], path: Path) -> bool:
    """Whether reading ends in an InputError, which names the file; any other error is passed on."""
    message = None
    try:
        with within_limits():
            read()
    except InputError as error:
        message = str(error)
    assert message is None or (path.name in message and "\n" not in message)
    return message is not None


@trials(600)
@given(name=st.sampled_from(builtin_scenes()), mutate=mutations())
def test_scenes(tmp_path: Path, name: str, mutate: Mutation) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(mutate(scene_to_toml(load_scene(name)).encode()))

    def read() -> None:
        scene = load_scene(path)
        # Whole: what it writes is read back as the same.
        path.write_text(scene_to_toml(scene), encoding="utf-8")
        assert load_scene(path) == scene

    refused(read, path)


FILES = [
    "3.95/U", "3.95/streamFunction", "constant/polyMesh/points", "constant/polyMesh/faces",
    "constant/polyMesh/owner", "constant/polyMesh/neighbour", "constant/polyMesh/boundary",
]  # fmt: skip
VTK_FILES = ["internal.vtu", "boundary/lid.vtp", "boundary/walls.vtp"]


def read_mutated(worker: Worker, source: Path, folder: Path, file: str, change: Mutation) -> None:
    """Read a case with one file changed: a finite flow, or an InputError that names the case."""
    if not folder.exists():
        shutil.copytree(source, folder)
    plain = (source / file).read_bytes()
    changed = change(plain)
    packed = folder / f"{file}.gz"
    (folder / file).unlink(missing_ok=True)
    if changed[:2] == b"\x1f\x8b":
        packed.write_bytes(changed)
    else:
        (folder / file).write_bytes(changed)
    try:
        answer = worker.read(folder)
    finally:
        packed.unlink(missing_ok=True)
        (folder / file).write_bytes(plain)
    assert not answer or (answer.startswith("refused: ") and str(folder) in answer), answer
    assert "\n" not in answer


@trials(200)
@given(file=st.sampled_from(FILES), mutate=mutations())
def test_ascii_cases(worker: Worker, tmp_path: Path, file: str, mutate: Mutation) -> None:
    read_mutated(worker, DATA / "cavity_16", tmp_path / "case", file, mutate)


@trials(250)
@given(file=st.sampled_from(FILES), mutate=mutations())
def test_binary_cases(worker: Worker, tmp_path: Path, file: str, mutate: Mutation) -> None:
    read_mutated(worker, DATA / "cavity_16_binary", tmp_path / "case", file, mutate)


@trials(200)
@given(file=st.sampled_from(FILES), mutate=mutations(), inside=st.booleans())
def test_packed_cases(
    worker: Worker, tmp_path: Path, file: str, mutate: Mutation, inside: bool
) -> None:
    """What is packed is changed, or the packed file."""

    def change(data: bytes) -> bytes:
        return gzip.compress(mutate(data), 1) if inside else mutate(gzip.compress(data, 1, mtime=0))

    read_mutated(worker, DATA / "cavity_16", tmp_path / "case", file, change)


@trials(200)
@given(file=st.sampled_from(VTK_FILES), mutate=mutations())
def test_vtk_files(worker: Worker, tmp_path: Path, file: str, mutate: Mutation) -> None:
    source = DATA / "cavity_16" / "VTK" / "cavity_16_79"
    read_mutated(worker, source, tmp_path / "case_79", file, mutate)


@trials(350)
@given(mutate=mutations(), inside=st.booleans())
def test_saved_flows(tmp_path: Path, mutate: Mutation, inside: bool) -> None:
    """The file is changed, or one of its arrays before it is packed with a right checksum."""
    path = tmp_path / "flow.npz"
    analytic_flow("shear").save(path)
    if inside:
        repack(path, mutate)
    else:
        path.write_bytes(mutate(path.read_bytes()))

    def read() -> None:
        flow = FlowField.load(path)
        assert np.isfinite(flow.arrays.coefficients).all()
        assert flow.origin.isprintable()

    refused(read, path)


def repack(path: Path, mutate: Mutation, number: int = 0) -> None:
    """Change one member of an .npz; the archive around it stays whole."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    changed = list(members)[number % len(members)]
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, mutate(data) if name == changed else data)


def small_result() -> Result:
    scene = load_scene("top_bottom", {"particles.number": 2, "particles.realisations": 1})
    shape = (len(scene.times), 1, 2)
    names = ("x", "y", "angle", "velocity_x", "velocity_y", "angular_velocity")
    values = {name: np.full(shape, float(k)) for k, name in enumerate(names)}
    attributes = {"status": "completed", "seed": 0}
    return Result(
        scene, "microscopic", "accurate", "particles", np.array(scene.times), values, {}, attributes
    )


@trials(200)
@given(mutate=mutations())
def test_results(tmp_path: Path, mutate: Mutation) -> None:
    """Every change of a byte is found by the checksum before HDF5 reads anything."""
    path = tmp_path / "result.nc"
    if not path.exists():
        small_result().save(tmp_path / "whole.nc")
        path.write_bytes(b"")
    whole = (tmp_path / "whole.nc").read_bytes()
    path.write_bytes(mutate(whole))
    if not refused(lambda: Result.load(path), path):
        assert path.read_bytes() == whole


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"x": np.full((2, 1, 2), np.nan)}, r"x\[0, 0, 0\]: expected a finite number"),
        ({"x": np.zeros((2, 1, 3))}, "alike for all variables"),
        ({"z": np.zeros((2, 1, 2))}, "expected the variables"),
    ],
)
def test_results_that_are_whole_but_no_results(
    tmp_path: Path, change: dict[str, NDArray[np.float64]], told: str
) -> None:
    result = small_result()
    count = result.times.size
    changed = {name: np.resize(array, (count, *array.shape[1:])) for name, array in change.items()}
    variables = result.variables | changed
    names = {}
    for name, array in variables.items():
        last = "particle" if array.shape[-1] == 2 else "other"
        names[name] = (("time", "realisation", last), array)
    if "z" not in change:
        names = {k: v for k, v in names.items() if v[0][2] == "particle" or k == "x"}
    data = xr.Dataset(names, coords={"time": result.times})
    data.attrs = {"model": "microscopic", "scheme": "accurate"}
    data.attrs["scene_toml"] = scene_to_toml(result.scene)
    memory = io.BytesIO()
    data.to_netcdf(memory, engine="h5netcdf")
    (tmp_path / "result.nc").write_bytes(sealed(memory.getvalue()))
    expected = "dimensions" if "other" in data.dims else told
    with pytest.raises(InputError, match=expected):
        Result.load(tmp_path / "result.nc")


def small_model() -> Model:
    scene = load_scene("top_bottom", {"particles.number": 4, "particles.realisations": 2})
    flow = analytic_flow("top_bottom")
    return build_model(
        "microscopic", Setup(scene, model_terms(scene, "microscopic"), "accurate", flow, 0, 2)
    )


@trials(300)
@given(mutate=mutations(), member=st.integers(-12, 9))
def test_checkpoints(tmp_path: Path, mutate: Mutation, member: int) -> None:
    """The file is changed, or one of its arrays before it is packed with a right checksum.

    A changed file gives what it held, or nothing; a changed array a state with which kernels can
    go on, for they do not look.
    """
    place = RunFolder(tmp_path, resume=True)
    path = tmp_path / CHECKPOINT_FILE
    before, after = small_model(), small_model()
    while before.time < 0.1:
        before.advance(0.1)
    place.save(pack(before, Progress([before.snapshot()], np.zeros(2), (1.0, 1.0))))

    def read() -> None:
        arrays = place.load()
        assert arrays is not None
        unpack(arrays, after, (0.1, 1.0), str(path))

    assert not refused(read, path)
    if member >= 0:
        repack(path, mutate, member)
    else:
        path.write_bytes(mutate(path.read_bytes()))
    if refused(read, path):
        return
    for name, array in after.state().items():
        assert member >= 0 or array.tobytes() == before.state()[name].tobytes()
        assert np.isfinite(array).all() or name == "clock"
    assert not clock_fault(after.state()["clock"].astype(np.float64), 0.1, 1.0)
