"""`ellipsoid scenes`, `ellipsoid models` and `ellipsoid schema`: what there is, and how it is written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.options import print_lines
from ellipsoid_coupling.output.tables import print_table

if TYPE_CHECKING:
    from ellipsoid_coupling.output.fitting import Fitting
    from ellipsoid_coupling.scenes import Scene


def scenes() -> None:
    """List the built-in scenes: title, flow, the terms that run, and the models that fit."""
    from ellipsoid_coupling.output.fitting import fitting_models
    from ellipsoid_coupling.scenes import builtin_scenes, explain_terms, load_scene

    rows = []
    for name in builtin_scenes():
        scene = load_scene(name)
        terms = ", ".join(term.name for term in explain_terms(scene) if term.runs)
        rows.append((name, scene.title, _flow(scene), terms, _models(fitting_models(scene))))
    print_table("Built-in scenes", ("scene", "title", "flow", "terms that run", "models"), rows)
    print_lines("Why a term runs or not: ellipsoid plan SCENE --model MODEL.")


def _flow(scene: Scene) -> str:
    """The name of the flow, and whether it is a case or a formula."""
    if scene.flow is None:
        return "none"
    kind = "formula" if scene.flow.source == "closed_form" else "case"
    return f"{scene.flow.name} ({kind})"


def _models(fitting: Fitting) -> str:
    """The models that fit, or those that do not where they are fewer."""
    if len(fitting.left_out) >= len(fitting.fit):
        return ", ".join(fitting.fit)
    return "all" + (f" but {', '.join(fitting.left_out)}" if fitting.left_out else "")


def models() -> None:
    """List the models: what each one solves, its schemes, and what a scene must have for it."""
    from ellipsoid_coupling.models import SCHEMES, model_kinds

    schemes = ", ".join(SCHEMES)
    rows = [
        (
            kind.name,
            kind.solves or kind.label,
            f"{schemes} (the same)" if kind.equilibrium else schemes,
            kind.needs or "any scene",
        )
        for kind in model_kinds()
    ]
    print_table("Models", ("model", "solves", "schemes", "needs"), rows)
    print_lines("Which of them fit a scene: ellipsoid scenes, or ellipsoid run SCENE.")


def schema(
    *, out: Path | None = None, force: Annotated[bool, Parameter(negative="")] = False
) -> None:
    """Print the JSON schema of scene files, by which editors complete keys and mark mistakes.

    Put a line "#:schema ./scene.schema.json" into a scene file beside it; `new` with --schema does both.

    Parameters
    ----------
    out
        The file that it is written to, best scene.schema.json beside the scenes.
    force
        Overwrite it.
    """
    from ellipsoid_coupling.files.reading import is_folder
    from ellipsoid_coupling.output.new_scene import require_new
    from ellipsoid_coupling.output.scene_schema import schema_text, write_schema

    if out is None:
        print_lines(schema_text().rstrip("\n"))
        return
    if is_folder(out):
        raise InputError(str(out), "a file", "a folder", "Name a file, such as scene.schema.json.")
    require_new(out, force=force)
    write_schema(out)
    print_lines(str(out))
