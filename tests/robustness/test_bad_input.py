"""Bad input, made by hand: status 2, one line that names place, expectation and finding, no trace."""

from __future__ import annotations

import gzip
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.scenes import load_scene, scene_to_toml
from tests.command_line import FLOW
from tests.robustness.conftest import within_limits

DATA = Path(__file__).parents[1] / "data"
RUN = ["--model", "microscopic"]
RHO, Q = (["plan", "cavity", "--model", m, "--set"] for m in ("rho_mono_kinetic", "q_mono_kinetic"))
# Makes the input in a folder and gives the command that is to refuse it.
Make = Callable[[Path], list[str]]


def text_scene(text: str | bytes) -> Make:
    """A scene file with this content."""

    def make(folder: Path) -> list[str]:
        path = folder / "my.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return ["run", str(path), *RUN, *FLOW, "--out", str(folder / "out")]

    return make


def edited_scene(old: str, new: str) -> Make:
    """The cavity's scene with one text in it replaced."""
    text = scene_to_toml(load_scene("cavity"))
    assert old in text
    return text_scene(text.replace(old, new, 1))


def setting(*settings: str, model: str = "microscopic", scene: str = "cavity") -> Make:
    """`run` with --set."""
    return lambda folder: [
        "run", scene, "--model", model, "--set", *settings, *FLOW, "--out", str(folder / "out"),
    ]  # fmt: skip


def option(*options: str) -> Make:
    """`run cavity` with these options."""
    return lambda folder: ["run", "cavity", *RUN, *FLOW, *options, "--out", str(folder / "out")]


def command(*tokens: str) -> Make:
    """A command; {} stands for the folder."""
    return lambda folder: [token.replace("{}", str(folder)) for token in tokens]


def special(make: Callable[[Path], object], name: str = "thing.toml") -> Make:
    """A scene that is no ordinary file."""

    def made(folder: Path) -> list[str]:
        make(folder / name)
        return ["run", str(folder / name), *RUN, "--out", str(folder / "out")]

    return made


def flow_file(make: Callable[[Path], object], name: str = "flow.npz") -> Make:
    """--flow with something that is no flow."""

    def made(folder: Path) -> list[str]:
        make(folder / name)
        path = str(folder / name)
        return ["run", "cavity", *RUN, "--flow", path, "--out", str(folder / "out")]

    return made


def saved_flow(**changed: object) -> Make:
    """A saved flow with some of its arrays replaced."""

    def make(path: Path) -> None:
        analytic_flow("shear").save(path)
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files} | changed
        np.savez(path, **arrays)

    return flow_file(make)


def case(file: str, old: str, new: str | bytes, source: str = "cavity_16") -> Make:
    """--flow with a solved case, one text (a pattern) in one file of it replaced."""

    def make(path: Path) -> None:
        shutil.copytree(DATA / source, path, ignore=shutil.ignore_patterns("VTK"))
        data = (path / file).read_bytes()
        replacement = new if isinstance(new, bytes) else new.encode()
        changed, count = re.subn(old.encode(), lambda _: replacement, data, count=1)
        assert count == 1
        (path / file).write_bytes(changed)

    return flow_file(make, "case")


def packed_case(content: Callable[[bytes], bytes]) -> Make:
    """--flow with a solved case whose U is gzip'ed and then changed."""

    def make(path: Path) -> None:
        shutil.copytree(DATA / "cavity_16", path, ignore=shutil.ignore_patterns("VTK"))
        plain = path / "3.95" / "U"
        (path / "3.95" / "U.gz").write_bytes(content(plain.read_bytes()))
        plain.unlink()

    return flow_file(make, "case")


def case_with(folder: str) -> Make:
    """--flow with a solved case that has a folder more."""

    def make(path: Path) -> None:
        shutil.copytree(DATA / "graded", path)
        (path / folder).mkdir(parents=True)

    return flow_file(make, "case")


def vtk(file: str, old: str, new: str) -> Make:
    """--flow with foamToVTK's files, one text (a pattern) in one of them replaced."""

    def make(path: Path) -> None:
        shutil.copytree(DATA / "cavity_16" / "VTK" / "cavity_16_79", path)
        text, count = re.subn(old, new, (path / file).read_text("utf-8"), count=1)
        assert count == 1
        (path / file).write_text(text, "utf-8")

    return flow_file(make, "case_79")


