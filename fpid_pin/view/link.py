"""Our end of the live page: starts the server's process, sends frames, hears keys."""

from __future__ import annotations

import contextlib
import fcntl
import json
import logging
import os
import secrets
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError

PORT = 7000
_START_LIMIT = 20.0
# Keys taken at a time, and reads of 64 kB to find them: whatever the server has, the loop goes on.
_KEYS, _READS = 128, 4
_log = logging.getLogger("fpid_pin")

Announce = Callable[[str], None]


class LiveLink:
    """A live page and the process that serves it; a context manager.

    Sending never waits: a frame that the server has no room for is dropped. The page's address
    holds a token of 144 random bits; who does not know it is neither served nor heard.

    Parameters
    ----------
    page
        The page, from `fpid_pin.view.page.render`.
    port
        First port to try on 127.0.0.1; None: 7000. Where it is in use the next free one is taken.
    announce
        Told, in a line, what the user needs to know; None: the package's logger.
    """

    def __init__(
        self, page: str, *, port: int | None = None, announce: Announce | None = None
    ) -> None:
        asked = PORT if port is None else checks.integer("port", port, low=1, high=65535)
        self._announce = announce or _log.warning
        self._mention = announce or _log.info
        self._lines = b""
        self._left = b""
        self._news: list[dict[str, object]] = []
        self.viewers = 0
        self.dropped = 0
        self.alive = True
        # A session of its own: Ctrl-C in the terminal is for us to handle, not for the server.
        # -P: the script's folder must not be searched for modules.
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("server.py")), str(asked)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True, bufsize=0,
        )  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out, self._in = self._process.stdin.fileno(), self._process.stdout.fileno()
        _unblock(self._in)
        token, once = secrets.token_urlsafe(18), secrets.token_urlsafe(18)
        try:
            os.write(self._out, f"{token}\n{once}\n".encode())
            self.port = self._wait_for_port()
            self._send_whole(b"P", page.encode("utf-8"))
        except BaseException:
            self.close()
            raise
        self.url = f"http://127.0.0.1:{self.port}/{token}/"
        # A browser's arguments are in the list of processes, which every user can read.
        self._once = f"http://127.0.0.1:{self.port}/{once}/"
        _unblock(self._out)
        if self.port != asked:
            self._announce(f"port {asked} is in use; taking {self.port}")

    @property
    def pid(self) -> int:
        """The server's process."""
        return self._process.pid

    def _wait_for_port(self) -> int:
        limit = time.monotonic() + _START_LIMIT
        while time.monotonic() < limit:
            self._listen()
            for news in self._news:
                if "port" in news:
                    return int(str(news["port"]))
            if self._process.poll() is not None:
                break
            time.sleep(0.01)
        raise FpidError("live view: the server did not start on 127.0.0.1")

    def _send_whole(self, kind: bytes, body: bytes) -> None:
        view = memoryview(len(body).to_bytes(4, "big") + kind + body)
        while view:
            view = view[os.write(self._out, view) :]

    def send(self, t: float, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Send a frame: the time [s] and (q, q_ref, torque), (n,) each, of every run."""
        if not self.alive:
            return
        rows = [np.array([t]), *(array for run in poses for array in run)]
        body = np.concatenate(rows).astype("<f4").tobytes()
        # What is left of a frame that went out in part comes first, or the stream breaks.
        if self._left and not self._push(self._left):
            self.dropped += 1
            return
        self._push(len(body).to_bytes(4, "big") + b"F" + body)

    def _push(self, message: bytes) -> bool:
        try:
            written = os.write(self._out, message)
        except BlockingIOError:
            if message is not self._left:
                self.dropped += 1
            return False
        except OSError:
            self.alive = False
            return False
        self._left = message[written:]
        return not self._left

    def _listen(self) -> None:
        try:
            for _ in range(_READS):
                chunk = os.read(self._in, 65536)
                if not chunk:
                    self.alive = False
                    break
                self._lines += chunk
        except BlockingIOError:
            pass
        except OSError:
            self.alive = False
        *lines, self._lines = self._lines.split(b"\n")
        for line in lines:
            news = json.loads(line)
            self._news.append(news)
            self.viewers = int(news.get("viewers", self.viewers))

    def keys(self) -> str:
        """Return the keys pressed in the page since last asked, the first 128; never waits."""
        self._listen()
        pressed = [str(news["key"]) for news in self._news if "key" in news]
        self._news.clear()
        return "".join(pressed[:_KEYS])

    def show(self, open_browser: bool) -> None:
        """Open the page in a browser, or say where it is."""
        if open_browser and can_open_browser():
            try:
                opened = webbrowser.open(self._once, new=2)
            except webbrowser.Error:
                opened = False
            if opened:
                self._mention(f"live view on {self.url}")
                return
        why = "no display or browser here; " if open_browser else ""
        self._announce(f"{why}open {self.url} in a browser on this machine")

    def close(self) -> None:
        """End the server; nothing is left behind."""
        self.alive = False
        process = self._process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            process.wait(timeout=3.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def __enter__(self) -> LiveLink:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def can_open_browser() -> bool:
    """Whether a graphical browser can be expected: a text one would take the terminal over."""
    if sys.platform == "darwin" or os.environ.get("BROWSER"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _unblock(descriptor: int) -> None:
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_NONBLOCK)
