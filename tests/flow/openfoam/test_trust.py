"""Who gets in: nothing of a case reaches the solver but words and numbers that are known."""

from __future__ import annotations

import ast
import gzip
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.openfoam import solve, trust
from ellipsoid_coupling.flow.openfoam.solve import solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder
from ellipsoid_coupling.flow.openfoam.trust import PlainCase, plain_case
from tests.flow.openfoam.strangers import edit, refused, stranger
from tests.flow.openfoam.ways_in import CODE, HEADERS

FILES = (
    "0.orig/U", "0.orig/p", "constant/transportProperties", "system/blockMeshDict",
    "system/controlDict", "system/decomposeParDict", "system/fvSchemes", "system/fvSolution",
    "system/parameters",
)  # fmt: skip


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """A stranger's copy of the cavity, on 16 cells."""
    return stranger(tmp_path / "own")


@pytest.mark.parametrize("name", CODE)
def test_code_is_refused_with_file_and_line(name: str, case: Path) -> None:
    """Behind a valid dictionary, packed or not; the line is that of the text, or of its end."""
    path = case / "system" / "controlDict"
    text = path.read_text("utf-8")
    first, last = text.count("\n") + 1, (text + CODE[name]).count("\n") + 1
    data = (text + CODE[name]).encode("latin-1")
    path.write_bytes(data)
    error = refused(case, r"system/controlDict, line")
    assert first <= int(error.where.rpartition("line ")[2]) <= last
    assert "--trust" in error.remedy
    path.unlink()
    path.with_name("controlDict.gz").write_bytes(gzip.compress(data))
    assert refused(case, r"system/controlDict\.gz, line").found == error.found


@pytest.mark.parametrize("name", HEADERS)
def test_a_header_decides_nothing(name: str, case: Path) -> None:
    path = case / "system" / "controlDict"
    text = path.read_text("utf-8").partition("}")[2]
    path.write_text(HEADERS[name] + text, "utf-8")
    refused(case, "controlDict, line 1")


@pytest.mark.parametrize("name", FILES)
def test_code_is_refused_in_every_file(name: str, case: Path) -> None:
    (case / name).write_text("\n\na #calc 1;\n" + (case / name).read_text("utf-8"), "utf-8")
    assert refused(case, "the directive #calc").where == f"{case / name}, line 3"


def test_files_that_nobody_needs(case: Path) -> None:
    """Those that could be meant to change the flow are refused; others are not looked at, nor copied."""
    (case / "constant" / "fvOptions").write_text("#codeStream", "utf-8")
    refused(case, "constant/fvOptions: expected nothing but transportProperties in constant")
    (case / "constant" / "fvOptions").rename(case / "constant" / "turbulenceProperties")
    (case / "Allrun").write_text("touch marker", "utf-8")
    (case / "system" / ".controlDict.swp").write_bytes(b"\0")
    names = [name for name in FILES if name[0] != "0"]
    names += [f"{start}/{field}" for start in ("0", "0.orig") for field in ("U", "p")]
    assert sorted(plain_case(case, None, 1).files) == sorted(names)


def test_bounds_are_looked_at_before_anything_is_parsed(case: Path) -> None:
    """A dictionary of more than 1 MB is none, packed or not; 10^18 cells are refused by their number."""
    path = case / "system" / "fvSchemes"
    path.unlink()
    path.with_name("fvSchemes.gz").write_bytes(gzip.compress(b"x 1;\n" * 10**6))
    refused(case, r"fvSchemes\.gz: expected .* of at most 1 MB, unpacked")
    (case / "system" / "fvSchemes").symlink_to("/dev/zero")
    refused(case, "fvSchemes: .*a device")
    path.unlink()
    shutil.copy(case_folder("cavity") / "system" / "fvSchemes", path)
    edit(case / "system" / "blockMeshDict", "($cells $cells 1)", "(999999999 999999999 1)")
    with pytest.raises(InputError, match="a mesh that fits into"):
        solve_case(case)


# 300 kB each; what is looked through once for each of its parts would take hours.
LONG = {
    "lists without blanks": "x (" + "(b)" * 100_000 + ");",
    "numbers": "x (" + "1 " * 150_000 + ");",
    "entries": "".join(f"a{k} $cells;" for k in range(20_000)),
    "copies": "s { " + "".join(f"a{k} 1; " for k in range(50)) + "} "
    + "".join(f"b{k} {{ $s; }} " for k in range(15_000)),
    "comments": "/* * */ " * 40_000 + "x 1;",
    "an open comment": "x 1; /* " + "/*" * 150_000,
    "a list of numbers": f"x nonuniform List<vector> 40000 ({'(1 2 3) ' * 40_000});",
    "open lists of numbers": "x (" + "List<scalar> 1(1) " * 15_000 + ");",
    "one word": "x" * 300_000,
    "one number": "x " + "1" * 300_000 + ";",
    "strings": "x (" + '"a b" ' * 50_000 + ");",
    "open units": "x (" + "[0 1 -1 " * 40_000 + ");",
}  # fmt: skip


