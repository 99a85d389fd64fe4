"""What is simulated, as data: a validated `Scene`, its files, and the terms that follow from it."""

from ellipsoid_coupling.scenes.files import (
    builtin_scenes,
    load_scene,
    parse_setting,
    scene_from_table,
    scene_to_toml,
)
from ellipsoid_coupling.scenes.scene import Scene
from ellipsoid_coupling.scenes.terms import Term, Terms, explain_terms, terms_of

__all__ = [
    "Scene",
    "Term",
    "Terms",
    "builtin_scenes",
    "explain_terms",
    "load_scene",
    "parse_setting",
    "scene_from_table",
    "scene_to_toml",
    "terms_of",
]
