"""`fpid-pin view`: recorded runs as one page, in a file or in a browser."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin.cli.screen import say, screen
from fpid_pin.files import require_file
from fpid_pin.simulation import Run

if TYPE_CHECKING:
    from rich.console import Console


def run_view(
    files: Sequence[Path],
    *,
    html: Path | None = None,
    captions: Sequence[str] = (),
    fps: float = 30.0,
    browser: bool = True,
    port: int | None = None,
    console: Console | None = None,
) -> None:
    """Show run files as a page: written where `html` says, else in a browser.

    Parameters
    ----------
    files
        Run files (.npz).
    html
        The page to write; None: a browser shows it.
    captions
        One a run; none: the runs' names.
    fps
        Samples of the motion a second.
    browser, port
        As for `fpid_pin.view.play`.
    console
        Where to print.
    """
    from fpid_pin.view import export_html, play

    console = console or screen()
    if html is not None:
        require_file(html)
    runs = [Run.load(file) for file in files]
    given = list(captions) or None
    if html is not None:
        path = export_html(runs, html, captions=given, fps=fps)
        size = path.stat().st_size / 1e6
        say(console, f"{path}: {size:.2f} MB, opens in any browser")
        return

    play(
        runs, fps=fps, captions=given, open_browser=browser, port=port,
        announce=lambda text: say(console, text),
    )  # fmt: skip