def result(content: bytes | None) -> Make:
    """`figures` of a run folder whose result.nc holds this; None: no such file."""

    def make(folder: Path) -> list[str]:
        (folder / "run").mkdir()
        if content is not None:
            (folder / "run" / "result.nc").write_bytes(content)
        return ["figures", str(folder / "run"), "--out", str(folder / "out")]

    return make


def special_result(make: Callable[[Path], object]) -> Make:
    """`figures` of a run folder whose result.nc is no ordinary file."""

    def made(folder: Path) -> list[str]:
        (folder / "run").mkdir()
        make(folder / "run" / "result.nc")
        return ["figures", str(folder / "run"), "--out", str(folder / "out")]

    return made


def resumed(name: str, make: Callable[[Path], object], *options: str) -> Make:
    """`run --resume` in a folder that holds one thing."""

    def made(folder: Path) -> list[str]:
        (folder / "run").mkdir()
        make(folder / "run" / name)
        return ["run", "rotation", *RUN, "--resume", *options, "--out", str(folder / "run")]

    return made


def run_toml(run: str) -> Make:
    """A run.toml with this [run]."""
    scene = load_scene("cavity")
    sections = scene_to_toml(scene).replace("\n[", "\n[scene.")
    return text_scene(f"[run]\n{run}\n[versions]\n[scene]\n{sections}")


def _link_to_itself(path: Path) -> None:
    path.symlink_to(path)


U, POINTS, FACES = "3.95/U", "constant/polyMesh/points", "constant/polyMesh/faces"
OWNER, NEIGHBOUR = "constant/polyMesh/owner", "constant/polyMesh/neighbour"
BOUNDARY = "constant/polyMesh/boundary"
FIRST_COUNT = r"(?<=\n)\d+(?=\n\()"
LID = "boundary/lid.vtp"
OBJECTS = np.array([{"a": 1}], object)

