"""Markdown from what the code says of itself: docstrings, the command line, public names."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import app
from ellipsoid_coupling.models import model_kinds

sys.path.append(str(Path(__file__).parents[1]))
import cluster_plan

# What is registered from outside, in the order of the pages that show how.
REGISTER = (
    "ellipsoid_coupling.flow.register_flow",
    "ellipsoid_coupling.physics.outer.register",
    "ellipsoid_coupling.physics.angular.register",
    "ellipsoid_coupling.physics.closure.register_pressure",
    "ellipsoid_coupling.geometry.boundaries.register_boundary",
    "ellipsoid_coupling.finite_volume.fluxes.contract.register_flux",
    "ellipsoid_coupling.finite_volume.fluxes.contract.register_face_flux",
    "ellipsoid_coupling.finite_volume.fluxes.register_flux_name",
)


def docstring(module: str) -> str:
    """The docstring of a module: its paragraphs as text, what is indented there as it stands."""
    text = inspect.getdoc(importlib.import_module(module))
    if text is None:
        raise ValueError(f"{module} has no docstring")
    return f"*{module.removeprefix('ellipsoid_coupling.')}*\n\n" + "\n".join(_blocks(text)) + "\n"


def _blocks(text: str) -> Iterator[str]:
    """Paragraphs, and fences around runs of indented and empty lines."""
    lines = text.splitlines()
    # An empty line belongs to the indented lines on both sides of it.
    inside = [bool(line) and line[0] == " " for line in lines]
    for k, line in enumerate(lines):
        if not line:
            after = next((inside[j] for j in range(k, len(lines)) if lines[j]), False)
            inside[k] = after and k > 0 and inside[k - 1]
    for indented, group in groupby(zip(lines, inside, strict=True), key=lambda pair: pair[1]):
        block = [line for line, _ in group]
        if indented:
            yield from (
                "",
                "```text",
                *inspect.cleandoc("\n" + "\n".join(block)).splitlines(),
                "```",
                "",
            )
        else:
            yield from (line.replace("<", "\\<").replace("*", "\\*") for line in block)


def command_line() -> str:
    """All commands with their arguments and options."""
    text = str(app.generate_docs(output_format="markdown"))
    # The page has its own title and table of contents.
    return text[text.index("## ellipsoid ") :]


def python_api() -> str:
    """Directives of sphinx for the public names, errors last."""
    paths = [f"ellipsoid_coupling.{name}" for name in ec.__all__]
    errors = [path for path in paths if _is_error(path)]
    others = [path for path in paths if path not in errors]
    return f"{''.join(map(_directive, others))}## Errors\n\n{''.join(map(_directive, errors))}"


def _is_error(path: str) -> bool:
    thing = _named(path)
    return isinstance(thing, type) and issubclass(thing, Exception)


def _named(path: str) -> object:
    module, _, name = path.rpartition(".")
    thing: object = getattr(importlib.import_module(module), name)
    return thing


def registration() -> str:
    """Directives of sphinx for what adds something from outside."""
    return "".join(map(_directive, REGISTER))


def _directive(path: str) -> str:
    is_class = isinstance(_named(path), type)
    kind = "exception" if _is_error(path) else "class" if is_class else "function"
    # Methods of the package's own bases too, but not those of pydantic's models and of tuples.
    members = "   :members:\n   :inherited-members: BaseModel,tuple,object\n"
    members = members + "   :exclude-members: model_config\n" if kind == "class" else ""
    # Shown under the name that a user imports it by, though defined elsewhere.
    return f"```{{eval-rst}}\n.. auto{kind}:: {path}\n{members}```\n\n"


def models() -> str:
    """A table of all models: name, what it holds, whether noise moves it, its equation's first line."""
    lines = ["| model | holds | noise | overdamped |", "|---|---|---|---|"]
    holds = {"particles": "particles", "rho": "fields of (x, y)", "q": "fields of (x, y, theta)"}
    for kind in model_kinds():
        noise = "moves particles" if kind.random_motion else "damps only"
        overdamped = "yes" if kind.overdamped else "no"
        lines.append(f"| `{kind.name}` | {holds[kind.layout]} | {noise} | {overdamped} |")
    return "\n".join(lines) + "\n"


GENERATED: dict[str, Callable[[], str]] = {
    "command line": command_line,
    "python api": python_api,
    "registration": registration,
    "models": models,
    "cluster plan": cluster_plan.table,
}
