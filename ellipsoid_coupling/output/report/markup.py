"""Pieces of the page. Every text is escaped here, once: what a run folder says may come from anywhere."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

from ellipsoid_coupling.errors import shown

# No script, no font, no address: the page shows what it holds, wherever it is opened.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_STYLE = """
* { box-sizing: border-box; }
body { font: 16px/1.5 sans-serif; max-width: 75rem; margin: 0 auto; padding: 1rem; color: #222;
       background: #fff; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; } h2 { font-size: 1.25rem; margin-top: 2.5rem;
     border-bottom: 1px solid #ccc; } h3 { font-size: 1.05rem; }
nav a { margin-right: 1rem; white-space: nowrap; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; }
caption { text-align: left; font-weight: bold; padding: 0.3rem 0; }
td, th { border: 1px solid #ccc; padding: 0.25rem 0.6rem; text-align: left; vertical-align: top;
         overflow-wrap: normal; max-width: 26rem; }
thead th { background: #f2f2f2; } tbody th { font-weight: normal; background: #fafafa; }
td.text { min-width: 11rem; } td.long { overflow-wrap: anywhere; min-width: 14rem; }
td.out { color: #6b6b6b; } td.bad { background: #fddbc7; }
figure { margin: 1.5rem 0; } img { max-width: 100%; height: auto; border: 1px solid #ddd; }
figcaption { color: #555; font-size: 0.9rem; }
pre { background: #f6f6f6; padding: 0.8rem; overflow-x: auto; font-size: 0.85rem; white-space: pre-wrap; }
.note { color: #555; font-size: 0.9rem; } summary { cursor: pointer; margin: 0.5rem 0; }
"""
# Letters of a word that is broken, and of a text that gets a broad column.
_LONG_WORD = 24


def escaped(text: str) -> str:
    """`text` as it is to be read, in HTML: what is not printable stands there as its escape."""
    return html.escape(shown(text), quote=True)


def heading(title: str, anchor: str) -> str:
    """A section's heading, which the list of contents leads to."""
    return f'<h2 id="{escaped(anchor)}">{escaped(title)}</h2>'


def subheading(title: str) -> str:
    """A heading within a section."""
    return f"<h3>{escaped(title)}</h3>"


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph; `kind` is a class of the style sheet."""
    return f"<p{_class(kind)}>{escaped(text)}</p>"


def bullets(lines: Iterable[str]) -> str:
    """A list."""
    return "<ul>" + "".join(f"<li>{escaped(line)}</li>" for line in lines) + "</ul>"


def verbatim(text: str) -> str:
    """Text of a file or a command, line by line."""
    return f"<pre>{escaped(text)}</pre>"


def folded(title: str, content: str) -> str:
    """`content`, which is HTML, behind a title that opens it."""
    return f"<details><summary>{escaped(title)}</summary>{content}</details>"


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    title: str = "",
    classes: dict[tuple[int, int], str] | None = None,
) -> str:
    """A table whose rows begin with their name; a narrow window scrolls it by itself.

    classes : of the style sheet, by (row, column), for cells that stand out
    """
    classes = classes or {}
    columns = "".join(f'<th scope="col">{escaped(cell)}</th>' for cell in head)
    lines = []
    for i, (name, *cells) in enumerate(rows):
        marks = [
            _class(f"{classes.get((i, j), '')} {_width(cell)}".strip())
            for j, cell in enumerate(cells, 1)
        ]
        data = "".join(
            f"<td{mark}>{escaped(cell)}</td>" for mark, cell in zip(marks, cells, strict=True)
        )
        lines.append(f'<tr><th scope="row">{escaped(name)}</th>{data}</tr>')
    above = f"<caption>{escaped(title)}</caption>" if title else ""
    body = f"<thead><tr>{columns}</tr></thead><tbody>{''.join(lines)}</tbody>"
    # With a place in the order of the keyboard, by which it is scrolled then.
    return f'<div class="wide" tabindex="0"><table>{above}{body}</table></div>'


def _width(cell: str) -> str:
    """The class of a cell that would else be a narrow column, or a wide one for one long word."""
    if max(map(len, cell.split()), default=0) > _LONG_WORD:
        return "long"
    return "text" if len(cell) > _LONG_WORD else ""


def picture(png: bytes, caption: str) -> str:
    """A PNG within the page."""
    data = base64.b64encode(png).decode("ascii")
    text = escaped(caption)
    image = f'<img src="data:image/png;base64,{data}" alt="{text}">'
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def page(title: str, sections: Sequence[tuple[str, str, str]]) -> str:
    """The whole page of sections (title, anchor, HTML); those without content are left out."""
    filled = [section for section in sections if section[2]]
    contents = "".join(f'<a href="#{escaped(a)}">{escaped(t)}</a>' for t, a, _ in filled)
    body = "".join(f"<section>{heading(t, a)}{text}</section>" for t, a, text in filled)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escaped(title)}</title><style>{_STYLE}</style></head><body>"
        f"<h1>{escaped(title)}</h1><nav>{contents}</nav>{body}</body></html>\n"
    )


def _class(name: str) -> str:
    return f' class="{escaped(name)}"' if name else ""
