"""The page of a report: what it says, that all of it is escaped, and how a browser shows it."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures import all_figures
from ellipsoid_coupling.output.report import is_comparison, load_sources, page, write_report
from ellipsoid_coupling.output.report.page import MOST_TIMES, few_times
from ellipsoid_coupling.output.report.runs import LIMITS
from ellipsoid_coupling.output.report.sources import Comparison, Run
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import load_scene
from ellipsoid_coupling.stepping.step_control import REASONS

BROWSER = shutil.which("chromium")
# A PNG of one pixel.
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c63f8cf"
    "c0f01f0005050201d8a0f1ab0000000049454e44ae426082"
)
EVIL = "<script>document.title='evil'</script>\"'&\u202e"
CSV = """\
scene,model,scheme,resolution,time,density_error,angle_error,closure_density,closure_angle,\
wall_seconds,status,reference
cavity,a,paper,h = 0.1,1,0.25,0.125,0.1,0.05,2.5,completed,exact
cavity,a,paper,h = 0.1,2,0.5,0.0625,0.2,,2.5,completed,exact
cavity,<b>,accurate,h = 0.2,1,nan,nan,,,nan,left out: <i>slow</i>,exact
"""


class Page(HTMLParser):
    """The texts of a page by tag, and the addresses that it names."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.cells: list[str] = []
        self.text = ""
        self._in_cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]
        assert not [name for name, _ in attrs if name.startswith("on")]
        if tag in ("td", "th"):
            self._in_cell = True
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        self._in_cell &= tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._in_cell:
            self.cells[-1] += data

    def row(self, name: str) -> list[str]:
        """The cells beside the first row head of that name, two runs."""
        at = self.cells.index(name)
        return self.cells[at + 1 : at + 3]


@pytest.fixture
def runs(particle_result: Result, rho_result: Result, lid_flow: FlowField) -> list[Run]:
    """A run of particles that ended at patches, and one of a grid, with the log of their steps."""
    ended = {"fates": "outlet 25, in(1) 0, inside 65", "mass_left_by_patch": "outlet 0.25, in(1) 0"}
    log = {"steps": 12.0, "step_limits": "CFL number 83 %, save times 17 %", "shortest_step": 0.01}
    particles = replace(particle_result, attributes=particle_result.attributes | ended)
    grid = replace(rho_result, attributes=rho_result.attributes | log | {"warnings": "Take care."})
    versions = {"numpy": "2.9.9"}
    return [
        Run(Path("results/a b"), particles, lid_flow, "[run]\nseed = 0\n", versions),
        Run(Path("results/c"), grid, lid_flow, "", {}),
    ]


@pytest.fixture
def comparison(tmp_path: Path) -> Path:
    """The folder of a comparison."""
    folder = tmp_path / "compare-cavity"
    folder.mkdir()
    (folder / "errors.csv").write_text(CSV)
    (folder / "errors.txt").write_text("cheapest & best\n")
    (folder / "error_against_run_time_cavity.png").write_bytes(PIXEL)
    return folder


def written(made: list[Run], compared: list[Comparison], folder: Path) -> str:
    return write_report(made, compared, folder).read_text("utf-8")


def test_it_says_what_ran_side_by_side(runs: list[Run], tmp_path: Path) -> None:
    """And what was left out, and why; it needs nothing beside it."""
    page = Page(written(runs, [], tmp_path))
    assert page.row("model") == ["microscopic", "rho_mono_kinetic"]
    assert page.row("folder") == ["results/a b", "results/c"]
    assert page.row("seed") == ["0", "0"]
    assert page.row("resolution") == ["30 x 3 particles", "h = 0.125"]
    assert page.row("version of numpy") == ["2.9.9", "–"]
    assert page.row("bounded by") == ["–", "CFL number 83 %, save times 17 %"]
    assert page.row("steps") == ["–", "12"]
    assert page.row("outlet") == ["25", "–"]
    assert page.row("in(1)") == ["0", "–"]
    assert "Take care." in page.text
    # Density, mean axes as lines and as colours, order, angles, ellipses, flow, and the numbers over time.
    assert page.tags.count("img") == 8
    assert "ellipsoid run 'results/a b/run.toml' --out NEW_FOLDER" in page.text
    assert "ellipsoid run scene.toml --model rho_mono_kinetic --scheme accurate" in page.text
    for cell in page.row("noise"):
        assert cell == "left out: A = 0: no random number is drawn"
    assert all(cell.startswith("runs: strength 1") for cell in page.row("interaction"))
    assert len(page.addresses) > 10
    assert all(a.startswith(("#", "data:image/png;base64,")) for a in page.addresses)


