"""Labels are as short as tells results apart."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ellipsoid_coupling.output.labels import (
    flow_numbers,
    model_name,
    print_warnings,
    result_labels,
)
from ellipsoid_coupling.result import Result


def test_one_result_a_model_needs_its_model_only(
    particle_result: Result, rho_result: Result
) -> None:
    assert result_labels([particle_result, rho_result]) == ["microscopic", "rho, mono-kinetic"]


def test_repeated_labels_grow_by_what_differs(particle_result: Result, rho_result: Result) -> None:
    paper = replace(rho_result, scheme="paper")
    finer = replace(paper, attributes=paper.attributes | {"resolution": "h = 0.1"})
    assert result_labels([particle_result, rho_result, paper, finer]) == [
        "microscopic",
        "rho, mono-kinetic, accurate",
        "rho, mono-kinetic, paper, h = 0.125",
        "rho, mono-kinetic, paper, h = 0.1",
    ]


def test_what_all_share_is_left_out(rho_result: Result) -> None:
    seeds = [replace(rho_result, attributes=rho_result.attributes | {"seed": s}) for s in (1, 2)]
    assert result_labels(seeds) == ["rho, mono-kinetic, seed 1", "rho, mono-kinetic, seed 2"]


def test_runs_of_one_scene_are_told_apart_by_their_flows(rho_result: Result) -> None:
    runs = [
        replace(rho_result, attributes=rho_result.attributes | {"flow_digest": digest})
        for digest in ("b", "a", "b")
    ]
    assert flow_numbers(runs) == ["flow 1", "flow 2", "flow 1"]
    assert result_labels(runs[:2]) == ["rho, mono-kinetic, flow 1", "rho, mono-kinetic, flow 2"]


def test_what_nothing_tells_apart_is_numbered(particle_result: Result, rho_result: Result) -> None:
    """Files are named after labels: no two may be alike."""
    labels = result_labels([rho_result, particle_result, rho_result])
    assert labels == ["rho, mono-kinetic, run 1", "microscopic", "rho, mono-kinetic, run 3"]


def test_unknown_models_keep_their_name() -> None:
    assert model_name("something_new") == "something_new"


def test_what_runs_tell_is_printed_beside_their_names(
    particle_result: Result, rho_result: Result, capsys: pytest.CaptureFixture[str]
) -> None:
    print_warnings([particle_result, rho_result])
    assert capsys.readouterr().out == ""
    told = replace(rho_result, attributes=rho_result.attributes | {"warnings": "One.\nTwo."})
    print_warnings([particle_result, told])
    printed = capsys.readouterr().out
    assert "One." in printed
    assert "Two." in printed
    assert "microscopic" not in printed
