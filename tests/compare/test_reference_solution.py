"""The reference refines all that it errs by, and further than any run that it measures."""

from __future__ import annotations

from itertools import pairwise

import pytest

from ellipsoid_coupling.compare import reference_solution
from ellipsoid_coupling.compare.resolutions import Refinement, make_refinement
from ellipsoid_coupling.compare.timing import Bench
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SCHEMES
from ellipsoid_coupling.scenes import load_scene

# No yardstick is stored for other times than the scene's own.
SHORT = load_scene("rotation", {"times": [1.0]})


def refined_levels(monkeypatch: pytest.MonkeyPatch, flow: FlowField) -> Refinement:
    """The levels that the reference of a short `rotation` climbs, without running them."""
    seen: list[Refinement] = []

    def run_levels(refinement: Refinement, bench: Bench) -> None:
        del bench
        seen.append(refinement)
        raise RunError("seen")

    monkeypatch.setattr(reference_solution, "_finest", run_levels)
    bench = Bench(flow, 0, 1.0)
    with pytest.raises(RunError, match="seen"):
        reference_solution.make_reference(SHORT, ("mckean_vlasov",), bench)
    return seen[0]


def test_each_level_refines_the_interaction(
    monkeypatch: pytest.MonkeyPatch, rotation_flow: FlowField
) -> None:
    """Else the distance of the last two, the reference's uncertainty, could not see its error."""
    levels = refined_levels(monkeypatch, rotation_flow).levels
    tolerances = [level.scene.numerics.harmonics_tolerance for level in levels]
    assert all(finer == pytest.approx(0.5 * coarser) for coarser, finer in pairwise(tolerances))
    steps = [level.scene.numerics.tolerance for level in levels]
    assert steps == sorted(steps, reverse=True)
    counts = [level.scene.particles.realisations for level in levels]
    assert max(counts) == counts[-1] > counts[-2]


def test_no_run_is_measured_with_its_own_nodes(
    monkeypatch: pytest.MonkeyPatch, rotation_flow: FlowField
) -> None:
    """Equal nodes and harmonics err alike: their distance would be agreement with itself."""
    finest = refined_levels(monkeypatch, rotation_flow).levels[-1].scene
    for scheme in SCHEMES:
        runs = make_refinement(SHORT, "mckean_vlasov", scheme).levels
        least = min(run.scene.numerics.harmonics_tolerance for run in runs)
        assert finest.numerics.harmonics_tolerance < least
        assert finest.numerics.tolerance <= min(run.scene.numerics.tolerance for run in runs)
