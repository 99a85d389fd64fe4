"""Advice on models whose errors and costs are known in closed form, and on a small scene."""

from __future__ import annotations

import shlex
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.compare import errors_against, exact_reference, timing
from ellipsoid_coupling.compare.advice import adviser, budget, reference
from ellipsoid_coupling.compare.cheapest import Kind
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import scheme_named
from ellipsoid_coupling.output.advice_report import advice_lines, advice_rows, write_advice
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, parse_setting

Floats = NDArray[np.float64]

CELLS = 20
BASE = np.full(CELLS**2, 1.0 / CELLS**2)
SECOND_ORDER, FIRST_ORDER, CLOSURE = 4.0, 1.2, 0.06
# h = 0.2, 0.1, 0.05, 0.025, 0.0125
SETTINGS: dict[str, Any] = {"times": [1.0], "numerics.cell": 0.05, "interaction": None}
SECONDS_AT_ONE_TENTH = 0.01


def pattern(first: int) -> Floats:
    """Mass moved between neighbouring bins: sum 0, L1 norm 1; disjoint ones for `first` 0, 80, ..."""
    values = np.zeros(CELLS**2)
    values[first : first + 60 : 2], values[first + 1 : first + 60 : 2] = 1 / 60, -1 / 60
    return values


def on_grid(scene: Scene, model: str, scheme: str, masses: Floats, **attributes: Any) -> Result:
    area = scene.domain.width * scene.domain.height / CELLS**2
    density = masses.reshape(1, CELLS, CELLS) / area
    variables = {"density": density, "mean_angle": np.zeros_like(density)}
    told = {"resolution": f"h = {scene.numerics.cell:g}"} | attributes
    return Result(scene, model, scheme, "rho", np.array(scene.times), variables, {}, told)


class Clock:
    """Stands for the module `time`: it moves only when told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


class Family:
    """In place of `simulate`: errors C h^p and a closure, a h^-3 seconds, on a clock of its own.

    late : a spacing at which a run takes a hundred times as long as the law says
    """

    def __init__(self, clock: Clock, late: float = 0.0) -> None:
        self.clock, self.late = clock, late
        self.seconds: list[float] = []

    def __call__(self, scene: Scene, model: str, scheme: str, **options: Any) -> Result:
        h = scene.numerics.cell
        closure = CLOSURE if model == "diffusive" else 0.0
        error = FIRST_ORDER * h if scheme == "paper" else SECOND_ORDER * h**2
        masses = BASE + closure * pattern(80) + error * pattern(0)
        seconds = SECONDS_AT_ONE_TENTH * (0.1 / h) ** 3 * (100.0 if h == self.late else 1.0)
        if scene.times[-1] == SETTINGS["times"][-1]:
            self.run(seconds, options["report"])
        return on_grid(scene, model, scheme, masses, wall_seconds=seconds)

    def run(self, seconds: float, report: Any) -> None:
        """Let the clock go on in a thousand steps, each of which is reported."""
        self.seconds.append(0.0)
        for part in range(1001):
            report("run", part / 1000)
            if part < 1000:
                self.clock.now += seconds / 1000
                self.seconds[-1] += seconds / 1000


def known(patch: pytest.MonkeyPatch, *models: str, late: float = 0.0, moves: float = 0.0) -> Family:
    """Make the models' errors and costs those of `Family`, against BASE.

    moves : how far the exact solution moves from one resolution to the next
    """
    clock = Clock()
    family = Family(clock, late)

    def exact(scene: Scene, _flow: object, side: int) -> Result:
        return on_grid(scene, "exact", "", BASE + moves / side * pattern(160))

    for module in (timing, budget):
        patch.setattr(module, "time", clock)
    patch.setattr(timing, "simulate", family)
    patch.setattr(reference, "exact_reference", exact)
    patch.setattr(adviser, "frontier_models", lambda: list(models))
    return family


def ask(error: float, **options: Any) -> ec.Advice:
    return ec.advise(ec.load_scene("rotation", SETTINGS), error=error, **options)


@pytest.mark.parametrize(
    ("error", "scheme", "cell"),
    [
        (0.2, "accurate", 0.2),  # 4 h^2 = 0.16
        (0.05, "accurate", 0.1),  # 0.04, and 1.2 h needs 0.025
        (0.02, "accurate", 0.05),
    ],
)
def test_the_cheapest_level_below_the_error_is_found(
    error: float, scheme: str, cell: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first h of the levels with C h^p <= E, over both schemes; its error and seconds are exact."""
    known(monkeypatch, "rho_mono_kinetic", "diffusive")
    advice = ask(error)
    assert advice.promised
    best = advice.best
    assert best is not None
    assert (best.model, best.scheme, best.scene.numerics.cell) == ("rho_mono_kinetic", scheme, cell)
    assert best.measured
    assert best.error.value == pytest.approx(SECOND_ORDER * cell**2, rel=1e-6)
    assert best.seconds.value == pytest.approx(SECONDS_AT_ONE_TENTH * (0.1 / cell) ** 3, rel=1e-9)


def test_what_no_budget_runs_is_extrapolated(monkeypatch: pytest.MonkeyPatch) -> None:
    """At h = 0.0125 a run takes 5.12 s, of 4: C h^2 and seconds follow from coarser runs."""
    family = known(monkeypatch, "rho_mono_kinetic")
    best = ask(0.002, seconds=4.0).best
    assert best is not None
    assert best.promised
    assert not best.measured
    assert best.scene.numerics.cell == 0.0125
    assert best.error.value == pytest.approx(SECOND_ORDER * 0.0125**2, rel=0.02)
    assert best.error.high <= 0.002
    assert best.seconds.value == pytest.approx(5.12, rel=1e-6)
    assert best.seconds.low < 5.12 < best.seconds.high
    assert sum(family.seconds) <= 4.0


