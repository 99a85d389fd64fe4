"""What ``ellipsoid advise`` prints and writes: a short table, the recommendation, advice.csv."""

from __future__ import annotations

import csv
from pathlib import Path

from ellipsoid_coupling.compare.advice import Advice, AdviceRow, Interval
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.labels import model_name
from ellipsoid_coupling.output.tables import print_table, table_text

COLUMNS = ("model", "scheme", "resolution", "expected error", "expected seconds", "verdict")
CSV_COLUMNS = (
    "model", "scheme", "resolution", "error_low", "error", "error_high", "seconds_low", "seconds",
    "seconds_high", "measured", "promised", "verdict",
)  # fmt: skip


def advice_rows(advice: Advice) -> list[tuple[str, ...]]:
    """The rows as texts, `COLUMNS`."""
    return [
        (
            model_name(row.model),
            row.scheme,
            row.resolution,
            interval_text(row.error),
            seconds_text(row),
            row.verdict,
        )
        for row in advice.rows
    ]


def interval_text(interval: Interval) -> str:
    """Such as "0.021 (0.018 to 0.025)"."""
    return f"{interval.value:.2g} ({interval.low:.2g} to {interval.high:.2g})"


def seconds_text(row: AdviceRow) -> str:
    """Measured seconds, or about how many with their interval."""
    seconds = row.seconds
    return f"{seconds.value:.2g}" if row.measured else f"about {interval_text(seconds)}"


def advice_lines(advice: Advice) -> list[str]:
    """The answer in sentences; without the command."""
    lines = [
        "Errors are the largest L1 distance over the saved times, against "
        f"{advice.reference}, known to {advice.reference_error:.2g}.",
        f"{advice.spent:.3g} of {advice.seconds:g} s were used for short runs, compiling aside.",
    ]
    best = advice.best
    if best is None:
        return [*lines, f"No advice: {advice.reason}."]
    words = f"{best.model}, {best.scheme}, {best.resolution}"
    error, time = interval_text(best.error), seconds_text(best)
    if best.promised:
        return [*lines, f"Take {words}: an error of {error} in {time} s."]
    closest = f"The closest is {words}, with {error} in {time} s."
    return [*lines, f"No promise of {advice.error:g}: {advice.reason}.", closest]


def advice_title(advice: Advice) -> str:
    """Of the table."""
    scene = advice.scene.title or advice.scene.name
    return f"{scene}: an error of at most {advice.error:g} ({advice.quantity})"


def write_advice(advice: Advice, folder: Path) -> None:
    """advice.txt as it is printed, with the command, and advice.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    text = f"{advice_title(advice)}\n\n{table_text(COLUMNS, advice_rows(advice))}\n"
    out = [f"{model} is left out: {why}" for model, why in advice.left_out]
    text += "\n".join([*out, *advice_lines(advice), advice.command]) + "\n"
    with whole_file(folder / "advice.txt") as beside:
        beside.write_text(text, encoding="utf-8")
    with (
        whole_file(folder / "advice.csv") as beside,
        beside.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(CSV_COLUMNS)
        for row in advice.rows:
            numbers = [f"{number:.6g}" for number in (*row.error, *row.seconds)]
            flags = [str(row.measured).lower(), str(row.promised).lower()]
            writer.writerow([row.model, row.scheme, row.resolution, *numbers, *flags, row.verdict])


def print_advice(advice: Advice) -> None:
    """The table, and what was left out."""
    print_table(advice_title(advice), COLUMNS, advice_rows(advice))
    if advice.left_out:
        print_table("Left out", ("model", "why"), advice.left_out)
