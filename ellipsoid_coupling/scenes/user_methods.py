"""What a user calls on a scene: a changed copy, its file, what print and notebooks show of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from ellipsoid_coupling.scenes.summary import Summarised, Summary
from ellipsoid_coupling.scenes.values import Part

if TYPE_CHECKING:
    from ellipsoid_coupling.scenes.scene import Scene


class SceneMethods(Summarised, Part):
    """Methods of `Scene` that the files of scenes make possible."""

    # Any: a value of a scene's key, which the key's own type checks.
    def with_(self, settings: Mapping[str, Any] | None = None, /, **more: Any) -> Scene:
        """A new scene with these keys changed; this one stays as it is.

        scene.with_({"numerics.cell": 0.01, "walls": None})

        Parameters
        ----------
        settings : mapping, optional
            Values by dotted key, as `load_scene` takes them; None takes a part out.
        **more
            The same as keywords: ``scene.with_(times=[1.0, 2.0])``.

        Raises
        ------
        InputError
            For an unknown key, or a value that does not fit.
        """
        from ellipsoid_coupling.scenes.files import load_scene

        # Without what follows from other keys, which may change.
        table = self.model_dump(exclude_unset=True, exclude_none=True)
        return load_scene(table, {**(settings or {}), **more})

    def to_toml(self) -> str:
        """The text of a scene file that `load_scene` reads back to an equal scene."""
        from ellipsoid_coupling.scenes.files import scene_to_toml

        return scene_to_toml(cast("Scene", self))

    def _summary(self) -> Summary:
        from ellipsoid_coupling.scenes.terms import explain_terms

        scene = cast("Scene", self)
        particles, domain = scene.particles, scene.domain
        size = f"{particles.length:g} x {particles.width:g}"
        times = [f"{time:g}" for time in scene.times]
        shown = times if len(times) <= 5 else [*times[:2], "...", times[-1]]
        copies = particles.realisations
        number = f"{particles.number} of {size}" + (
            f", {copies} realisations" if copies > 1 else ""
        )
        rows = [
            ("particles", number),
            ("times", ", ".join(shown)),
            ("domain", f"{list(domain.x)} x {list(domain.y)}"),
        ]
        running = [
            (term.name.replace("_", " "), term.why) for term in explain_terms(scene) if term.runs
        ]
        return Summary(f"Scene {scene.name}", rows + running)
