"""Imports run one way, and each heavy library has its one place."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "ellipsoid_coupling"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# A part may import itself and what stands before it.
ORDER = [
    "errors",
    "files",
    "compiled",
    "scenes",
    "physics",
    "flow",
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
    "output",
    "options",
    "cli",
]
ONLY_IN = {
    "matplotlib": ("output/figures",),
    "pyvista": ("flow/openfoam/reader.py", "output/paraview"),
    "meshio": ("flow/openfoam/reader.py",),
    "subprocess": ("flow/openfoam",),
    "llvmlite": ("compiled",),
}
# Modules that stand beside the packages: the story, and how it is told.
LOOSE = 8
# What stands in models/ beside the models themselves.
SHARED_BY_MODELS = (
    "__init__",
    "base",
    "cell_model",
    "failure_site",
    "from_scene",
    "q_equation",
    "r_grid",
    "run_warnings",
)
# One reader, three sources of OpenFOAM data: see ellipsoid_coupling/flow.
GPL = {"foamlib", "fluidfoam", "PyFoam"}


def imported(source: Path) -> Iterator[str]:
    """The modules that a file imports; of ``from package import module``, the module."""
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            folder = PACKAGE.parent / node.module.replace(".", "/")
            for alias in node.names:
                is_module = (folder / f"{alias.name}.py").is_file()
                yield f"{node.module}.{alias.name}" if is_module else node.module


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
        places = ONLY_IN.get(top)
        assert places is None or relative(source).startswith(places), module


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_nothing_that_is_read_can_run_code(source: Path) -> None:
    """No pickle, no evaluated text; numpy's own reader, which can unpickle, is not used at all."""
    tops = {module.split(".")[0] for module in imported(source)}
    assert not tops & {"pickle", "marshal", "shelve", "dill", "joblib", "cloudpickle", "yaml"}
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "compile", "__import__", "np.load", "np.fromfile")
            allowed = [k.value for k in node.keywords if k.arg == "allow_pickle"]
            assert all(isinstance(a, ast.Constant) and a.value is False for a in allowed)


def test_few_modules_stand_beside_the_packages() -> None:
    assert len(list(PACKAGE.glob("*.py"))) <= LOOSE


def test_no_model_imports_another() -> None:
    for source in (PACKAGE / "models").glob("*.py"):
        if source.stem in SHARED_BY_MODELS:
            continue
        allowed = {f"ellipsoid_coupling.models.{shared}" for shared in SHARED_BY_MODELS}
        models = {m for m in imported(source) if m.startswith("ellipsoid_coupling.models")}
        assert models <= allowed, source.name


def test_scenes_import_none_of_the_package_but_how_to_read() -> None:
    for source in (PACKAGE / "scenes").glob("*.py"):
        for module in imported(source):
            if module.startswith("ellipsoid_coupling."):
                assert part(module) in ("scenes", "errors", "files"), (source.name, module)


@pytest.mark.parametrize("source", SOURCES, ids=relative)
def test_kernels_that_count_no_references_return_no_array(source: Path) -> None:
    """Their callers would take what comes out for counted: see `jit.view_kernel`."""
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.FunctionDef):
            kinds = [d.id for d in node.decorator_list if isinstance(d, ast.Name)]
            if {"view_kernel", "apart_kernel"} & set(kinds):
                assert node.returns is not None
                assert ast.unparse(node.returns) in ("None", "float", "int", "bool"), node.name
