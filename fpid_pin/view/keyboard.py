"""Single key presses from the terminal, which is as it was before when we are done."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from typing import Any


class Keyboard:
    """Reads keys without waiting; a context manager. Without a terminal it reads nothing.

    Ctrl-C still interrupts.
    """

    def __init__(self) -> None:
        self._descriptor = -1
        self._before: Any = None

    def __enter__(self) -> Keyboard:
        # No terminal, no standard input, or a system without either.
        with contextlib.suppress(ImportError, OSError, ValueError, AttributeError):
            import termios
            import tty

            descriptor = sys.stdin.fileno()
            # A background job would be stopped for touching the terminal.
            if os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp():
                self._before = termios.tcgetattr(descriptor)
                tty.setcbreak(descriptor)
                self._descriptor = descriptor
        return self

    def keys(self) -> str:
        """Return the keys pressed since last asked."""
        if self._descriptor < 0 or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        return os.read(self._descriptor, 64).decode("utf-8", errors="ignore")

    def __exit__(self, *exception: object) -> None:
        if self._descriptor >= 0:
            import termios

            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            self._descriptor = -1
