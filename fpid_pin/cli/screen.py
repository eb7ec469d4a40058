"""What commands say: lines that stay text, one kind of table, and how far work has come.

A table is a list of rows, a row a dictionary from heads to cells: the same for the screen, for
Markdown and for CSV.
"""

from __future__ import annotations

import csv
import io
import math
import re
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fpid_pin.progress import Progress
from fpid_pin.text import visible

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fpid_pin.tuning import SearchProgress

Row = dict[str, Any]
#: Letters that a line of the screen has at least, and that a row's name has room for.
_NARROWEST, _NAME = 80, 16
_ENDLESS = 10_000
# What Markdown may take for its own; an underscore within a word it leaves alone. At the start of
# a line the second make lists, rules and headings.
_MARKS = re.compile(r"[\\`*\[\]<>|&~$#]|(?<![^\W_])_|_(?![^\W_])")
_LEADS = re.compile(r"^(\d*)([-+.)])(?=[\s-]|$)")
#: A bar is worth showing after so long, and a line of a search where no bar can be drawn [s].
_PATIENCE, _QUIET = 0.5, 10.0


def screen(*, error: bool = False) -> Console:
    """Return a console for standard output or error on which nothing is markup.

    A name such as ``[red]`` or ``:smile:`` is printed as it is.
    """
    from rich.console import Console

    return Console(stderr=error, markup=False, emoji=False, highlight=False)


def say(*lines: str, error: bool = False, console: Console | None = None) -> None:
    """Print lines, control characters written out; a terminal has them wrapped between words.

    An address that was broken in two could not be copied.
    """
    from rich.text import Text

    console = console or screen(error=error)
    for line in map(visible, lines):
        if console.is_terminal and " " in line.strip():
            line = textwrap.fill(
                line, console.width, break_long_words=False, break_on_hyphens=False,
                replace_whitespace=False, drop_whitespace=False,
            )  # fmt: skip
        console.print(Text(line), soft_wrap=True)


def say_written(path: Path) -> None:
    """Say where a file is and how large."""
    opens = ", opens in any browser" * (path.suffix == ".html")
    say(f"{path}: {path.stat().st_size / 1e6:.2f} MB{opens}")


# ---------------------------------------------------------------------- tables


def print_table(rows: Sequence[Row], title: str = "", *, console: Console | None = None) -> None:
    """Print a table in which no number and no name is cut, and no number broken.

    Units stand under their names. Names are broken where a terminal has no room; where numbers do
    not fit beside each other, further columns follow below, each row with its name again. In a
    pipe or a file a table is as wide as it is. A row's ``condition`` heads it and those after it;
    where ``best`` is not empty it is marked.
    """
    console = console or screen()
    console.width = max(console.width, _NARROWEST) if console.is_terminal else _ENDLESS
    free = console.options.update(max_width=_ENDLESS)
    name, *heads = (head for head in rows[0] if head not in ("condition", "best"))
    shown = [name]
    for head in heads:
        least = console.measure(_rich(rows, [*shown, head]), options=free).minimum
        if least > console.width and len(shown) > 1:
            console.print(_rich(rows, shown, title))
            shown, title = [name], ""
        shown.append(head)
    console.print(_rich(rows, shown, title))


def _rich(rows: Sequence[Row], heads: Sequence[str], title: str = "") -> Table:
    from rich.table import Table
    from rich.text import Text

    # With `pad_edge=False` rich folds the last column by a width that it then does not give it.
    table = Table(
        title=Text(visible(title), style="table.title") if title else None,
        title_justify="left", header_style="bold", box=None, padding=(0, 2, 0, 0),
    )  # fmt: skip
    for head in heads:
        label = Text(head.replace(" [", "\n[").replace(" (", "\n(").replace(" joint", "\njoint"))
        longest = max(len(cell(row[head])) for row in rows)
        if _is_numeric(rows, head):
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
        cells = [Text(visible(cell(row[head]))) for head in heads]
        if row.get("best"):
            cells[0].append(" *")
        table.add_row(*cells, style="bold" if row.get("best") else None)
    return table


def cell(value: Any) -> str:
    """Write a value, of a number four digits and no more of an exponent than it takes: 1.143e5.

    None is a dash.
    """
    if value is None:
        return "-"
    if isinstance(value, Integral) or not isinstance(value, Real):
        return str(value)
    digits, e, exponent = f"{value:.4g}".partition("e")
    return f"{digits}e{int(exponent)}" if e else digits


def _is_numeric(rows: Sequence[Row], head: str) -> bool:
    return all(isinstance(row[head], (Real, type(None))) for row in rows)


def drop_constant(rows: list[Row], key: str) -> list[Row]:
    """Leave out a column that says the same in every row."""
    if len({row.get(key) for row in rows}) > 1:
        return rows
    return [{k: v for k, v in row.items() if k != key} for row in rows]


def markdown(rows: Sequence[Row]) -> str:
    """Return a Markdown table."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |"]
    lines.append("|" + "|".join(" ---: " if _is_numeric(rows, h) else " --- " for h in heads) + "|")
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
    writer.writerows(rows)
    return text.getvalue()


# ---------------------------------------------------------------------- progress


def say_if_compiling() -> None:
    """Say on standard error, once on a machine, why the first run takes longer."""
    # Imported late: it loads numba.
    from fpid_pin.kernels.compiled import is_cold

    if is_cold():
        sys.stderr.write("fpid-pin: compiling the equations for this machine, some seconds, once\n")


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[Progress], None]]:
    """Give a function that takes a `Progress` and draws a bar on standard error.

    Of a `SearchProgress` it says the generation, the best cost and evaluations a second; where
    there is no terminal in lines, at times.
    """
    from rich import progress as rich

    from fpid_pin.tuning import SearchProgress

    console = screen(error=True)
    bar = rich.Progress(
        rich.TextColumn("{task.description}", markup=False), rich.BarColumn(bar_width=None),
        rich.TaskProgressColumn(), rich.TimeRemainingColumn(), console=console, transient=True,
        disable=not console.is_terminal,
    )  # fmt: skip
    task = bar.add_task(title, total=1.0)
    began = time.monotonic()
    told_at = began - _QUIET

    def advance(progress: Progress) -> None:
        nonlocal told_at
        now, told = time.monotonic(), title
        if isinstance(progress, SearchProgress):
            told = _search(progress)
            if not console.is_terminal and now - told_at >= _QUIET and progress.rate > 0.0:
                told_at = now
                left = timedelta(seconds=round(progress.seconds_left))
                console.print(f"{told}, {left} left")
        if not bar.live.is_started and now - began > _PATIENCE and progress.part < 1.0:
            bar.start()
        bar.update(task, completed=progress.part, description=told)

    try:
        yield advance
    finally:
        if bar.live.is_started:
            bar.stop()


def _search(progress: SearchProgress) -> str:
    best = f"best {progress.best:.5g}, " if math.isfinite(progress.best) else ""
    generation = f"generation {progress.generation} of {progress.generations}"
    return f"{generation}: {best}{progress.rate:.1f} evaluations/s"
