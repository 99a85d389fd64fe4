"""The documentation: laid out, built without a warning, its links whole, its pages seen in a browser."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import matplotlib.image
import pytest
from packaging.requirements import Requirement

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import app, main

sys.path.append(str(Path(__file__).parents[2] / "workflows" / "docs"))
import build
import from_code
import links

TOP = Path(__file__).parents[2]

SPHINX = importlib.util.find_spec("sphinx_gallery") is not None
NEEDS_SPHINX = pytest.mark.skipif(not SPHINX, reason="sphinx comes with bash workflows/docs.sh")
BROWSER = shutil.which("chromium")


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built pages; examples are not run here, `test_gallery.py` does that.

    In a process of its own: other tests may have registered kinds that scenes of this one know.
    """
    out = tmp_path_factory.mktemp("docs") / "out"
    command = [sys.executable, str(TOP / "workflows" / "docs" / "build.py")]
    command += ["--without-running", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{out / 'html' / 'index.html'}\n"
    return out / "html"


@NEEDS_SPHINX
def test_it_is_built_without_a_warning_and_with_whole_links(html: Path) -> None:
    """The script fails for either; here: that there is something to look at."""
    names = {str(path.relative_to(html)) for path in html.rglob("*.html")}
    pages = TOP / "workflows" / "docs" / "pages"
    for page in pages.rglob("*.md"):
        if page.parent.name != "tables":
            assert str(page.relative_to(pages).with_suffix(".html")) in names
    for example in (TOP / "workflows" / "gallery").glob("*.py"):
        assert f"gallery/{example.stem}.html" in names
    assert sum(name.startswith("extend/") for name in names) == 9
    for folder in ("results", "numerics"):
        assert len([name for name in names if name.startswith(folder)]) >= 6


@NEEDS_SPHINX
@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
@pytest.mark.parametrize("page", ["index", "scene_keys", "results/frontier", "numerics/kinetic"])
def test_a_browser_shows_the_page(html: Path, tmp_path: Path, page: str) -> None:
    """Its pictures load, and it is not blank."""
    assert BROWSER is not None
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    options += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    options += [f"--user-data-dir={tmp_path / 'browser'}", "--window-size=1200,2000"]
    looked_at = html / f"{page}-looked-at.html"
    script = (
        "<script>onload = () => { document.title = [...document.images]"
        ".filter(i => i.naturalWidth == 0).length + ' of ' + document.images.length }</script>"
    )
    text = (html / f"{page}.html").read_text("utf-8")
    looked_at.write_text(text.replace('loading="lazy"', "") + script, "utf-8")

    def run(*more: str) -> str:
        command = [BROWSER, *options, *more, looked_at.as_uri()]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    shown = re.search(
        r"<title>(\d+) of (\d+)</title>", run("--virtual-time-budget=10000", "--dump-dom")
    )
    assert shown is not None
    assert int(shown[1]) == 0
    assert int(shown[2]) == len(re.findall(r"<img ", text))
    run(f"--screenshot={tmp_path / 'page.png'}")
    assert matplotlib.image.imread(tmp_path / "page.png")[..., :3].std() > 0.05


@NEEDS_SPHINX
def test_the_lock_pins_the_extra_and_all_that_it_needs() -> None:
    """Beside what requirements.lock pins, and nothing twice."""
    locks = [(TOP / "workflows" / f"{name}.lock").read_text() for name in ("docs", "requirements")]
    docs, others = ({plain_name(n) for n in re.findall(r"(?m)^([\w.-]+)==", t)} for t in locks)
    assert locks[0].count("==") <= locks[0].count("--hash=sha256:")
    project = tomllib.loads((TOP / "pyproject.toml").read_text())
    left = list(project["project"]["optional-dependencies"]["docs"])
    wanted: set[str] = set()
    while left:
        name = plain_name(Requirement(left.pop()).name)
        if name not in wanted:
            wanted.add(name)
            texts = importlib.metadata.requires(name) or []
            left += [
                t
                for t in texts
                if (m := Requirement(t).marker) is None or m.evaluate({"extra": ""})
            ]
    assert docs == wanted - others


def plain_name(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.skipif(not (TOP / ".git").exists(), reason="not a checkout")
def test_no_page_is_ignored_by_git() -> None:
    """Rules for results of runs also match folders of pages."""
    command = ["git", "-C", str(TOP), "ls-files", "--others", "--ignored", "--exclude-standard"]
    folders = ["workflows/docs", "workflows/gallery", "workflows/pictures"]
    done = subprocess.run([*command, *folders], capture_output=True, text=True, check=True)
    assert [path for path in done.stdout.splitlines() if "__pycache__" not in path] == []


def test_broken_links_are_found(tmp_path: Path) -> None:
    (tmp_path / "one.html").write_text(
        '<a href="two.html#here"></a><a href="two.html#there"></a><a href="#top"></a>'
        '<img src="none.png"><a href="https://example.org/x"></a><p id="top"></p>'
    )
    (tmp_path / "two.html").write_text('<p id="here"></p>')
    assert list(links.broken_links(tmp_path)) == ["one.html: none.png", "one.html: two.html#there"]


def test_a_docstring_becomes_text_and_fences() -> None:
    text = from_code.docstring("ellipsoid_coupling.particles.leapfrog")
    assert text.count("```") == 2
    fenced = text.split("```")[1].splitlines()
    assert fenced[0] == "text"
    assert fenced[1].startswith("v_{n+1} = v_n")
    assert "Explicit in the damping" in text.split("```")[2]


def test_the_command_line_page_has_every_command() -> None:
    text = from_code.command_line()
    commands = [name for name in app if not name.startswith("-")]
    assert len(commands) >= 7
    for name in commands:
        assert f"## ellipsoid {name}" in text


def test_the_python_page_has_every_public_name() -> None:
    text = from_code.python_api()
    for name in ec.__all__:
        assert f":: ellipsoid_coupling.{name}\n" in text


def test_the_first_scene_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The file of "Getting started" loads, and its terms are those that the page names."""
    page = (TOP / "workflows" / "docs" / "pages" / "getting_started.md").read_text("utf-8")
    file = tmp_path / "my.toml"
    file.write_text(page.split("```toml\n")[1].split("```")[0])
    assert ec.load_scene(file).name == "my"
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(file), "--model", "rho_mono_kinetic"])
    assert ended.value.code == 0
    assert "strength 1" in capsys.readouterr().out


def test_unknown_marks_and_folders_of_others_are_refused(tmp_path: Path) -> None:
    with pytest.raises(KeyError):
        build.expanded("% generated: nothing of that name\n")
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(ec.InputError, match=r"expected an empty folder, or one that this script"):
        build.main(["--out", str(tmp_path)])
    assert (tmp_path / "thesis.tex").exists()


def test_the_readme_is_short_and_its_links_lead_somewhere() -> None:
    text = (TOP / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= 150
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (TOP / link).exists(), link
    assert text.count("![") == 5