def test_every_picture_has_a_caption_in_words(
    runs: list[Run], lid_flow: FlowField, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of every kind of file that `ellipsoid figures` writes; nothing is drawn."""

    def path_of(*given: object, **_: object) -> Path:
        return next(one for one in given if isinstance(one, Path))

    kinds = ("angles", "density", "directors", "ellipses", "flow", "order")
    for kind in kinds:
        monkeypatch.setattr(all_figures, f"draw_{kind}", path_of)
    paths = all_figures.draw_all([run.result for run in runs], tmp_path, lid_flow)
    stems = {path.stem.partition("_")[0] for path in paths}
    assert stems == {*kinds, "axes"}
    assert stems == set(page._KINDS)


def test_pictures_show_few_of_many_times(rho_result: Result) -> None:
    """Two runs with times of their own: the first and the last of all are among those shown."""
    times = np.linspace(0.1, 5.0, 50)
    many = {name: np.repeat(v[:1], 50, axis=0) for name, v in rho_result.variables.items()}
    early = replace(rho_result, times=times[:25], variables={k: v[:25] for k, v in many.items()})
    few, count = few_times([replace(rho_result, times=times, variables=many), early])
    assert count == 50
    assert few[0].times.size == MOST_TIMES
    assert (few[0].times[0], few[0].times[-1]) == (times[0], times[-1])
    assert set(few[1].times) == set(few[0].times) & set(early.times)
    for result in few:
        assert all(len(values) == result.times.size for values in result.variables.values())
    same, count = few_times([rho_result])
    assert count == 2
    assert (same[0].times == rho_result.times).all()


def test_the_scene_of_a_run_without_run_toml_loads_again(runs: list[Run], tmp_path: Path) -> None:
    page = Page(written(runs[1:], [], tmp_path))
    toml = page.text[page.text.index('name = "cavity"') :]
    (tmp_path / "scene.toml").write_text(toml)
    assert load_scene(tmp_path / "scene.toml") == runs[1].result.scene


def test_a_failed_run_without_times_has_a_page(runs: list[Run], tmp_path: Path) -> None:
    failed = runs[1].result
    variables = {name: values[:0] for name, values in failed.variables.items()}
    attributes = failed.attributes | {"status": "failed: too stiff"}
    failed = replace(failed, times=failed.times[:0], variables=variables, attributes=attributes)
    page = Page(written([runs[1]._replace(result=failed)], [], tmp_path))
    assert "failed: too stiff" in page.text
    assert "No run has reached a saved time." in page.text
    assert "img" not in page.tags


def test_nothing_from_a_folder_is_markup(runs: list[Run], comparison: Path, tmp_path: Path) -> None:
    """Titles, names, files and attributes that are scripts stand there as text."""
    scene = load_scene("cavity", {"title": EVIL.rstrip("\u202e"), "times": [0.1, 1.0 / 3.0]})
    names = ("flow", "fates", "mass_left_by_patch", "step_limits", "resolution", "warnings")
    evil = dict.fromkeys((*names, "shortest_step", "package_version", "seed"), EVIL)
    result = replace(runs[0].result, scene=scene, attributes={"status": EVIL} | evil)
    run = Run(Path(EVIL), result, None, EVIL, {EVIL: EVIL})
    (comparison / "errors.txt").write_text(EVIL)
    (comparison / f"{EVIL.replace('/', '')}.png").write_bytes(PIXEL)
    _, compared = load_sources([comparison])
    text = written([run], compared, tmp_path)
    page = Page(text)
    assert "script" not in page.tags
    assert "i" not in page.tags
    assert "\u202e" not in text
    assert text.count("document.title=&#x27;evil&#x27;") > 10
    assert "default-src 'none'" in text


def test_a_comparison_has_its_errors_and_pictures(comparison: Path, tmp_path: Path) -> None:
    """The largest over the saved times, as the table of `compare` has it."""
    assert is_comparison(comparison)
    made, compared = load_sources([comparison])
    assert not made
    page = Page(written(made, compared, tmp_path / "out"))
    assert page.tags.count("img") == 1
    row = page.cells[page.cells.index("a") :]
    assert row[:9] == ["a", "paper", "h = 0.1", "2.5", "0.5000 / 0.1250", "",
                       "0.2000 / 0.0500", "", ""]  # fmt: skip
    assert row[9:14] == ["<b>", "accurate", "h = 0.2", "", "left out: <i>slow</i>"]
    assert "cheapest & best" in page.text


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "no rows"),
        ("scene,model\na,b\n", "no column scheme"),
        (CSV + "cavity,a\n", "line 5"),
        (CSV + "cavity" + 20 * ",a" + "\n", "line 5"),
        (CSV + '"cavity', "errors.csv"),
    ],
)
def test_a_damaged_table_is_told(comparison: Path, text: str, told: str) -> None:
    (comparison / "errors.csv").write_text(text)
    with pytest.raises(InputError, match=told):
        load_sources([comparison])


def test_a_picture_that_is_none_is_told(comparison: Path) -> None:
    (comparison / "other.png").write_text("<svg onload=alert(1)>")
    with pytest.raises(InputError, match=r"other\.png: expected a picture"):
        load_sources([comparison])


def test_every_limit_of_steps_is_explained() -> None:
    assert tuple(LIMITS) == REASONS


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_a_browser_shows_it(runs: list[Run], comparison: Path, tmp_path: Path) -> None:
    """Its pictures load, nothing is wider than a wide or a narrow window, the console stays empty."""
    _, compared = load_sources([comparison])
    path = write_report(runs, compared, tmp_path / "out")
    shot = tmp_path / "page.png"
    said = _browse(tmp_path, path, f"--screenshot={shot}", "--enable-logging=stderr")
    assert "CONSOLE" not in said.stderr
    assert matplotlib.image.imread(shot)[..., :3].std() > 0.05
    # The page forbids scripts, so it is measured from outside, in frames of two widths.
    frames = "".join(
        f'<iframe style="width:{width}px; height:900px; border:0" '
        f'srcdoc="{html.escape(path.read_text("utf-8"))}"></iframe>'
        for width in (1200, 400)
    )
    measured = tmp_path / "measured.html"
    measured.write_text(f"<!DOCTYPE html><body>{frames}{_MEASURE}</body>", "utf-8")
    done = _browse(tmp_path, measured, "--virtual-time-budget=10000", "--dump-dom")
    found = re.search(r"<title>(.*)</title>", done.stdout)
    assert found is not None
    # Width of the content, pictures that are broken, and all of them, by frame.
    assert found[1] == "1200 0 9, 400 0 9"


_MEASURE = """
<script>onload = () => {
  document.title = [...document.querySelectorAll('iframe')].map(frame => {
    const page = frame.contentDocument, images = [...page.images];
    return [page.documentElement.scrollWidth, images.filter(i => i.naturalWidth == 0).length,
            images.length].join(' ') }).join(', ')
}</script>
"""


def _browse(folder: Path, page: Path, *more: str) -> subprocess.CompletedProcess[str]:
    assert BROWSER is not None
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    options += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    options += [f"--user-data-dir={folder / 'browser'}", "--window-size=1200,2000"]
    options += ["--hide-scrollbars"]
    command = [BROWSER, *options, *more, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, check=True)
