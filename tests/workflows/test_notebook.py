"""The notebook, cell by cell: every one runs, and what its last line gives can be shown."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.result import Result

NOTEBOOK = Path(__file__).parents[2] / "workflows" / "gallery" / "notebook.ipynb"


def shown_of(source: str, names: dict[str, object]) -> object:
    """Run a cell; the value of its last line if that is an expression, as a notebook shows it."""
    tree = ast.parse(source)
    last = tree.body[-1]
    if not isinstance(last, ast.Expr):
        exec(compile(tree, "cell", "exec"), names)
        return None
    tree.body.pop()
    exec(compile(tree, "cell", "exec"), names)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_every_cell_runs_and_nothing_is_stored() -> None:
    """Outputs are not kept in the file. Scene, flow and result have tables, figures a picture."""
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    assert notebook["nbformat"] == 4
    names: dict[str, object] = {}
    shown: list[object] = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
            shown.append(shown_of("".join(cell["source"]), names))
    tables = [one for one in shown if hasattr(one, "_repr_html_")]
    assert {ec.Scene, ec.FlowField, Result} <= {type(one) for one in tables}
    pictures = [one._repr_png_() for one in shown if hasattr(one, "_repr_png_")]
    assert len(pictures) == 2
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
    # Mass is kept within the domain, to rounding.
    assert abs(float(str(getattr(shown[-1], "values", 0.0))) - 1.0) < 1e-10
