"""What the commands print: text that stays text, whatever is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fpid_pin.text import visible

#: Letters in a line that our tables can do with.
_NARROWEST = 80
_ENDLESS = 10_000

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def screen(*, error: bool = False) -> Console:
    """Return a console for standard output or error on which nothing is markup.

    A name such as ``[red]`` or ``:smile:`` is printed as it is.
    """
    from rich.console import Console

    return Console(stderr=error, markup=False, emoji=False, highlight=False)


def say(console: Console, line: str) -> None:
    """Print a line as it is, control characters written out; it is left to the terminal to wrap.

    An address that was broken in two could not be copied.
    """
    from rich.text import Text

    console.print(Text(visible(line)), soft_wrap=True)


def print_table(console: Console, table: Table) -> None:
    """Print a table whole: in a pipe or a file it is as wide as it would be, given the room.

    A terminal too narrow for its numbers breaks the lines itself.
    """
    wide = console.measure(table, options=console.options.update(max_width=_ENDLESS)).maximum
    console.width = max(console.width, _NARROWEST if console.is_terminal else wide)
    console.print(table)
