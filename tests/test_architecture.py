"""Imports run one way, and each heavy library has its one place."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from ellipsoid_coupling.models import SCHEMES, model_names
from ellipsoid_coupling.physics.closure import PRESSURE

PACKAGE = Path(__file__).parents[1] / "ellipsoid_coupling"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# A part may import itself and what stands before it.
ORDER = [
    "errors",
    "files",
    "compiled",
    "scenes",
    "flow",
    "physics",
    "geometry",
    "interaction",
    "stepping",
    "finite_volume",
    "particles",
    "models",
    "result",
    "storage",
    "monitors",
    "simulation",
    "compare",
    "sweeps",
    "output",
    "options",
    "commands",
    "cli",
]
ONLY_IN = {
    "matplotlib": ("output/figures",),
    "pyvista": ("flow/openfoam/reader.py", "output/paraview"),
    "meshio": ("flow/openfoam/reader.py",),
    # Of the latter only how matplotlib tells that ffmpeg has failed.
    "subprocess": ("flow/openfoam", "output/figures/film.py"),
    "llvmlite": ("compiled",),
    "dask": ("sweeps/cluster.py",),
    "distributed": ("sweeps/cluster.py",),
}
# All that may be used of numba outside of compiled/: loops that threads share, and how many threads.
OF_NUMBA = {"prange", "get_num_threads", "set_num_threads"}
# Modules that stand beside the packages: the story, and how it is told.
LOOSE = 8
# Lines of a file; lines of a function without its docstring, comments and empty lines; its arguments.
LONGEST_FILE, LONGEST_FUNCTION, MOST_ARGUMENTS = 400, 50, 8
# Names of models, closures and schemes, and the files that may say them besides models/: registries of
# closures and of the particles' schemes, the default of a scene file, and `walls.ghost_density`, whose kind
# "paper" is no scheme.
MODEL_AND_SCHEME_NAMES = {*model_names(), *SCHEMES, *PRESSURE}
MAY_NAME: dict[str, set[str]] = {
    "physics/closure.py": set(PRESSURE),
    "particles/__init__.py": set(SCHEMES),
    "scenes/scene.py": {"accurate", "paper"},
    "interaction/walls.py": {"paper"},
    "compare/stability/cases.py": {"paper"},
}
# One reader, three sources of OpenFOAM data: see ellipsoid_coupling/flow.
GPL = {"foamlib", "fluidfoam", "PyFoam"}


@cache
def parsed(source: Path) -> ast.Module:
    return ast.parse(source.read_text())


def imported(source: Path) -> Iterator[str]:
    """The modules that a file imports; of ``from package import module``, the module."""
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            folder = PACKAGE.parent / node.module.replace(".", "/")
            for alias in node.names:
                is_module = (folder / f"{alias.name}.py").is_file()
                yield f"{node.module}.{alias.name}" if is_module else node.module


def for_types_only(source: Path) -> set[str]:
    """What a file imports under ``if TYPE_CHECKING``, and so never loads."""
    found: set[str] = set()
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for inner in node.body:
                if isinstance(inner, ast.Import):
                    found |= {alias.name for alias in inner.names}
                elif isinstance(inner, ast.ImportFrom) and inner.module:
                    found.add(inner.module)
    return found


def part(module: str) -> str:
    return f"{module}.".split(".")[1]


def relative(source: Path) -> str:
    return source.relative_to(PACKAGE).as_posix()


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_imports_run_one_way(source: Path) -> None:
    own = relative(source).split("/")[0].removesuffix(".py")
    if own in ("__init__", "__main__"):
        return
    for module in imported(source):
        if module.startswith("ellipsoid_coupling."):
            assert ORDER.index(part(module)) <= ORDER.index(own), module


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_heavy_libraries_have_one_place_and_no_gpl(source: Path) -> None:
    for module in imported(source):
        top = module.split(".")[0]
        assert top not in GPL
        places = None if module in for_types_only(source) else ONLY_IN.get(top)
        assert places is None or relative(source).startswith(places), module


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_only_the_engine_room_knows_the_compiler(source: Path) -> None:
    """Kernels are made by `compiled.jit`, formulas are chosen by `compiled.dispatch`."""
    if relative(source).startswith("compiled/"):
        return
    tree = parsed(source)
    assert not [m for m in imported(source) if m.startswith("numba.")]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "numba":
            assert {alias.name for alias in node.names} <= OF_NUMBA
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "numba":
            assert node.attr in OF_NUMBA, node.attr


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_nothing_that_is_read_can_run_code(source: Path) -> None:
    """No pickle, no evaluated text; numpy's own reader, which can unpickle, is not used at all."""
    tops = {module.split(".")[0] for module in imported(source)}
    assert not tops & {"pickle", "marshal", "shelve", "dill", "joblib", "cloudpickle", "yaml"}
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "compile", "__import__", "np.load", "np.fromfile")
            allowed = [k.value for k in node.keywords if k.arg == "allow_pickle"]
            assert all(isinstance(a, ast.Constant) and a.value is False for a in allowed)


