"""What the package makes of solved cases: read or not, how far off, and whether each model runs.

    python workflows/case_table.py [CASE...] [--models NAME...] [--seconds 30]

For each case: `ellipsoid new`, then a short run of each model on the new scene, by the command line as a
user types it. The table goes to standard output, in Markdown. Without cases: the plane laminar tutorials of
OpenFOAM, which are solved for it, and the cases of tests/data.
"""

from __future__ import annotations

import argparse
import re
import signal
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from solved_tutorials import solve_all

from ellipsoid_coupling.cli import main as ellipsoid
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.models import model_names
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.scenes import load_scene

DATA = Path(__file__).parents[1] / "tests" / "data"
SMALL = ("particles.number=100", "particles.realisations=1")
# Models without a time of their own are asked for nothing here.
LEFT_OUT = ("stationary_state",)
# Coarse: the least number of cells along the shorter side, and for models with angles.
_CELLS, _ANGLES = 16, 8
_MISFIT = re.compile(r"([\d.e+-]+ %) off U")
_SLIP = re.compile(r"up to ([\d.e+-]+ %) of its largest at walls")


class TooLong(Exception):
    """A command took more processor time than it may."""


def command(*tokens: str, seconds: float) -> tuple[int, str, str]:
    """Status, standard output and the last line of standard error of an `ellipsoid` command.

    In this process, so that each kernel is loaded once; `seconds` are those of the processor.
    """

    def ends(_number: int, _frame: object) -> None:
        raise TooLong

    out, told, status = StringIO(), StringIO(), 0
    before = signal.signal(signal.SIGVTALRM, ends)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        with redirect_stdout(out), redirect_stderr(told):
            ellipsoid(list(tokens))
    except TooLong:
        return -1, "", f"longer than {seconds:g} s"
    except SystemExit as ended:
        status = int(ended.code or 0)
    except Exception as error:  # a bug, which the table is to show
        return 1, "", f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    lines = [line for line in told.getvalue().splitlines() if line.startswith("ellipsoid:")]
    return status, out.getvalue(), lines[-1].removeprefix("ellipsoid: ") if lines else ""


def row(case: Path, models: Sequence[str], seconds: float) -> list[str]:
    """The cells of one case's row."""
    name = f"{case.parent.name}/{case.name}" if case.name == "case" else case.name
    with tempfile.TemporaryDirectory() as scratch:
        scene = Path(scratch) / "scene.toml"
        whys = [""]
        for option in ("", "--divergence", "--allow-misfit"):
            if option and option not in whys[-1]:
                continue
            status, _, why = command(
                "new", str(case), "--out", str(scene), *option.split(), seconds=seconds
            )
            if status == 0:
                break
            whys.append(why.replace(f"{case.parent}/", ""))
        if status:
            return [name, f"refused: {whys[-1]}", "", "", *("" for _ in models)]
        origin = scene.read_text(encoding="utf-8").splitlines()[1]
        found = [pattern.search(origin) for pattern in (_MISFIT, _SLIP)]
        rms, slip = (match[1] if match else "0" for match in found)
        verdicts = [verdict(scene, case, model, seconds) for model in models]
        return [name, f"with {option}" if option else "yes", slip, rms, *verdicts]


def narrow(rows: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    """The same table with one column for all models: those that do not run are named."""
    head, *others = rows
    found = [(*head[:4], ", ".join(head[4:]))]
    for cells in others:
        names: dict[str, list[str]] = {}
        for name, what in zip(head[4:], cells[4:], strict=True):
            names.setdefault(what, []).append(name)
        if len(names) == 1:
            told = [f"all {what}".replace("all runs", "all run") for what in names if what]
        else:
            told = [f"{', '.join(some)} {what}" for what, some in names.items() if what != "runs"]
            told += ["the others run"] * ("runs" in names)
        found.append((*cells[:4], "; ".join(told)))
    return found


def verdict(scene: Path, case: Path, model: str, seconds: float) -> str:
    """What a short run of a model on a scene came to."""
    domain = load_scene(scene).domain
    numerics = load_scene(scene).numerics
    factor = max(1, int(min(domain.width, domain.height) / numerics.cell / _CELLS))
    while factor > 1 and any(
        round(side / numerics.cell) % factor for side in (domain.width, domain.height)
    ):
        factor -= 1
    first = load_scene(scene).times[0]
    settings = [*SMALL, f"numerics.cell={factor * numerics.cell!r}", f"times=[{first!r}]"]
    settings += [f"numerics.angle_cells={_ANGLES}"]
    out = scene.with_name(model)
    status, told, why = command(
        "run", str(scene), "--model", model, "--flow", str(case), "--allow-misfit", "--out", str(out),
        "--set", *settings, seconds=seconds,
    )  # fmt: skip
    if status == 0:
        return "runs"
    why = (why or told[-80:]).replace(f"{case.parent}/", "").replace(f"{scene.parent}/", "")
    return f"{'refused' if status == 2 else 'fails'}: {why}"


def table(
    cases: Iterable[Path], models: Sequence[str], seconds: float
) -> Iterator[tuple[str, ...]]:
    """The rows of a table, its head first."""
    yield ("case", "read", "slip", "rms", *models)
    with ProgressReporter("cases") as report:
        for case in cases:
            report(f"reading {case.name}", 0.0)
            yield tuple(row(case, models, seconds))


def all_models() -> list[str]:
    """The models that have a row."""
    return [name for name in model_names() if name not in LEFT_OUT]


def known_cases(folder: Path) -> Iterator[Path]:
    """The tutorials, which are solved in `folder`, and the solved cases of tests/data."""
    yield from solve_all(folder)
    yield from sorted(path.parent.parent for path in DATA.glob("*/system/controlDict"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--models", nargs="*", choices=all_models(), default=all_models())
    parser.add_argument("--seconds", type=float, default=120.0)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        cases = options.cases or known_cases(Path(scratch))
        for number, cells in enumerate(table(cases, options.models, options.seconds)):
            print("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |", flush=True)
            if number == 0:
                print("|" + "---|" * len(cells))
    return 0


if __name__ == "__main__":
    run_in_words(main)