@pytest.mark.parametrize("name", LONG)
def test_long_dictionaries_are_looked_through_once(name: str, case: Path) -> None:
    (case / "system" / "fvSchemes").write_text('#include "parameters"\n' + LONG[name], "utf-8")
    refused(case, "system/fvSchemes")


@pytest.mark.parametrize("text", ["1 " * 260_000, f'"{"a" * 900}" ' * 3_000])
def test_starts_have_a_bounded_number_of_parts(text: str, case: Path) -> None:
    """Up to 30 MB are read; lists of numbers apart, no start has that many parts."""
    (case / "0.orig" / "U").write_text(f"x ({text});", "utf-8")
    refused(case, "0.orig/U, line 1: .* more than 250000 entries and values")


def test_no_copy_multiplies_a_list_of_numbers(case: Path) -> None:
    """30 MB would become gigabytes."""
    path = case / "0.orig" / "U"
    big = f"a {{ type fixedValue; value nonuniform List<vector> 99 ({'(1 0 0)' * 99}); }}\n"
    edit(path, "boundaryField\n{", f"boundaryField\n{{\n{big}b {{ $a; }}\n")
    refused(case, r"0.orig/U, line 16: .*\$a, where no small dictionary a stands before")


def _unknown(text: str, known: set[str]) -> set[str]:
    """The tokens of a written file that are neither numbers nor known, parentheses or not."""
    tokens = set(re.split(r"[\s{};\[\]]+", text))
    return {
        token for token in tokens
        if token not in known and (bare := token.strip("()")) not in known
        and not re.fullmatch(r"(-?[\d.]+(e[+-]?\d+)?)?", bare)
    }  # fmt: skip


MODULES = ("trust", "tables", "start", "blocks", "rules", "run_control", "applications")


def _known_words() -> set[str]:
    """All words that stand in the tables of what a plane laminar case needs."""
    found: set[str] = set()
    for name in MODULES:
        tree = ast.parse((Path(trust.__file__).parent / f"{name}.py").read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found |= {node.value, *re.split(r"[\s{};\[\]()]+", node.value)}
    return found


KNOWN = _known_words()
NAMES = {"lid", "walls", "frontAndBack", "own", "coded_1"}
EXPRESSION = re.compile(r'valueExpr "[a-z0-9.,()+*/-]*"')


def _assert_plain(plain: PlainCase) -> None:
    for name, text in plain.files.items():
        rest = EXPRESSION.sub("valueExpr", text) if name.endswith("/U") else text
        assert not set(rest) & set("#$\"'\\/%~^&`"), (name, rest)
        own = set() if name == "system/controlDict" else NAMES
        if name == "system/parameters":
            own = {line.split()[0] for line in rest.splitlines()}
        assert not _unknown(rest, KNOWN | own), (name, rest)


PIECES = [
    *CODE.values(), *HEADERS.values(), *FILES, "libs", "(mine)", "functions", "{", "}", "(", ")",
    ";", "#", "$", '"', "/", "*", "//", "/*", "*/", "\\", "'", "\n", " ", "1", "-1e3", "own", "coded_1",
    "type", "coded", "$cells", "$p;", '#include "parameters"', '#eval "1+1"', "uniform", "nonuniform",
    "List<vector> 1((1 2 3))", "wall", "own { type wall; faces ((0 1 2 3)); }", "[0 1]", "x",
    "own { type noSlip; }", "#{", "#}", "\0", "\xff", "value uniform (0 0 0);", "noSlip",
]  # fmt: skip


@settings(
    max_examples=300, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
@given(
    file=st.sampled_from(FILES),
    edits=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(PIECES)), max_size=3
    ),
)
def test_what_is_accepted_is_written_from_known_words_only(
    case: Path, file: str, edits: list[tuple[float, int, str]]
) -> None:
    """Any text put anywhere, instead of up to 12 characters: refused, or gone from what is written."""
    path = case / file
    before = path.read_text("utf-8")
    text = before
    for place, length, piece in edits:
        at = int(place * len(text))
        text = text[:at] + piece + text[at + length :]
    path.write_text(text, "latin-1")
    try:
        _assert_plain(plain_case(case, None, 1))
    except InputError:
        pass
    finally:
        path.write_text(before, "utf-8")


def test_the_command_refuses_and_trust_lets_it_pass(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (case / "system" / "fvSchemes").write_text("\n#codeStream", "utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["flow", str(case), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "system/fvSchemes, line 2: expected plain words" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    # Trusted, it goes on to what comes next: OpenFOAM, which is not there.
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SystemExit) as ended:
        main(["flow", str(case), "--trust", "--out", str(tmp_path / "out")])
    assert ended.value.code == 1
    assert "OpenFOAM is missing" in capsys.readouterr().err
    monkeypatch.setattr(solve, "plain_case", lambda *_: pytest.fail("asked though trusted"))
    with pytest.raises(SystemExit):
        main(["flow", str(case), "--trust"])
