"""Pictures that an example of the gallery writes as PNG files stand on its page."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def png_scraper(
    _block: tuple[str, str, int], variables: dict[str, Any], gallery: dict[str, Any]
) -> str:
    """Take the PNG files that a block has left beside its example, oldest first; as rst."""
    folder = Path(variables["src_file"]).parent
    pictures = []
    for path in sorted(folder.glob("*.png"), key=lambda path: path.stat().st_mtime_ns):
        picture = next(variables["image_path_iterator"])
        shutil.move(path, picture)
        pictures.append(picture)
    return str(figure_rst(pictures, gallery["src_dir"]))
