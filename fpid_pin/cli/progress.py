"""A progress bar for work that takes longer than a person likes to wait in the dark."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from fpid_pin.progress import Progress, ProgressCallback

_PATIENCE = 0.5  # s before a bar is worth showing; most work of two seconds is past it at 25 %


def say_if_compiling() -> None:
    """Say on standard error, once on a machine, why the first run takes longer."""
    # Imported late: it loads numba.
    from fpid_pin.kernels.compiled import is_cold

    if is_cold():
        sys.stderr.write("fpid-pin: compiling the equations for this machine, some seconds, once\n")


@contextmanager
def progress_bar(title: str) -> Iterator[ProgressCallback]:
    """Give a function that takes a `Progress` and draws a bar on standard error."""
    from rich import progress as rich_progress
    from rich.console import Console

    bar = rich_progress.Progress(
        rich_progress.TextColumn("{task.description}"),
        rich_progress.BarColumn(),
        rich_progress.TextColumn("{task.percentage:>3.0f} %"),
        rich_progress.TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(title, total=1.0)
    began = time.monotonic()

    def advance(progress: Progress) -> None:
        part = progress.part
        if not bar.live.is_started and time.monotonic() - began > _PATIENCE and part < 1.0:
            bar.start()
        bar.update(task, completed=part)

    try:
        yield advance
    finally:
        if bar.live.is_started:
            bar.stop()
