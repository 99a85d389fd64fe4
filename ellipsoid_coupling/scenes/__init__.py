"""What is simulated, as data: a validated `Scene`, its files, and the terms that follow from it."""

from ellipsoid_coupling.scenes.files import (
    builtin_scenes,
    load_run_part,
    load_scene,
    parse_setting,
    parse_toml,
    run_part_from_table,
    scene_from_table,
    scene_to_toml,
    set_key,
)
from ellipsoid_coupling.scenes.scene import RunPart, Scene
from ellipsoid_coupling.scenes.terms import Term, Terms, explain_terms, terms_of

__all__ = [
    "RunPart",
    "Scene",
    "Term",
    "Terms",
    "builtin_scenes",
    "explain_terms",
    "load_run_part",
    "load_scene",
    "parse_setting",
    "parse_toml",
    "run_part_from_table",
    "scene_from_table",
    "scene_to_toml",
    "set_key",
    "terms_of",
]
