"""Which models fit which scenes: told by the models themselves, before anything is computed."""

from __future__ import annotations

import pytest

from ellipsoid_coupling.models import model_kinds
from ellipsoid_coupling.output.fitting import fitting_models
from ellipsoid_coupling.scenes import builtin_scenes, load_scene


@pytest.mark.parametrize("name", builtin_scenes())
def test_every_model_fits_or_has_a_reason(name: str) -> None:
    fitting = fitting_models(load_scene(name))
    names = [kind.name for kind in model_kinds()]
    assert sorted([*fitting.fit, *fitting.left_out]) == sorted(names)
    assert fitting.fit == [name for name in names if name in fitting.fit]
    assert "microscopic" in fitting.fit
    assert all("expected" in why for why in fitting.left_out.values())


def test_a_scene_with_a_fluid_has_no_stationary_state() -> None:
    assert "no [flow]" in fitting_models(load_scene("cavity")).left_out["stationary_state"]
    assert "stationary_state" in fitting_models(load_scene("stationary")).fit
