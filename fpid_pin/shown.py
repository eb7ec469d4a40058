"""How things show themselves: one line in a console, a table in a notebook; no scripts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from fpid_pin.text import cut, visible


class Shown:
    """What prints as a report: `repr` is its first line, a notebook has all of it."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {str(self).splitlines()[0]}>"

    def _repr_html_(self) -> str:
        return f"<pre>{fit(self, keep=chr(10))}</pre>"


def listing(title: str, rows: Iterable[tuple[str, Any, str]]) -> str:
    """Return a title and a line for each (name, plain value, unit), numbers with four digits."""
    found = [(name, cut(brief(value), 72), unit) for name, value, unit in rows]
    width = max((len(name) for name, _, _ in found), default=0)
    return "\n".join([title, *(f"  {n:{width}}  {v} {u}".rstrip() for n, v, u in found)])


def brief(value: Any) -> str:
    """Return a plain value on one line; numbers that are all alike are one."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{k} {brief(v)}" for k, v in value.items() if k != "kind")
        return f"{value['kind']} ({inner})" if "kind" in value else inner
    if isinstance(value, (list, tuple)):
        parts = list(map(brief, value))
        return parts[0] if len(set(parts)) == 1 else f"[{' '.join(parts)}]"
    return visible(str(value))


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
