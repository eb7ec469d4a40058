"""How things show themselves: one line in a console, a table in a notebook; no scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from fpid_pin.text import visible


class Shown:
    """What prints as a report: `repr` is its first line, a notebook has all of it."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {str(self).splitlines()[0]}>"

    def _repr_html_(self) -> str:
        return f"<pre>{fit(self, keep=chr(10))}</pre>"


def fit(value: Any, keep: str = "") -> str:
    """Return a value as text for HTML; a number with four significant digits."""
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return escape(visible(text, keep=keep))


def html_table(caption: object, head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; everything in it is escaped."""
    lines = [f"<caption>{fit(caption)}</caption>"]
    lines.append("<tr>" + "".join(f"<th>{fit(cell)}</th>" for cell in head) + "</tr>")
    lines += ["<tr>" + "".join(f"<td>{fit(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return "<table>" + "\n".join(lines) + "</table>"
