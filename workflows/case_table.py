"""What the package makes of solved cases: read or not, how far off, and whether each model runs.

python workflows/case_table.py CASE... [--models NAME...] [--seconds 30]

For each case: `ellipsoid new`, then a short run of each model on the new scene, by the command line as a
user types it. The table goes to standard output, in Markdown.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.models import model_names
from ellipsoid_coupling.scenes import load_scene

SMALL = ("particles.number=100", "particles.realisations=1")
# Models without a time of their own are asked for nothing here.
LEFT_OUT = ("stationary_state",)
# Coarse: the least number of cells along the shorter side, and for models with angles.
_CELLS, _ANGLES = 16, 8
_MISFIT = re.compile(r"([\d.e+-]+ %) off U")
_SLIP = re.compile(r"up to ([\d.e+-]+ %) of its largest at walls")


def command(*tokens: str, seconds: float) -> tuple[int, str, str]:
    """Status, standard output and the last line of standard error of an `ellipsoid` command."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "ellipsoid_coupling", *tokens], capture_output=True, text=True,
            check=False, timeout=seconds, errors="replace",
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return -1, "", f"longer than {seconds:g} s"
    lines = [line for line in done.stderr.splitlines() if line.startswith("ellipsoid:")]
    return done.returncode, done.stdout, lines[-1].removeprefix("ellipsoid: ") if lines else ""


def row(case: Path, models: Sequence[str], seconds: float) -> list[str]:
    """The cells of one case's row."""
    name = f"{case.parent.name}/{case.name}" if case.name == "case" else case.name
    with tempfile.TemporaryDirectory() as scratch:
        scene = Path(scratch) / "scene.toml"
        status, _, why = command("new", str(case), "--out", str(scene), seconds=seconds)
        note = ""
        if status == 2 and "--allow-misfit" in why:
            note = " (with --allow-misfit)"
            tokens = ("new", str(case), "--out", str(scene), "--allow-misfit")
            status, _, why = command(*tokens, seconds=seconds)
        if status:
            return [name, f"refused: {why}", "", "", *("" for _ in models)]
        origin = scene.read_text(encoding="utf-8").splitlines()[1]
        found = [pattern.search(origin) for pattern in (_MISFIT, _SLIP)]
        rms, slip = (match[1] if match else "0" for match in found)
        verdicts = [verdict(scene, case, model, seconds) for model in models]
        return [name, f"yes{note}", slip, rms, *verdicts]


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
    return f"{'refused' if status == 2 else 'fails'}: {why or told[-80:]}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="+", type=Path)
    known = [name for name in model_names() if name not in LEFT_OUT]
    parser.add_argument("--models", nargs="*", choices=known, default=known)
    parser.add_argument("--seconds", type=float, default=120.0)
    options = parser.parse_args(arguments)
    head = ["case", "read", "slip", "rms", *options.models]
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for case in options.cases:
        cells = row(case, options.models, options.seconds)
        print("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
