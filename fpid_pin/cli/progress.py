"""A progress bar for work that takes longer than a person likes to wait in the dark."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_PATIENCE = 0.5  # s before a bar is worth showing; most work of two seconds is past it at 25 %


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """Give a function that takes the part done, 0 to 1, and draws a bar on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(title, total=1.0)
    began = time.monotonic()

    def advance(part: float) -> None:
        if not bar.live.is_started and time.monotonic() - began > _PATIENCE and part < 1.0:
            bar.start()
        bar.update(task, completed=part)

    try:
        yield advance
    finally:
        if bar.live.is_started:
            bar.stop()
