"""The live page's server, on 127.0.0.1 alone, in a process of its own.

Run as a script by `fpid_pin.view.link`, which alone can write to its input and read its output. It
says its port; then messages come, each a line with its size before it. The first are the token that
admits a viewer, an address that is good for one redirection, and the page. All others are frames;
the answer says how often the page was fetched, and which keys were pressed since the last frame. It
ends with its input, however who started it ended.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import os
import sys
from contextlib import suppress
from itertools import count
from types import SimpleNamespace
from typing import Any

import tornado.web
import tornado.websocket

HOST = "127.0.0.1"
#: Keys passed on between two frames.
KEYS = 16
#: An idle connection is closed after so long, and so is a viewer that answers no ping [s].
IDLE, PING = 5.0, 10.0
HEADERS = {
    "Cache-Control": "no-store",
    # No other page shows this one in a frame, where it could be clicked unseen.
    "Content-Security-Policy": "frame-ancestors 'none'",
    # The address holds the token.
    "Referrer-Policy": "no-referrer",
}
#: What is served, who sees it, and what came of it.
live = SimpleNamespace(token=b"", once=b"", page=b"", viewers=set(), keys="", served=0)


class Gate(tornado.web.RequestHandler):
    """Refuses who does not know the token, with 403 and nothing more."""

    def set_default_headers(self) -> None:
        """Say on every answer how a browser is to treat it."""
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Check the token before anything else."""
        shown = self.path_args[0].encode("utf-8", "replace")
        if live.once and hmac.compare_digest(shown, live.once):
            live.once = b""
            self.redirect(f"/{live.token.decode()}/")
            raise tornado.web.Finish
        if not live.token or not hmac.compare_digest(shown, live.token):
            raise tornado.web.HTTPError(403)

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """End with the status alone."""
        self.finish()


class Page(Gate):
    """The page itself."""

    async def get(self, token: str) -> None:
        """Send the page, and count it once it has been sent."""
        await self.finish(live.page)
        live.served += 1


class Viewer(Gate, tornado.websocket.WebSocketHandler):
    """A stream of frames to a browser, and the keys pressed there."""

    def open(self, token: str) -> None:
        """Note a new viewer."""
        self.set_nodelay(True)
        live.viewers.add(self)

    def on_message(self, message: str | bytes) -> None:
        """Keep a key for the loop: of many the first few, and always the one that ends it."""
        key, kept = str(message), live.keys
        ends = key == "q" and "q" not in kept
        if ends or (len(key) == 1 and key.isprintable() and len(kept) < KEYS):
            live.keys += key

    def on_close(self) -> None:
        """Forget a viewer."""
        live.viewers.discard(self)


def listen(port: int) -> int:
    """Listen on `port` or, where it is taken, on the next one that is free; return which."""
    app = tornado.web.Application(
        websocket_max_message_size=16, websocket_ping_interval=PING, websocket_ping_timeout=PING
    )
    # Names that merely resolve to this machine get nothing.
    rules = [(r"/([^/]*)/", Page), (r"/([^/]*)/frames", Viewer)]
    app.add_handlers(r"127\.0\.0\.1|localhost", rules)
    small: dict[str, Any]
    small = {"max_header_size": 8192, "max_body_size": 0, "max_buffer_size": 2**16}
    for free in count(port):
        with suppress(OSError):
            app.listen(free, address=HOST, idle_connection_timeout=IDLE, **small)
            return free
    raise AssertionError


async def main(port: int) -> None:
    """Serve in this process, and nothing else, for as long as there is an input."""
    # Drawing can wait, the control loop cannot.
    os.nice(5)
    # Refused requests are not worth a line in the user's terminal.
    logging.disable(logging.CRITICAL)
    pipe = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(pipe), sys.stdin
    )

    def say(text: str) -> None:
        sys.stdout.buffer.write(f"{text}\n".encode())
        sys.stdout.buffer.flush()

    async def message() -> bytes:
        return await pipe.readexactly(int(await pipe.readline()))

    say(str(listen(port)))
    live.token, live.once, live.page = [await message() for _ in range(3)]
    while True:
        frame = await message()
        # The answer comes first: a viewer that has just gone must not keep the loop from it.
        say(f"{live.served} {live.keys}")
        live.keys = ""
        for viewer in list(live.viewers):
            with suppress(tornado.websocket.WebSocketClosedError):
                viewer.write_message(frame, binary=True)


if __name__ == "__main__":
    # The input's end is no number.
    with suppress(ValueError, asyncio.IncompleteReadError):
        asyncio.run(main(int(sys.argv[1])))
