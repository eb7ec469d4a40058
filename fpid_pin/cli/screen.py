"""What the commands print: text that stays text, whatever is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fpid_pin.text import visible

if TYPE_CHECKING:
    from rich.console import Console


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
