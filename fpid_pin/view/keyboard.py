"""Single key presses from the terminal, which is as it was before when we are done."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from types import TracebackType
from typing import Any


class Keyboard:
    """Reads keys without waiting; a context manager. Without a terminal it reads nothing.

    Ctrl-C still interrupts.
    """

    def __init__(self) -> None:
        self._descriptor: int | None = None
        self._before: Any = None

    def __enter__(self) -> Keyboard:
        try:
            import termios
            import tty

            descriptor = sys.stdin.fileno()
            # A background job would be stopped for touching the terminal.
            if os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp():
                self._before = termios.tcgetattr(descriptor)
                tty.setcbreak(descriptor)
                self._descriptor = descriptor
        except (ImportError, OSError, ValueError, AttributeError):
            # No terminal, no standard input, or a system without either.
            self._descriptor = None
        return self

    @property
    def present(self) -> bool:
        """Whether there is a terminal to read from."""
        return self._descriptor is not None

    def keys(self) -> str:
        """Return the keys pressed since last asked."""
        if self._descriptor is None:
            return ""
        ready, _, _ = select.select([self._descriptor], [], [], 0.0)
        if not ready:
            return ""
        return os.read(self._descriptor, 64).decode("utf-8", errors="ignore")

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._descriptor is not None and self._before is not None:
            import termios

            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            self._descriptor = None
