"""Which code drew the pictures that pages and README show: a stamp for each of them.

workflows/pictures/stamps.json holds for every picture its checksum, the sentence of the run that made it
(day, machine, commit), and a digest of the modules that drew it. A test compares both with the picture
and the code at hand, so that no picture stands there that today's code would draw otherwise.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

from ellipsoid_coupling.files.writing import whole_file

TOP = Path(__file__).parents[1]
FIGURES = "ellipsoid_coupling.output.figures"
FILE = "stamps.json"

# The module that draws each picture; what it imports of `output` counts as well.
DRAWN_BY = {
    "advice.png": "advice",
    "angles_cavity_free.png": "angles",
    "density_cavity.png": "density",
    "density_cavity_free.png": "density",
    "directors_cavity.png": "directors",
    "elbow.png": "ellipses",
    "ellipses_cavity.png": "ellipses",
    "error_against_run_time_cavity_free.png": "frontier",
    "error_parts_cavity_free.png": "error_budget",
    "flow.png": "flow",
    "frontier_cavity_free.png": "frontier",
    "stability.png": "stability",
    "vortex_street.png": "ellipses",
    "walls.png": "density",
}


# Pictures of measurements that take a quiet machine and long: they may wait for the next one, drawn by
# earlier code, which their stamp says.
MAY_WAIT = (
    "advice.png",
    "error_parts_cavity_free.png",
    "frontier_cavity_free.png",
    "stability.png",
)
EARLIER = "earlier code"


def drawing_digest(picture: str) -> str:
    """Of the code that draws a picture, without docstrings and comments."""
    digest = hashlib.sha256()
    for module in sorted(_reached(f"{FIGURES}.{DRAWN_BY[picture]}")):
        digest.update(module.encode())
        digest.update(_code(_source(module)).encode())
    return digest.hexdigest()[:16]


def _reached(module: str) -> set[str]:
    """A module and all modules of the package's output that it needs, directly or not."""
    found, left = set(), [module]
    while left:
        name = left.pop()
        if name not in found and _source(name).is_file():
            found.add(name)
            left += _imported(_source(name))
    return found


def _imported(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_text("utf-8"))):
        module = node.module if isinstance(node, ast.ImportFrom) else None
        if module is not None and module.startswith("ellipsoid_coupling.output."):
            yield module


def _source(module: str) -> Path:
    return (TOP / module.replace(".", "/")).with_suffix(".py")


def _code(source: Path) -> str:
    """The syntax tree as text; documentation changes nothing of a picture."""
    tree = ast.parse(source.read_text("utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            told = ast.get_docstring(node, clean=False)
            node.body = node.body if told is None else node.body[1:]
    return ast.dump(tree)


def checksum(picture: Path) -> str:
    """Of the picture's bytes."""
    return hashlib.sha256(picture.read_bytes()).hexdigest()[:16]


def read_stamps(folder: Path) -> dict[str, dict[str, str]]:
    """The stamps of a folder of pictures; none where there is no such file."""
    path = folder / FILE
    stamps: dict[str, dict[str, str]] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    return stamps


def stamp_pictures(folder: Path, names: list[str], sentence: str) -> None:
    """Stamp these pictures of a folder as drawn by today's code."""
    stamps = read_stamps(folder)
    for name in names:
        stamps[name] = {
            "picture": checksum(folder / name),
            "drawn_by": drawing_digest(name),
            "made": sentence,
        }
    with whole_file(folder / FILE) as beside:
        beside.write_text(json.dumps(stamps, indent=1, sort_keys=True) + "\n", encoding="utf-8")
