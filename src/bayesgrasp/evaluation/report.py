"""One self-contained page with tables and figures: HTML without scripts or other files, figures embedded as PNG."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bayesgrasp.files import MIB, read_bytes, write_text

LARGEST_PICTURE = 64 * MIB
"""Bytes of a figure."""

_STYLE = (
    "body{font:16px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;font-size:14px}td,th{padding:.2em .7em;border-bottom:1px solid #ccc}"
    "td{text-align:right}td:first-child,td:nth-child(2){text-align:left}th{text-align:left}"
    "figure{margin:1.5em 0}img{max-width:100%}figcaption{color:#555;font-size:14px}code{font-size:13px}"
)


@dataclass(frozen=True)
class Picture:
    """A figure of the page.

    Attributes:
        path: A PNG file.
        caption: Below it.
    """

    path: Path
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        heading: Its title.
        paragraphs: Text; `code` in backticks.
        tables: Markdown tables, as `tables` makes them; lines that are no rows become paragraphs.
        pictures: Figures; those whose files are missing are named as missing.
    """

    heading: str
    paragraphs: Sequence[str] = ()
    tables: Sequence[str] = ()
    pictures: Sequence[Picture] = ()


def write_report(path: Path, title: str, sections: Sequence[Section]) -> None:
    """Write the page; it appears whole or not at all."""
    body = "\n".join(part for section in sections for part in _section(section))
    page = (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{html.escape(title)}</h1>\n{body}\n</body></html>\n"
    )
    write_text(path, page)


def _section(section: Section) -> list[str]:
    return [
        f"<h2>{html.escape(section.heading)}</h2>",
        *(f"<p>{_inline(text)}</p>" for text in section.paragraphs),
        *(_tables(markdown) for markdown in section.tables),
        *(_picture(picture) for picture in section.pictures),
    ]


def _picture(picture: Picture) -> str:
    caption = f"<figcaption>{_inline(picture.caption)}</figcaption>"
    if not picture.path.exists():
        return f"<figure><p>There is no {html.escape(picture.path.name)}.</p>{caption}</figure>"
    data = base64.b64encode(read_bytes(picture.path, LARGEST_PICTURE)).decode()
    alternative = html.escape(picture.caption, quote=True)
    return f'<figure><img alt="{alternative}" src="data:image/png;base64,{data}">{caption}</figure>'


def _tables(markdown: str) -> str:
    parts: list[str] = []
    rows: list[str] = []
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            rows.append(line)
            continue
        if rows:
            parts.append(_table(rows))
            rows = []
        if line:
            parts.append(f"<p>{_inline(line.removeprefix('* '))}</p>")
    return "\n".join(parts)


def _table(rows: Sequence[str]) -> str:
    head, _, *body = ([cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows)
    lines = ["".join(f"<th>{_inline(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{_inline(cell)}</td>" for cell in cells) for cells in body]
    return "<table>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "\n</table>"


def _inline(text: str) -> str:
    """Escaped text with `code` and **bold**."""
    escaped = html.escape(text.replace("\\|", "|"), quote=False)
    return re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", re.sub(r"`(.+?)`", r"<code>\1</code>", escaped))
