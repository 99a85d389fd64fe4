"""How sphinx makes the documentation; `build.py` lays out its sources and calls it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import ellipsoid_coupling as ec

sys.path.insert(0, str(Path(__file__).parent))
from docstrings import keep_properties, list_entries
from written_pictures import png_scraper

project = "ellipsoid_coupling"
author = "The ellipsoid_coupling developers"
version = release = ec.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
# The scraper below is a function, which sphinx cannot keep between two builds.
suppress_warnings = ["config.cache"]
exclude_patterns = ["gallery/sg_execution_times.rst"]
myst_heading_anchors = 3
# Else --out becomes a dash and a word.
smartquotes = False

html_theme = "furo"
html_title = f"Ellipsoid coupling {version}"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
# Docstrings have names in single backticks.
default_role = "literal"

sphinx_gallery_conf = {
    # Both from the folder of the laid-out sources.
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("matplotlib", png_scraper),
    "plot_gallery": os.environ["DOCS_RUN_EXAMPLES"],
    "abort_on_example_error": True,
    # What an example prints, and not what its last line happens to return.
    "capture_repr": (),
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
}


def setup(app: Any) -> None:
    """Both sides of napoleon, which has the priority 500."""
    app.connect("autodoc-process-docstring", list_entries, priority=400)
    app.connect("autodoc-process-docstring", keep_properties, priority=600)
