"""Realisations that cannot be split among points are refused before anything is written."""

from __future__ import annotations

from pathlib import Path

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.sweeps import Sweep, Where, run_sweep, scene_table
from ellipsoid_coupling.sweeps.description import checked_lists
from tests.sweeps.small import MODEL, small_sweep

WITH_INLET = ["sweep", "channel", "--model", MODEL, "--realisations", "0:4:2"]


def test_inlets_feed_realisations_unlike_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One message: the option, the reason, the scene, and what to do instead."""
    out = tmp_path / "sweep"
    with pytest.raises(SystemExit) as ended:
        main([*WITH_INLET, "--out", str(out)])
    assert ended.value.code == InputError.exit_status
    told = capsys.readouterr().err
    for words in ("--realisations", "without inlets", "inlets in channel", "--seeds A:B"):
        assert words in told
    assert "Traceback" not in told
    assert not out.exists()


def test_an_inlet_at_one_value_of_the_sweep_is_found(tmp_path: Path) -> None:
    """The second value opens an inlet: the first of its points, number 2 of 4, is named."""
    kinds = ['{kind = "remove"}', '{kind = "inlet", density = 0.5}']
    table = {
        "models": [MODEL], "keys": ["boundaries.inlet"], "values": [kinds], "realisations": [0, 4, 2],
    }  # fmt: skip
    sweep = Sweep(checked_lists(table, "sweep"), scene_table(ec.load_scene("cylinder")))
    with pytest.raises(InputError, match=r"^point 2-.*without inlets"):
        run_sweep(sweep, tmp_path / "sweep", Where(workers=1))
    assert not (tmp_path / "sweep").exists()


def test_samples_of_one_density_are_not_split(tmp_path: Path) -> None:
    sweep = small_sweep(models=["mckean_vlasov"], realisations=[0, 2, 1])
    with pytest.raises(InputError, match=r"independent realisations.*one density"):
        run_sweep(sweep, tmp_path / "sweep", Where(workers=1))
