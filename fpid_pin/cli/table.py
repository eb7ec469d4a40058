"""What commands print: lines that stay text, whatever is in them, and one kind of table.

A table is a list of rows, a row a dictionary from heads to cells: the same for the screen, for
Markdown and for CSV.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.text import visible

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

Row = dict[str, Any]
#: Letters that a line of the screen has at least, and that a row's name has room for.
_NARROWEST, _NAME = 80, 16
_ENDLESS = 10_000
# What Markdown may take for its own; an underscore within a word it leaves alone. At the start of
# a line the second make lists, rules and headings.
_MARKS = re.compile(r"[\\`*\[\]<>|&~$#]|(?<![^\W_])_|_(?![^\W_])")
_LEADS = re.compile(r"^(\d*)([-+.)])(?=[\s-]|$)")


def screen(*, error: bool = False) -> Console:
    """Return a console for standard output or error on which nothing is markup.

    A name such as ``[red]`` or ``:smile:`` is printed as it is.
    """
    from rich.console import Console

    return Console(stderr=error, markup=False, emoji=False, highlight=False)


def say(*lines: str, error: bool = False, console: Console | None = None) -> None:
    """Print lines as they are, control characters written out; the terminal wraps them.

    An address that was broken in two could not be copied.
    """
    from rich.text import Text

    console = console or screen(error=error)
    for line in lines:
        console.print(Text(visible(line)), soft_wrap=True)


def say_written(path: Path) -> None:
    """Say where a file is and how large."""
    opens = ", opens in any browser" * (path.suffix == ".html")
    say(f"{path}: {path.stat().st_size / 1e6:.2f} MB{opens}")


def print_table(rows: Sequence[Row], title: str, *, console: Console | None = None) -> None:
    """Print a table in which no number and no name is cut, and no number broken.

    Units stand under their names. Names are broken where a terminal has no room; where numbers do
    not fit beside each other, further columns follow below, each row with its name again. In a
    pipe or a file a table is as wide as it is. A row's ``condition`` heads it and those after it;
    where ``best`` is not empty it is marked.
    """
    console = console or screen()
    heads = [head for head in rows[0] if head not in ("condition", "best")]
    if not console.is_terminal:
        console.width = _ENDLESS
    console.width = max(console.width, _NARROWEST)
    shown = heads[:1]
    for head in heads[1:]:
        free = console.options.update(max_width=_ENDLESS)
        least = console.measure(_rich(rows, [*shown, head], ""), options=free).minimum
        if least > console.width and len(shown) > 1:
            console.print(_rich(rows, shown, title))
            shown, title = heads[:1], ""
        shown.append(head)
    console.print(_rich(rows, shown, title))


def _rich(rows: Sequence[Row], heads: Sequence[str], title: str) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(visible(title), style="table.title") if title else None,
        title_justify="left", header_style="bold", box=None, padding=(0, 2, 0, 0), pad_edge=False,
    )  # fmt: skip
    for head in heads:
        label = Text(head.replace(" [", "\n[").replace(" (", "\n(").replace(" joint", "\njoint"))
        longest = max(len(_short(row[head])) for row in rows)
        if is_numeric(rows, head):
            room = max(longest, *map(len, str(label).split("\n")))
            table.add_column(label, justify="right", no_wrap=True, min_width=room)
        else:
            named = min(_NAME, longest + 2) if head == heads[0] else None
            table.add_column(label, overflow="fold", min_width=named)
    condition = None
    for row in rows:
        if row.get("condition") != condition:
            condition = row["condition"]
            table.add_row(Text(visible(condition), style="bold"))
        cells = [Text(visible(_short(row[head]))) for head in heads]
        if row.get("best"):
            cells[0].append(" *")
        table.add_row(*cells, style="bold" if row.get("best") else None)
    return table


def cell(value: Any) -> str:
    """Write a value with four significant digits; None is a dash."""
    if value is None:
        return "-"
    return f"{float(value):.4g}" if isinstance(value, (float, np.floating)) else str(value)


def _short(value: Any) -> str:
    """Write a value as `cell` does, with no more in an exponent than it takes: 1.143e5."""
    digits, e, exponent = cell(value).partition("e")
    return f"{digits}e{int(exponent)}" if e and _is_number(value) else cell(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def is_numeric(rows: Sequence[Row], head: str) -> bool:
    """Return whether a column is one of numbers."""
    return all(row[head] is None or _is_number(row[head]) for row in rows)


def drop_constant(rows: list[Row], key: str) -> list[Row]:
    """Leave out a column that says the same in every row."""
    if not rows or len({row.get(key) for row in rows}) > 1:
        return rows
    return [{k: v for k, v in row.items() if k != key} for row in rows]


def markdown(rows: Sequence[Row]) -> str:
    """Return a Markdown table."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |"]
    lines.append("|" + "|".join(" ---: " if is_numeric(rows, h) else " --- " for h in heads) + "|")
    lines += ["| " + " | ".join(in_markdown(cell(row[h])) for h in heads) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def in_markdown(text: str) -> str:
    """Return text that Markdown takes for text: one line, no mark-up, link or end of a cell."""
    # Spaces before it would make code of it.
    return _LEADS.sub(r"\1\\\2", _MARKS.sub(r"\\\g<0>", visible(text).strip()))


def comma_separated(rows: Sequence[Row]) -> str:
    """Return CSV with every digit."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        floats = (float, np.floating)
        writer.writerow({k: repr(float(v)) if isinstance(v, floats) else v for k, v in row.items()})
    return text.getvalue()