BAD: dict[str, tuple[Make, str]] = {
    # Scene files.
    "empty scene": (text_scene(""), r"key name: expected a value"),
    "no toml": (text_scene("name = = 3"), r"my\.toml: expected a TOML file.*line 1"),
    "no utf-8": (text_scene(b"name = 'a'\n\xff\xfe"), r"line 2: .*UTF-8, found byte 0xff"),
    "zero bytes": (text_scene(b"\0" * 100), r"my\.toml: expected a TOML file"),
    "truncated scene": (text_scene('name = "a'), r"my\.toml: expected a TOML file"),
    "deep lists": (text_scene("a = " + "[" * 100_000), r"nested more than 50 deep"),
    "deep keys": (text_scene("a." * 400 + "b = 1"), r"nested more than 50 deep"),
    "a large file": (text_scene("# " + "x" * 2_000_000), r"at most 1 MB, found more"),
    "digits": (text_scene("seed = " + "9" * 5000), r"my\.toml: expected a TOML file"),
    "section is a value": (edited_scene("[start]", "[star]"), r"star.*an unknown key|start"),
    "unknown key": (edited_scene("mass =", "mas ="), r"particles\.mas: expected one of"),
    "nan": (edited_scene("mass = 1.0", "mass = nan"), r"particles\.mass.*finite"),
    "infinity": (edited_scene("mass = 1.0", "mass = inf"), r"particles\.mass.*finite"),
    "beyond range": (edited_scene("mass = 1.0", "mass = 1e300"), r"between 1e-100 and 1e\+100"),
    "name is a path": (edited_scene('"cavity"', '"../../x"'), r"key name: expected a name"),
    "name is too long": (edited_scene('"cavity"', f'"{"x" * 300}"'), r"at most 100 letters"),
    "title with escapes": (edited_scene("Driven", "\\u001b[2J"), r"key title.*printable"),
    "device": (command("run", "/dev/zero", *RUN), r"/dev/zero: expected a scene file.*device"),
    "folder": (special(Path.mkdir), r"thing\.toml: expected a scene file.*found a folder"),
    "pipe": (special(os.mkfifo), r"thing\.toml: expected a scene file.*found a named pipe"),
    "link circle": (special(_link_to_itself), r"a loop of symbolic links"),
    "zero byte in a path": (command("run", "a\0b", *RUN), r"scene a\\x00b: expected"),
    # --set.
    "times of 1e99": (setting("times=[1e99]"), r"time_step of at least 1e-15 of the last"),
    "times of 1e300": (setting("times=[1e300]"), r"times\.0: expected a size between"),
    "times twice": (setting("times=[1.0, 1.0]"), r"increasing times"),
    "no domain": (setting("domain.x=[0.0, 0.0]"), r"x = \[low, high\] with low < high"),
    "no room": (setting("domain.x=[1e50, 1.0000000000000002e50]"), r"differ by more than round"),
    "sides twice": (setting('walls.sides=["left", "left"]'), r"each of sides once"),
    "no sides": (setting("walls.sides=[]"), r"walls\.sides.*at least 1 in brackets"),
    "start outside": (setting("start.x=[0.9, 1.5]"), r"start\.x within domain\.x"),
    "three bounds": (setting("start.x=[0.4, 0.5, 0.6]"), r"start\.x"),
    "10^12 particles": (setting("particles.number=1000000000000"), r"1\.28e\+14 particles.*TB"),
    "10^400 particles": (setting(f"particles.number={10**400}"), r"less than or equal to"),
    "tiny cells": (setting("numerics.cell=1e-9", model="rho_mono_kinetic"), r"1e\+18 cells"),
    "tiny cells, planned": (command(*RHO, "numerics.cell=1e-9"), r"1e\+18 cells"),
    "cells of 1e-99, planned": (command(*Q, "numerics.cell=1e-99"), r"e\+\d+ cells"),
    "huge cells, planned": (command(*Q, "numerics.cell=1e99"), r"divides the domain"),
    "10^9 angles": (
        setting("numerics.angle_cells=1000000000", model="q_mono_kinetic"), r"numerics\.angle_cells",
    ),
    "tiny particles": (
        setting("particles.length=1e-9", "particles.width=1e-9"), r"cells of half a reach.*TB",
    ),
    "10^6 angles": (setting("numerics.angle_cells=1000000"), r"angle_cells.* 36000, found 1000000"),
    "no CFL number": (setting("numerics.cfl=1e-9"), r"numerics\.cfl: expected greater .*1e-09"),
    "no tolerance": (setting("numerics.tolerance=1e-30"), r"numerics\.tolerance.* found 1e-30"),
    "true time": (setting("times=true"), r"key times: .*found True"),
    "cell > domain": (setting("numerics.cell=3.0", model="diffusive"), r"divides the domain"),
    "no setting at all": (setting(), r"--set: expected key=value, found nothing"),
    "no equals": (setting("particles.number"), r"--set: expected key=value"),
    "deep setting": (setting("x=" + "[" * 5000), r"nested more than 50 deep"),
    "unknown field": (
        command("run", "top_bottom", *RUN, "--set", "flow.field=nowhere"), r"one of top_bottom",
    ),
    # Options.
    "negative seed": (option("--seed", "-1"), r"--seed: expected a whole number"),
    "no number": (option("--seed", "abc"), r"(?i)abc"),
    "half a seed": (option("--seed", "1.5"), r"--seed: expected a whole number, found '1\.5'"),
    "seed of 64 bits": (option("--seed", str(2**63)), r"--seed: expected a whole number from 0"),
    "half a realisation": (option("--realisations", "1.5"), r"expected a whole number, A:B .*found '1\.5'"),
    "no realisation": (option("--realisations", "0"), r"--realisations: expected a whole number"),
    "half a cell": (command("flow", "cavity", "--cells", "8.5"), r"--cells: expected a whole number"),
    "half a process": (
        command("flow", "cavity", "--processes", "1.5"), r"--processes: expected a whole number",
    ),
    "half a particle": (setting("particles.number=1.5"), r"particles\.number.*integer"),
    "half an angle": (setting("numerics.angle_cells=12.5"), r"angle_cells.*integer"),
    "cells in words": (setting("flow.cells=64.0"), r"flow\.cells.*integer"),
    "10^15 realisations": (option("--realisations", str(10**15)), r"particles, which take"),
    "10^20 realisations": (option("--realisations", f"0:{10**20}"), r"0 <= A < B <= .*found '0:1000"),
    "10^20 from A to B": (option("--realisations", f"0:{10**18 + 1}"), r"--realisations: expected A:B"),
    "10^400 cells": (command("flow", "cavity", "--cells", str(10**400)), r"at most 1000000000 cells"),
    "10^400 processes": (command("flow", "cavity", "--processes", str(10**400)), r"cores of this"),
    "10^5000 cells": (command("flow", "cavity", "--cells", "9" * 5000), r"number, found '9+ \.\.\. 9+'"),
    "no time": (option("--longest", "0"), r"--longest: expected seconds above 0"),
    "no number of seconds": (option("--longest", "nan"), r"--longest: .*found nan"),
    "unknown model": (command("run", "cavity", "--model", "../x"), r"--model: expected one of"),
    "endless": (command("compare", "cavity", "--longest", "inf"), r"--longest: expected finite"),
    "out is a file": (
        lambda folder: [*setting("times=[0.1]")(folder)[:-1], str(DATA / "make_flow_data.py")],
        r"make_flow_data\.py: expected a folder, or a new name, found a file",
    ),
    "out below a file": (
        command("flow", "cavity", "--out", str(DATA / "make_flow_data.py" / "a")), r"the file .* in",
    ),
    "out too long": (command("flow", "cavity", "--out", "{}/" + "x" * 300), r"too long"),
    "out with a zero": (command("stability", "--out", "a\0b"), r"the name of a folder"),
    "10^9 fluid cells": (command("flow", "cavity", "--cells", str(10**9)), r"1e\+09|1000000000"),
    "10^9 processes": (command("flow", "cavity", "--processes", str(10**9)), r"cores of this"),
    # Saved flows.
    "empty npz": (flow_file(Path.touch), r"flow\.npz: expected a flow"),
    "pickled": (saved_flow(coefficients=OBJECTS), r"array coefficients.*Python objects"),
    "nan in a flow": (saved_flow(coefficients=np.full((4, 4), np.nan)), r"coefficients\[0, 0\]"),
    "wrong shape": (saved_flow(mask=np.ones((7, 7), np.uint8)), r"coefficients \(ny\+3, nx\+3\)"),
    "wrong kind": (saved_flow(mask=np.ones((1, 1))), r"found .*mask \(<f8\)"),
    "wrong limits": (saved_flow(numbers=np.arange(8.0)), r"numbers: expected a rectangle"),
    "endless flow": (command("run", "cavity", *RUN, "--flow", "/dev/zero"), r"/dev/zero"),
    # OpenFOAM cases.
    "U is nan": (case(U, r"\(0\.000135\S+", "(nan"), r"3\.95/U, entry 0 of internalField.*nan"),
    "U is huge": (case(U, r"\(0\.000135\S+", "(1e300"), r"entry 0 of internalField"),
    "count of 10^12": (case(U, r"\n256\n", "\n1000000000000\n"), r"U, line 22: expected 256"),
    "one value less": (case(U, r"\(-0\.0002\S+ \S+ 0\)\n", ""), r"256 values.*found 255"),
    "two components": (case(U, r" -0\.00013\S+ 0\)", " 0)"), r"U, line 24: expected values"),
    "wrong dimensions": (case(U, r"\[0 1 -1", "[0 2 -1"), r"key dimensions.*\[0 2 -1"),
    "wrong class": (case(U, "volVectorField", "volScalarField"), r"key class: expected volVector"),
    "wrong format": (case(U, "ascii", "utf-16"), r"key format: expected ascii or binary"),
    "no header": (case(U, "FoamFile", "FoamFil"), r"U, line 8: expected FoamFile"),
    "no patch": (case(U, r"\n    lid\n", "\n    lit\n"), r"an entry for patch lid, found none"),
    "open string": (case(U, r'0\)";', "0);"), r"U, line \d+.*text out of place"),
    "empty U": (case(U, r"(?s)\A.*\Z", ""), r"U, line 1: expected FoamFile, found the end"),
    "corner 10^12": (case(FACES, r"4\(1 18", "4(1 999999999999"), r"faces, line 21: expected faces"),
    "corner twice": (case(FACES, r"4\(1 18", "4(1 1"), r"faces, corner \d+: .*corners differ"),
    "wrong corner": (case(FACES, r"4\(1 18", "4(2 18"), r"cells closed by their faces"),
    "points missing": (case(POINTS, r"\(0 0 0\)\n", ""), r"points, line \d+: expected 578 points"),
    "one layer": (case(POINTS, FIRST_COUNT, "1"), r"points"),
    "owner of none": (case(OWNER, r"\(\n0\n", "(\n-1\n"), r"owner, face 0: expected cells"),
    "owner 10^9": (case(OWNER, r"\(\n0\n", "(\n1000000000\n"), r"owner, face 0: expected cells"),
    "neighbours": (case(NEIGHBOUR, FIRST_COUNT, "99999"), r"neighbour.*expected 99999 neighb"),
    "patch of 10^9 faces": (case(BOUNDARY, r"nFaces +16", "nFaces 999999999"), r"boundary, patch"),
    "patch name": (case(BOUNDARY, r"    lid\n", "    ../../lid\n"), r"boundary, line \d+"),
    "binary cut": (
        case(U, r"(?s)(?<=.{3000}).*\Z", "", "cavity_16_binary"), r"U, byte \d+: expected \d+ bytes",
    ),
    "binary big-endian": (
        case(U, "LSB", "MSB", "cavity_16_binary"), r"key arch: expected LSB.*found MSB",
    ),
    "gzip cut": (packed_case(lambda u: gzip.compress(u)[:-500]), r"U\.gz.*truncated gzip"),
    "gzip damaged": (packed_case(lambda u: b"\x1f\x8b\x08" + u), r"U\.gz.*damaged gzip"),
    "gzip bomb": (packed_case(lambda _: gzip.compress(b" " * 300_000_000, 1)), r"U\.gz, line 1: "),
    "U is a folder": (
        case_with("9/U"),
        r"9/U: expected an OpenFOAM file U, found a folder",
    ),
    # foamToVTK's files.
    "vtk points": (vtk(LID, "NumberOfPoints='34'", "NumberOfPoints='99999999'"), r"lid\.vtp"),
    "vtk declaration": (vtk(LID, "<VTKFile", "<!DOCTYPE a []><VTKFile"), r"a declaration"),
    "vtk cells": (vtk("internal.vtu", "NumberOfCells='256'", "NumberOfCells='x'"), r"found x"),
    "vtk base64": (vtk(LID, "\nmAE", "\n!AE"), r"lid\.vtp.*expected base64"),
    # Run folders.
    "no result": (result(None), r"its result\.nc, found a folder without one"),
    "empty result": (result(b""), r"result\.nc: expected a result file, found no checksum"),
    "no hdf5": (result(b"\x89HDF\r\n\x1a\n" * 100), r"result\.nc: expected a result file"),
    "result is a pipe": (special_result(os.mkfifo), r"result\.nc: .*found a named pipe"),
    "result is a folder": (special_result(Path.mkdir), r"result\.nc: .*found a folder"),
    "result is a circle": (special_result(_link_to_itself), r"result\.nc.*symbolic links"),
    "result is endless": (
        special_result(lambda path: path.symlink_to("/dev/zero")), r"result\.nc: .*found a device",
    ),
    "resumed elsewhere": (resumed("thesis.tex", Path.touch), r"a run\.toml, found .*thesis\.tex"),
    "resumed without its run.toml": (
        resumed("checkpoint.npz", Path.touch), r"a run\.toml, found .*checkpoint\.npz",
    ),
    "run.toml is a pipe": (resumed("run.toml", os.mkfifo), r"run\.toml: .*found a named pipe"),
    "run.toml is a folder": (resumed("run.toml", Path.mkdir), r"run\.toml: .*found a folder"),
    "checkpoint is a folder": (
        resumed("checkpoint.npz", Path.mkdir, "--force"), r"checkpoint\.npz: .*found a folder",
    ),
    "run.toml seed": (run_toml("seed = -3"), r"my\.toml, \[run\], key seed"),
    "run.toml model": (run_toml("model = 3"), r"my\.toml, \[run\], key model"),
    "run.toml unknown": (run_toml("python = 'os'"), r"key python: expected one of"),
}  # fmt: skip


def tree(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.rglob("*"))


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_in_one_line_and_leaves_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make, told = BAD[name]
    monkeypatch.chdir(tmp_path)
    tokens = make(tmp_path)
    before = tree(tmp_path)
    with within_limits(), pytest.raises(SystemExit) as ended:
        main(tokens)
    err = capsys.readouterr().err
    assert ended.value.code == 2, err
    message = [line for line in err.splitlines() if line.startswith("ellipsoid: ")]
    assert len(message) == 1, err
    assert re.search(told, message[0]), err
    assert "Traceback" not in err
    assert tree(tmp_path) == before


EXTREME = [
    ["particles.inertia=1e-8"],
    ["flow.drag=1e8", "flow.angular_drag=1e8"],
    ["interaction.strength=1e6"],
    ["particles.width=5e-14"],
    ["walls.strength_factor=1e6"],
    ["start.angle=1e9"],
    ["times=[1e4]"],
    ["particles.number=1"],
]


@pytest.mark.parametrize("settings", EXTREME, ids=" ".join)
def test_what_is_extreme_but_means_something_is_accepted(
    settings: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["plan", "cavity", "--set", *settings])
    assert not ended.value.code
    assert "interaction" in capsys.readouterr().out