def test_a_modelling_error_above_the_error_is_no_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    """A closure of 0.06 is found from three runs; finer ones are not tried."""
    family = known(monkeypatch, "diffusive")
    advice = ask(0.03)
    assert not advice.promised
    verdicts = {row.scheme: row.verdict for row in advice.rows}
    assert "modelling error of 0.06" in verdicts["accurate"]
    assert verdicts["paper"].startswith("no: ")
    assert "modelling error" in advice.reason
    # Three levels, three times each, of both schemes; the first order of `paper` may take one more.
    assert len(family.seconds) <= 24
    assert ask(0.08).promised


def test_what_the_reference_cannot_tell_is_no_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    """It moves by 40/384 - 40/768 = 0.052 at last, so that 0.04 is below what is known."""
    known(monkeypatch, "rho_mono_kinetic", moves=40.0)
    advice = ask(0.04)
    assert not advice.promised
    assert advice.reference_error == pytest.approx(40 / 384 - 40 / 768, rel=1e-6)
    assert "the reference itself" in advice.reason
    assert all(row.verdict.startswith("unknown: so is the reference") for row in advice.rows)
    assert "No promise of 0.04" in "\n".join(advice_lines(advice))


@pytest.mark.parametrize("late", [0.2, 0.1, 0.05])
def test_a_run_that_takes_longer_than_expected_is_stopped_within_the_budget(
    late: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted: all runs together take the seconds at most, and the thousandth after which they look."""
    family = known(monkeypatch, "rho_mono_kinetic", "diffusive", late=late)
    advice = ask(0.001, seconds=3.0)
    assert sum(family.seconds) <= 3.0 + 1e-3 * max(family.seconds) * 100.0
    assert advice.spent == pytest.approx(sum(family.seconds), rel=0.05)


def test_a_model_that_always_fails_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    family = known(monkeypatch, "rho_mono_kinetic", "diffusive")

    def failing(scene: Scene, model: str, scheme: str, **options: Any) -> Result:
        if model == "diffusive":
            raise RunError("it broke")
        return family(scene, model, scheme, **options)

    monkeypatch.setattr(timing, "simulate", failing)
    advice = ask(0.05)
    assert advice.promised
    assert [why for _, why in advice.left_out] == 2 * ["failed: it broke"]


def test_the_command_gives_the_scene_that_was_advised(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read back word by word, settings of the user's own included."""
    known(monkeypatch, "rho_mono_kinetic")
    advice = ask(0.02)
    words = shlex.split(advice.command)
    at = words.index("--set")
    assert words[:at] == [
        "ellipsoid", "run", "rotation", "--model", "rho_mono_kinetic", "--scheme", "accurate",
    ]  # fmt: skip
    assert advice.best is not None
    settings = dict(map(parse_setting, words[at + 1 :]))
    assert ec.load_scene("rotation", settings) == advice.best.scene


def test_the_report_tells_all_rows(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    known(monkeypatch, "rho_mono_kinetic", "diffusive")
    advice = ask(0.02)
    assert len(advice_rows(advice)) == len(advice.rows) == 4
    write_advice(advice, tmp_path)
    assert advice.command in (tmp_path / "advice.txt").read_text()
    lines = (tmp_path / "advice.csv").read_text().splitlines()
    assert len(lines) == 5
    assert lines[1].startswith("rho_mono_kinetic,accurate,h = 0.05,")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--error", "0"], "--error"),
        (["--error", "2"], "--error"),
        (["--error", "nan"], "--error"),
        (["--error", "0.1", "--seconds", "0"], "--seconds"),
        (["--error", "0.1", "--seconds", "inf"], "--seconds"),
        (["--error", "0.1", "--quantity", "mass"], "quantity"),
        ([], "--error"),
    ],
)
def test_bad_input_is_refused(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["advise", "rotation", *words])
    assert ended.value.code == 2
    assert told in capsys.readouterr().err


SMALL: dict[str, Any] = {
    "interaction": None, "particles.number": 100, "particles.realisations": 16, "numerics.cell": 0.05,
    "times": [0.5],
}  # fmt: skip


@pytest.mark.parametrize(
    ("error", "quantity"), [(0.3, "density"), (0.1, "density"), (0.1, "angle")]
)
def test_advice_on_a_small_scene_holds(
    error: float, quantity: Kind, rotation_flow: FlowField, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The promised error is kept against an exact solution of more points, by whichever run is advised.

    Clocks decide which run is the cheapest; the seconds never end.
    """
    models = ("microscopic", "rho_mono_kinetic")
    monkeypatch.setattr(adviser, "frontier_models", lambda: list(models))
    scene = ec.load_scene("rotation", SMALL)
    advice = ec.advise(scene, error=error, quantity=quantity, seconds=1e6, flow=rotation_flow)
    best = advice.best
    assert best is not None
    assert best.promised
    result = ec.simulate(best.scene, best.model, scheme_named(best.scheme).name, flow=rotation_flow)
    found = errors_against(result, exact_reference(scene, rotation_flow, side=320))
    assert float(getattr(found, quantity).max()) <= error
    assert best.resolution == result.attributes["resolution"]
