"""Code in OpenFOAM cases: reading runs nothing of it, solving is refused, file and line are named."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import openfoam
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.openfoam import case_folder, solve_case
from ellipsoid_coupling.flow.reader import read_case
from ellipsoid_coupling.flow.trust import find_code, refuse_code
from tests.robustness.conftest import within_limits

DATA = Path(__file__).parents[1] / "data"
# Each makes the file `marker` if it runs.
TOUCH = 'system("touch marker")'
CODE = {
    "#codeStream": f"a #codeStream {{ code #{{ {TOUCH}; #}}; }};",
    "#calc": 'a #calc "1";',
    "#calc after a comment": 'a /* ; */ #calc // "\n "1";',
    "#unknown": "#unknown x",
    "coded condition": "lid { type codedFixedValue; value uniform 0; }",
    "coded in quotes": 'lid { type "coded"; }',
    "coded, stripped": 'lid { type "co ded"; }',
    "coded function": f"functions {{ f {{ type coded; codeExecute #{{ {TOUCH}; #}}; }} }}",
    "coded source": "s { type scalarCodedSource; }",
    "code alone": "code #{ int i; #};",
    "libs": 'libs ("libmine.so");',
    "libs, own and another": "libs (utilityFunctionObjects mine);",
    "libs by path": 'libs ("./libutilityFunctionObjects.so");',
    "libs, expanded": "libs ($mine);",
    "libs, a pattern": '"l.bs" (mine);',
    "systemCall": 'functions { s { type systemCall; executeCalls ("touch marker"); } }',
    "allowSystemOperations": "InfoSwitches { allowSystemOperations 1; }",
    "files exchanged": "functions { t { type timeActivatedFileUpdate; } }",
    "expansion, nested": "type ${a${b}};",
    "expansion, default": "type ${a:-coded};",
    "expansion, joined": "type co$a;",
    "expansion in a string": 'x "${a:-coded}";',
    "#include, absolute": '#include "/tmp/other"',
    "#include, above": '#include "../../other"',
    "#include, home": '#include "~/other"',
    "#include, environment": '#include "$HOME/other"',
    "#includeEtc, above": '#includeEtc "../../other"',
    "#includeFunc, above": "#includeFunc ../../other",
    # Where OpenFOAM's tokenizer and another one could see different things.
    "string's end": 'x "a\\\\"; // " ; libs (mine);',
    "comment at a name": "x $y// ; libs (mine);\n;",
    "comment in #eval": 'x #eval { 1 // } ; libs ("mine");\n };',
    "open comment": "/* libs (mine);",
    "open string": 'x "libs (mine);',
    "zero byte": "x \0;",
    "lone quote": "x 'coded';",
    "nested": "{" * 60,
    "circle": '#include "controlDict"',
}


def own_case(folder: Path) -> Path:
    return Path(shutil.copytree(case_folder("cavity"), folder / "own"))


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gzip"])
@pytest.mark.parametrize("name", CODE)
def test_a_case_with_code_is_refused_with_file_and_line(
    name: str, packed: bool, tmp_path: Path
) -> None:
    case = own_case(tmp_path)
    path = case / "system" / "controlDict"
    text = path.read_text("utf-8")
    line = text.count("\n") + 1
    data = (text + CODE[name]).encode()
    path.write_bytes(data)
    if packed:
        path.unlink()
        path.with_name("controlDict.gz").write_bytes(gzip.compress(data))
    with within_limits(), pytest.raises(InputError, match=r"system/controlDict") as caught:
        refuse_code(case)
    assert int(caught.value.where.rpartition("line ")[2]) in (line, line + 1)
    assert "--trust" in caught.value.remedy


def test_code_is_found_wherever_a_run_would_take_it_from(tmp_path: Path) -> None:
    for k, name in enumerate(("0.orig/U", "constant/deep/er/x", "system/parameters")):
        (tmp_path / str(k)).mkdir()
        case = own_case(tmp_path / str(k))
        path = case / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n\n#calc 1\n" + (path.read_text("utf-8") if path.exists() else ""))
        assert [(f.file, f.line, f.what) for f in find_code(case)] == [(name, 3, "#calc")]


def test_scripts_and_compiled_code_beside_the_dictionaries(tmp_path: Path) -> None:
    case = own_case(tmp_path)
    assert not list(find_code(case))  # Allrun and Allclean are the package's, word by word
    (case / "Allrun").write_text("#!/bin/sh\ntouch marker\n")
    (case / "run.sh").write_text("#!/bin/sh\ntouch marker\n")
    (case / "libx.so").write_bytes(b"\x7fELF")
    (case / "dynamicCode").mkdir()
    found = {finding.file: finding.what for finding in find_code(case)}
    assert set(found) == {"Allrun", "run.sh", "libx.so", "dynamicCode"}


def test_circles_of_inclusion_and_binary_files(tmp_path: Path) -> None:
    case = own_case(tmp_path)
    (case / "system" / "a").write_text('#include "b"\n')
    (case / "system" / "b").write_text('\n#include "a"\n')
    with pytest.raises(InputError, match=r"system/b, line 2: .*circle of #include over system/a"):
        refuse_code(case)
    (case / "system" / "a").write_text("FoamFile { format binary; }\n")
    with pytest.raises(InputError, match=r"system/a, line 1: .*binary"):
        refuse_code(case)


def test_links_pipes_and_endless_files_in_a_case(tmp_path: Path) -> None:
    case = own_case(tmp_path)
    (case / "system" / "endless").symlink_to("/dev/zero")
    with within_limits(), pytest.raises(InputError, match=r"endless: .*a device"):
        refuse_code(case)
    (case / "system" / "endless").unlink()
    (case / "system" / "self").symlink_to(case)
    with within_limits(), pytest.raises(InputError, match="links to folders"):
        refuse_code(case)


def test_the_packages_own_cases_need_no_trust_and_nothing_else_is_taken_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = sorted(path.name for path in BUILT_IN.iterdir() if path.is_dir())
    assert names == ["cavity", "rotation", "top_bottom"]
    for name in names:
        assert not list(find_code(BUILT_IN / name))
    # A folder of that name where the program is started is not taken for the package's own.
    evil = tmp_path / "cavity"
    shutil.copytree(case_folder("cavity"), evil)
    (evil / "system" / "x").write_text("#calc 1")
    monkeypatch.chdir(tmp_path)
    assert case_folder("cavity") == BUILT_IN / "cavity"
    with pytest.raises(InputError, match="#calc"):
        solve_case(evil)
    with pytest.raises(InputError, match="#calc"):
        solve_case("./cavity")


def test_the_command_refuses_and_trust_lets_it_pass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    case = own_case(tmp_path)
    (case / "system" / "x").write_text("\n#codeStream")
    with pytest.raises(SystemExit) as ended:
        main(["flow", str(case), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "system/x, line 2: expected a case that cannot run code, found #codeStream" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()
    # Trusted, it goes on to what comes next: OpenFOAM, which is not there.
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SystemExit) as ended:
        main(["flow", str(case), "--trust", "--out", str(tmp_path / "out")])
    assert ended.value.code == 1
    assert "OpenFOAM is missing" in capsys.readouterr().err
    monkeypatch.setattr(openfoam, "refuse_code", lambda _: pytest.fail("asked though trusted"))
    with pytest.raises(SystemExit):
        main(["flow", str(case), "--trust"])


def test_reading_a_solved_case_runs_nothing_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it at once, in dictionaries, in U and in a script: the field is the same, no marker."""
    case = Path(shutil.copytree(DATA / "cavity_16", tmp_path / "case"))
    everything = "\n".join(CODE.values())
    (case / "system" / "controlDict").write_text(everything)
    (case / "system" / "functions").write_text(everything)
    (case / "Allrun").write_text("#!/bin/sh\ntouch marker\n")
    (case / "dynamicCode").mkdir()
    u = case / "3.95" / "U"
    text = u.read_text("utf-8")
    coded = (
        f"type codedFixedValue; libs (mine); code #{{ {TOUCH}; }} #}};\n"
        f"x #codeStream {{ code #{{ {TOUCH}; #}}; }};\n"
        'refValue #calc "1";\n#include "/tmp/other"\n'
    )
    assert "type            exprFixedValue;" in text
    u.write_text(text.replace("type            exprFixedValue;", coded))
    monkeypatch.chdir(case)
    before = sorted(tmp_path.rglob("*"))
    with within_limits():
        field = read_case(case)
    assert sorted(tmp_path.rglob("*")) == before
    own = read_case(DATA / "cavity_16")
    assert (field.arrays.coefficients == own.arrays.coefficients).all()
