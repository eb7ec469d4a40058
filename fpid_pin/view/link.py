"""Our end of the live page: starts meshcat's server, sends frames, hears keys."""

import logging
import os
import secrets
import subprocess
import sys
import tempfile
import time
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
        import zmq

        asked = PORT if port is None else checks.integer("port", port, low=1, high=65535)
        self._announce = announce or _log.warning
        self._mention = announce or _log.info
        #: How often the page was fetched, and frames that were left out.
        self.served, self.dropped = 0, 0
        self._keys, self._waiting = "", False
        token, once = secrets.token_urlsafe(18), secrets.token_urlsafe(18)
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REQ)
        # A socket in a private folder: nobody else can send frames or take keys.
        with tempfile.TemporaryDirectory(prefix="fpid_pin-") as folder:
            address, script = f"ipc://{folder}/frames", Path(__file__).with_name("server.py")
            # A session of its own: Ctrl-C in the terminal is for us to handle, not for the server.
            # -P: the script's folder must not be searched for modules.
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(script), str(asked), address, str(os.getpid())],
                start_new_session=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
            #: The server's process.
            self.pid = self._process.pid
            try:
                self._socket.connect(address)
                self._socket.send_multipart([token.encode(), once.encode(), page.encode()])
                limit = time.monotonic() + _START_LIMIT
                while not self._socket.poll(50):
                    if not self.alive or time.monotonic() > limit:
                        raise FpidError("live view: the server did not start on 127.0.0.1")
                self.port = int(self._socket.recv())
            except BaseException as error:
                self.close()
                if isinstance(error, zmq.ZMQError):
                    raise FpidError(f"live view: {address}: {error}") from None
                raise
        self.url = f"http://127.0.0.1:{self.port}/{token}/"
        # A browser's arguments are in the list of processes, which every user can read.
        self._once = f"http://127.0.0.1:{self.port}/{once}/"
        if self.port != asked:
            self._announce(f"port {asked} is in use; taking {self.port}")

    @property
    def alive(self) -> bool:
        """Whether the server runs."""
        return self._process.poll() is None

    def send(self, t: float, poses: Sequence[Sequence[FloatArray]]) -> None:
        """Send a frame: the time [s] and (q, q_ref, torque), (n,) each, of every run."""
        import zmq

        if self._hear():
            rows = [np.array([t]), *(array for run in poses for array in run)]
            self._socket.send(np.concatenate(rows).astype("<f4").tobytes(), zmq.NOBLOCK)
            self._waiting = True
        else:
            self.dropped += 1

    def _hear(self) -> bool:
        """Take the server's answer, if there is one; return whether it is ready for a frame."""
        if self._waiting and self._socket.poll(0):
            count, _, keys = self._socket.recv().decode("utf-8", "replace").partition(" ")
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
        self._process.wait()
        self._context.destroy(linger=0)

    def __enter__(self) -> "LiveLink":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def can_open_browser() -> bool:
    """Whether a graphical browser can be expected: a text one would take the terminal over."""
    if sys.platform == "darwin" or os.environ.get("BROWSER"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