def test_few_modules_stand_beside_the_packages() -> None:
    assert len(list(PACKAGE.glob("*.py"))) <= LOOSE


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_files_and_functions_are_short(source: Path) -> None:
    lines = source.read_text().splitlines()
    assert len(lines) <= LONGEST_FILE
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert code_lines(node, lines) <= LONGEST_FUNCTION, node.name
            taken = node.args
            given = taken.posonlyargs + taken.args + taken.kwonlyargs
            arguments = [one for one in given if one.arg not in ("self", "cls")]
            assert len(arguments) <= MOST_ARGUMENTS, node.name


def code_lines(function: ast.FunctionDef | ast.AsyncFunctionDef, lines: list[str]) -> int:
    first, end = function.lineno, function.end_lineno or function.lineno
    told: range = range(0)
    if ast.get_docstring(function) is not None:
        text = function.body[0]
        told = range(text.lineno, (text.end_lineno or text.lineno) + 1)
    kept = [lines[k - 1].strip() for k in range(first, end + 1) if k not in told]
    return sum(bool(line) and not line.startswith("#") for line in kept)


def is_model(source: Path) -> bool:
    """Whether a file of models/ names its class `MODEL`."""
    assigned = [node for node in parsed(source).body if isinstance(node, ast.Assign)]
    return any(
        isinstance(t, ast.Name) and t.id == "MODEL" for node in assigned for t in node.targets
    )


def test_no_model_imports_another() -> None:
    files = {source.stem: source for source in (PACKAGE / "models").glob("*.py")}
    models = {name for name, source in files.items() if is_model(source)}
    assert len(models) > 1
    for name in models:
        others = {f"ellipsoid_coupling.models.{other}" for other in models - {name}}
        assert not others & set(imported(files[name])), name


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_nobody_asks_for_the_name_of_a_model_or_scheme(source: Path) -> None:
    """Models and schemes declare properties (`ModelKind`, `Scheme`); their names stand in models/."""
    if relative(source).startswith("models/"):
        return
    constants = (node for node in ast.walk(parsed(source)) if isinstance(node, ast.Constant))
    named = {c.value for c in constants if isinstance(c.value, str)} & MODEL_AND_SCHEME_NAMES
    assert named <= MAY_NAME.get(relative(source), set())


def test_scenes_import_none_of_the_package_but_how_to_read() -> None:
    for source in (PACKAGE / "scenes").glob("*.py"):
        for module in imported(source):
            if module.startswith("ellipsoid_coupling."):
                assert part(module) in ("scenes", "errors", "files"), (source.name, module)


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_kernels_that_count_no_references_return_no_array(source: Path) -> None:
    """Their callers would believe the array counted: see `jit.kernel`."""
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.FunctionDef):
            kinds = {ast.unparse(decorator) for decorator in node.decorator_list}
            if "kernel(noalias=True)" in kinds:
                assert node.returns is not None
                assert ast.unparse(node.returns) in ("None", "float", "int", "bool"), node.name
