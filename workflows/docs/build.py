"""Lay out the documentation's sources, have sphinx make HTML of them, and check the links.

    bash workflows/docs.sh [--without-running] [--out DIR]

Pages stand in pages/. A line "% generated: NAME" there is replaced by what `from_code.GENERATED` makes, and
"% docstring: MODULE" by a module's docstring. DIR/source is what sphinx reads, DIR/html what it makes.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import scene_keys
from from_code import GENERATED, docstring
from links import broken_links

from ellipsoid_coupling.errors import InputError, RunError, run_in_words

HERE = Path(__file__).parent
WORKFLOWS = HERE.parent
TOP = WORKFLOWS.parent

# Marks a folder that may be emptied.
MADE_HERE = "made-by-docs"

_MARK = re.compile(r"^% (generated|docstring): (.+)$", re.MULTILINE)


def main(arguments: Sequence[str] | None = None) -> Path:
    """Make the pages; returns their folder."""
    parser = argparse.ArgumentParser(description="the documentation as HTML")
    parser.add_argument(
        "--without-running", action="store_true", help="leave the examples of the gallery unrun"
    )
    parser.add_argument("--out", type=Path, default=TOP / "results" / "docs")
    options = parser.parse_args(arguments)
    out: Path = options.out.resolve()
    lay_out(out)
    html = out / "html"
    run_sphinx(out / "source", html, run_examples=not options.without_running)
    broken = list(broken_links(html))
    if broken:
        raise RunError("broken links:\n" + "\n".join(broken))
    sys.stdout.write(f"{html / 'index.html'}\n")
    return html


def lay_out(out: Path) -> None:
    """Fill out/source with pages, pictures and extension tests, out/examples with the gallery."""
    if out.is_dir() and any(out.iterdir()) and not (out / MADE_HERE).is_file():
        expected = "an empty folder, or one that this script has made"
        raise InputError("--out", expected, str(out), "Name another one.")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    (out / MADE_HERE).touch()
    source = out / "source"
    shutil.copytree(HERE / "pages", source)
    for page in source.rglob("*.md"):
        page.write_text(expanded(page.read_text("utf-8")), "utf-8")
    shutil.copytree(WORKFLOWS / "pictures", source / "pictures")
    shutil.copytree(WORKFLOWS / "gallery", out / "examples", ignore=_no_caches)
    shutil.copytree(TOP / "tests" / "extension", source / "extension", ignore=_no_caches)


_no_caches = shutil.ignore_patterns("__pycache__", "__init__.py")


def expanded(text: str) -> str:
    """A page with its marks replaced."""
    generated = GENERATED | {"scene keys": scene_keys.page}

    def made(mark: re.Match[str]) -> str:
        kind, name = mark.groups()
        return docstring(name) if kind == "docstring" else generated[name]()

    return _MARK.sub(made, text)


def run_sphinx(source: Path, html: Path, *, run_examples: bool) -> None:
    """Make the pages; a warning of sphinx is an error."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    command += ["-c", str(HERE), "-d", str(source.parent / "doctrees"), str(source), str(html)]
    environment = os.environ | {"DOCS_RUN_EXAMPLES": str(run_examples), "MPLBACKEND": "agg"}
    if subprocess.run(command, env=environment, check=False).returncode:
        raise RunError("sphinx has found something to warn of, see above")


if __name__ == "__main__":
    run_in_words(main)
