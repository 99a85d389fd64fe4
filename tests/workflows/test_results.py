"""The results of the documentation: what each part leaves becomes a stamped table and pictures."""

from __future__ import annotations

import datetime
import json
import re
import sys
from pathlib import Path

import matplotlib.image
import pytest

from ellipsoid_coupling.output.progress import ProgressReporter

sys.path.append(str(Path(__file__).parents[2] / "workflows"))
import benchmark
import frontier
import paper
import paper_page
import results
import stamps
from benchmark_tools import Row

TOP = Path(__file__).parents[2]
TABLES = TOP / "workflows" / "docs" / "pages" / "results" / "tables"


def test_the_stamp_names_day_machine_and_commit() -> None:
    day = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    found = re.fullmatch(
        r"Measured on (\S+), (.+), \d+ cores, at commit (\S+)( with changes)?\.", results.stamp()
    )
    assert found is not None
    # The day may have ended in between.
    assert abs((datetime.date.fromisoformat(found[1]) - datetime.date.fromisoformat(day)).days) <= 1


def test_a_table_keeps_its_bars() -> None:
    text = results.table([("a", "b"), ("|x|", "2")])
    assert text.splitlines() == ["| a | b |", "| --- | --- |", r"| \|x\| | 2 |"]


def test_verdicts_become_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the page of the paper writes them."""

    def short_paper(arguments: list[str]) -> Path:
        folder = Path(arguments[1])
        folder.mkdir(parents=True)
        with ProgressReporter() as report:
            page = paper_page.Page(folder, True, report)
            page.judge(paper_page.Verdict("1. It is so", True, "0.1, bound 0.2", "accurate"))
            page.judge(paper_page.Verdict("1. It is so", False, "0.3, bound 0.2", "paper"))
            page.write()
        return folder

    monkeypatch.setattr(paper, "main", short_paper)
    pages = tmp_path / "pages"
    results.main(["--only", "paper", "--out", str(tmp_path / "out"), "--pages", str(pages)])
    (written,) = pages.rglob("*.md")
    stamp, empty, head, rule, first, second = written.read_text("utf-8").splitlines()
    assert stamp.startswith("Measured on ")
    assert not empty
    assert (head, rule.count("---")) == ("| statement | scheme | verdict | evidence |", 4)
    assert first == "| 1. It is so | paper | does not reproduce | 0.3, bound 0.2 |"
    assert second == "| 1. It is so | accurate | reproduces | 0.1, bound 0.2 |"


def test_the_benchmark_becomes_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def short_benchmark(arguments: list[str]) -> Path:
        row = Row("a sum", "fast", "2 ns", "a loop: 4 ns", {"error": 0.0})
        path = Path(arguments[1]) / "benchmark.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps({"limits": {"triad": 70.04}, "rows": [row._asdict()]}))
        return path

    monkeypatch.setattr(benchmark, "main", short_benchmark)
    results.main(["--only", "benchmark", "--out", str(tmp_path / "out"), "--pages", str(tmp_path)])
    (written,) = (tmp_path / "docs").rglob("*.md")
    text = written.read_text("utf-8")
    assert "Limits of the machine: triad 70.\n" in text
    assert text.splitlines()[-1] == "| a sum | fast | 2 ns | a loop: 4 ns |"


def test_choices_become_a_table_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The head as workflows/frontier.py writes it, and a row; pictures under their names there."""

    def short_frontier(arguments: list[str]) -> Path:
        folder = Path(arguments[1])
        folder.mkdir(parents=True)
        path = frontier.write_choices([], folder)
        with path.open("a", encoding="utf-8") as file:
            file.write("| `cavity` | density | a: 1 s |  | none |\n")
        for name in ("error_parts", "error_against_run_time"):
            (folder / f"{name}_cavity_free.png").write_text(name)
        return folder

    monkeypatch.setattr(frontier, "main", short_frontier)
    results.main(["--only", "frontier", "--out", str(tmp_path / "out"), "--pages", str(tmp_path)])
    pictures = {path.name: path.read_text() for path in (tmp_path / "pictures").glob("*.png")}
    told = stamps.read_stamps(tmp_path / "pictures")
    assert set(told) == set(pictures)
    for name, stamp in told.items():
        assert stamp["picture"] == stamps.checksum(tmp_path / "pictures" / name)
        assert stamp["drawn_by"] == stamps.drawing_digest(name)
    assert pictures == {
        "error_parts_cavity_free.png": "error_parts",
        "frontier_cavity_free.png": "error_against_run_time",
    }
    (written,) = (tmp_path / "docs").rglob("*.md")
    lines = written.read_text("utf-8").splitlines()
    assert lines[-3].startswith("| scene | error of |")
    assert lines[-1] == "| `cavity` | density | a: 1 s |  | none |"


def test_ellipses_in_flows_become_pictures(tmp_path: Path) -> None:
    """In the coarse flows of the tests' data, which any machine has."""
    results.main(
        ["--only", "flows", "--quick", "--out", str(tmp_path / "o"), "--pages", str(tmp_path)]
    )
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert names == {"vortex_street.png", "elbow.png", "stamps.json"}
    for name in ("vortex_street", "elbow"):
        picture = matplotlib.image.imread(tmp_path / "pictures" / f"{name}.png")
        assert picture[..., :3].std() > 0.05


def test_every_table_that_the_pages_include_is_made_by_a_part() -> None:
    assert {path.stem for path in TABLES.glob("*.md")} == set(results.PARTS) - {"cavity", "flows"}
    for path in TABLES.glob("*.md"):
        assert path.read_text("utf-8").startswith("Measured ")
        page = (TABLES.parent / path.name).read_text("utf-8")
        assert f"```{{include}} tables/{path.name}\n```" in page


@pytest.mark.heavy
def test_all_parts_at_tiny_sizes(tmp_path: Path) -> None:
    """From the first run to the last table: every table and picture is replaced."""
    results.main(["--quick", "--out", str(tmp_path / "out"), "--pages", str(tmp_path)])
    tables = {path.name for path in (tmp_path / "docs").rglob("*.md")}
    assert tables == {path.name for path in TABLES.glob("*.md")}
    pictures = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert pictures == {path.name for path in (TOP / "workflows" / "pictures").iterdir()}
