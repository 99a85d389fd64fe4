"""The yardsticks of the package: one a built-in scene, and near to runs that share little with them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import bin_result, distance
from ellipsoid_coupling.compare.resolutions import changed
from ellipsoid_coupling.compare.yardsticks import FOLDER, Yardstick, find_yardstick
from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.flow.provide import SHIPPED

# How far each may be off at most, in density and angle, by its own account.
CLAIMED = {
    "rotation": (0.0025, 0.0065),
    "cavity": (0.016, 0.015),
    "top_bottom": (2e-4, 0.019),
    "stationary": (0.006, 0.005),
}


def flow_of(name: str) -> FlowField | None:
    if name == "stationary":
        return None
    return FlowField.load(SHIPPED / "cavity.npz") if name == "cavity" else analytic_flow(name)


def yardstick_of(name: str) -> Yardstick:
    found = find_yardstick(ec.load_scene(name), flow_of(name))
    assert found is not None
    return found


@pytest.mark.parametrize("name", CLAIMED)
def test_a_built_in_scene_has_one_that_claims_little_error(name: str) -> None:
    """Also the cavity in the field that is shipped, another run of the solver than its yardstick's."""
    found = yardstick_of(name)
    for errors, most in zip(found.error, CLAIMED[name], strict=True):
        assert 0.0 < errors.max() <= most
    assert found.bins.angle.sum(axis=-1) == pytest.approx(1.0, abs=1e-5)
    assert found.bins.density.sum(axis=-1).max() <= 1.0 + 1e-5
    assert found.origin.startswith("ellipsoid_coupling ")


def test_no_other_file_is_there() -> None:
    files = sorted(path.name for path in FOLDER.iterdir())
    assert [name.rsplit("-", 1)[0] for name in files] == sorted(CLAIMED)


def off(name: str, values: dict[str, Any]) -> Errors:
    """How far a run is off at its times, the first ones of the scene."""
    scene, yardstick = ec.load_scene(name), yardstick_of(name)
    result = ec.simulate(changed(scene, values), "mckean_vlasov", flow=flow_of(name), seed=99)
    count = result.times.size
    bins = yardstick.bins
    first = bins._replace(density=bins.density[:, :count], angle=bins.angle[:, :count])
    return distance(bin_result(result), first)[0]


def test_pair_sums_of_few_samples_agree_early() -> None:
    """No nodes, no harmonics, 48 x 48 samples and pair sums: 0.002, of density before all has met."""
    values = {"times": [0.75], "numerics.interaction": "direct", "particles.realisations": 2}
    found = off("top_bottom", values | {"numerics.tolerance": 1e-3})
    assert found.density[0] < 0.005
    assert found.angle[0] < 0.005


@pytest.mark.heavy
def test_pair_sums_agree() -> None:
    """16 000 samples of `rotation`, pair by pair: what lies between so few is 0.008 and 0.05 off."""
    values = {"numerics.interaction": "direct", "particles.realisations": 16}
    found = off("rotation", values | {"numerics.tolerance": 3e-4})
    assert found.density.max() < 0.012
    assert found.angle.max() < 0.06


@pytest.mark.heavy
def test_a_noisy_run_agrees_up_to_its_own_noise() -> None:
    """100 000 samples err by sqrt(2/pi) sum sqrt(p/S) over the bins; a tenth more, and their steps."""
    values = {"particles.realisations": 512, "numerics.tolerance": 1e-3}
    found, bins = off("stationary", values), yardstick_of("stationary").bins
    for kind in ("density", "angle"):
        masses = getattr(bins, kind).mean(axis=0)
        expected = np.sqrt(2.0 / np.pi) * np.sqrt(masses / 102_400).sum(axis=-1)
        assert np.all(getattr(found, kind) < 1.1 * expected + 0.004)
