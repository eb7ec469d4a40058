"""`fpid-pin view`: recorded runs as one page, or played live."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from fpid_pin.files import require_file
from fpid_pin.simulation import Run


def run_view(
    files: Sequence[Path],
    *,
    html: Path | None = None,
    captions: Sequence[str] = (),
    fps: float = 30.0,
    speed: float = 1.0,
    loop: bool = False,
    browser: bool = True,
    port: int | None = None,
    console: Console | None = None,
) -> None:
    """Show run files: as a page where `html` says where to, else live until they end or Ctrl-C.

    Parameters
    ----------
    files
        Run files (.npz).
    html
        The page to write; None: a live view.
    captions
        One a run; none: the runs' names.
    fps
        Frames a second of either.
    speed, loop, browser, port
        As for `fpid_pin.view.play`.
    console
        Where to print.
    """
    from fpid_pin.view import export_html, play

    console = console or Console()
    if html is not None:
        require_file(html)
    runs = [Run.load(file) for file in files]
    given = list(captions) or None
    if html is not None:
        path = export_html(runs, html, captions=given, fps=fps)
        size = path.stat().st_size / 1e6
        console.print(f"{path}: {size:.2f} MB, opens in any browser", highlight=False)
        return

    def announce(text: str) -> None:
        console.print(text, highlight=False)

    announce("Ctrl-C ends it; in the page, the space bar halts and q ends it")
    play(
        runs, speed=speed, loop=loop, open_browser=browser, port=port, fps=fps, captions=given,
        announce=announce,
    )  # fmt: skip
