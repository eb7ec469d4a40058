"""Our end of the live page: starts its server, sends frames, hears keys."""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import select
import subprocess
import sys
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError

PORT = 7000
_START_LIMIT = 20.0
_log = logging.getLogger("fpid_pin")


class LiveLink:
    """A live page and the process that serves it; a context manager.

    The page is served at `url`, on the first port of 127.0.0.1 that is free from `port` on, 7000
    unless given. Its address holds a token of 144 random bits; who does not know it is neither
    served nor heard. Sending never waits: while the server is busy with a frame, others are
    `dropped`. `announce` is told, in a line, what the user needs to know; None: the logger.
    """

    def __init__(
        self, page: str, *, port: int | None = None, announce: Callable[[str], None] | None = None
    ) -> None:
        asked = PORT if port is None else checks.integer("port", port, low=1, high=65535)
        self._announce = announce or _log.warning
        self._mention = announce or _log.info
        #: How often the page was fetched, and frames that were left out.
        self.served, self.dropped = 0, 0
        self._keys, self._waiting = "", False
        token, once = secrets.token_urlsafe(18), secrets.token_urlsafe(18)
        # Nobody else can write to the server or read what it says.
        # A session of its own: Ctrl-C in the terminal is for us to handle, not for the server.
        # -P: the script's folder must not be searched for modules.
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("server.py")), str(asked)],
            start_new_session=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        #: The server's process.
        self.pid = self._process.pid
        try:
            self.port = int(self._answer(_START_LIMIT))
            for message in (token, once, page):
                self._write(message.encode())
        except BaseException as error:
            self.close()
            if isinstance(error, (OSError, ValueError)):
                raise FpidError("live view: the server did not start on 127.0.0.1") from None
            raise
        self.url = f"http://127.0.0.1:{self.port}/{token}/"
        # A browser's arguments are in the list of processes, which every user can read.
        self._once = f"http://127.0.0.1:{self.port}/{once}/"
        if self.port != asked:
            self._announce(f"port {asked} is in use; taking {self.port}")

    def _write(self, message: bytes) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(b"%d\n" % len(message) + message)
        self._process.stdin.flush()

    def _answer(self, seconds: float) -> str:
        """Return the server's next line; empty where it says none in this time, or has ended."""
        out = self._process.stdout
        assert out is not None
        ready = select.select([out], [], [], seconds)[0]
        return out.readline().decode("utf-8", "replace").rstrip("\n") if ready else ""

    @property
    def alive(self) -> bool:
        """Whether the server runs."""
        return self._process.poll() is None

    def send(self, t: float, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Send a frame: the time [s] and (q, q_ref, torque), (n,) each, of every run."""
        if self._hear():
            rows = [np.array([t]), *(array for run in poses for array in run)]
            self._waiting = True
            # One that has ended takes no frame, and answers none.
            with contextlib.suppress(BrokenPipeError):
                self._write(np.concatenate(rows).astype("<f4").tobytes())
        else:
            self.dropped += 1

    def _hear(self) -> bool:
        """Take the server's answer, if there is one; return whether it is ready for a frame."""
        if self._waiting and (answer := self._answer(0.0)):
            count, _, keys = answer.partition(" ")
            self.served, self._keys, self._waiting = int(count), self._keys + keys, False
        return not self._waiting

    def keys(self) -> str:
        """Return the keys pressed in the page since last asked; never waits."""
        self._hear()
        pressed, self._keys = self._keys, ""
        return pressed

    def show(self, open_browser: bool) -> None:
        """Open the page in a browser, or say where it is."""
        if open_browser and can_open_browser() and webbrowser.open(self._once, new=2):
            self._mention(f"live view on {self.url}")
        else:
            why = "no display or browser here; " if open_browser else ""
            self._announce(f"{why}open {self.url} in a browser on this machine")

    def close(self) -> None:
        """End the server; nothing is left behind."""
        self._process.kill()
        # What a dead server has not taken cannot be flushed.
        with contextlib.suppress(BrokenPipeError), self._process:
            pass

    def __enter__(self) -> LiveLink:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def can_open_browser() -> bool:
    """Whether a graphical browser can be expected: a text one would take the terminal over."""
    if sys.platform == "darwin" or os.environ.get("BROWSER"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
