"""The live page's web server: a process of its own, on 127.0.0.1 alone, that ends with its parent.

Run as a script by `fpid_pin.view.link`, so that neither its imports nor its work touch the process
that controls. It reads two lines from its standard input, the token and what is good for one
redirection to it, then messages: a length (4 bytes, big-endian), a kind (1 byte) and a body: ``P``
the page, ``F`` a frame for every viewer. It writes lines of JSON: ``{"port": 7000}`` once it
listens, ``{"viewers": 1}`` and ``{"key": "+"}``. When its input ends, so does it.

Any program of any user of this machine may connect, and so may any page that a browser shows. None
is served or heard without the token, and what those without it send takes neither memory nor, for
long, a connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import logging
import os
import sys
from typing import Any, ClassVar

import tornado.httpserver
import tornado.iostream
import tornado.netutil
import tornado.web
import tornado.websocket

HOST = "127.0.0.1"
# Ports tried after the one that was asked for.
TRIES = 50
#: Connections at a time, and of these viewers.
CONNECTIONS, VIEWERS = 32, 8
#: Sizes of a request's head, of its body, and of a viewer's message, which is one key [bytes].
HEAD, BODY, MESSAGE = 8192, 0, 16
#: Keys of one viewer passed on between two frames, and how many cost it its place.
KEYS, PATIENCE = 16, 200
#: A connection that asks for nothing is closed after so long, and a page not taken by then [s].
IDLE = 5.0
#: A viewer is asked so often whether it is still there, and has so long to answer [s].
PING = 10.0
HEADERS = {
    "Cache-Control": "no-store",
    # The page cannot say this of itself: that no other shows it in a frame, to be clicked blindly.
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    # The address holds the token.
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class State:
    """The page, and who is looking at it."""

    page = b""
    port = 0
    token = b""
    # What a browser is started with, in the sight of all; it is good for one answer.
    once = b""
    viewers: ClassVar[set[Frames]] = set()
    # Connections in the order in which they came; True: has shown the token.
    streams: ClassVar[dict[tornado.iostream.IOStream, bool]] = {}

    @classmethod
    def local(cls, host: str) -> bool:
        """Whether a request is for this very server: names that merely resolve to it are not."""
        return host in (f"{HOST}:{cls.port}", f"localhost:{cls.port}")

    @classmethod
    def admits(cls, path: str) -> bool:
        """Whether a path begins with the token; how long this takes says nothing about it."""
        shown = "".join(path.split("/")[1:2]).encode("utf-8", "replace")
        return bool(cls.token) and hmac.compare_digest(shown, cls.token)

    @classmethod
    def spends(cls, path: str) -> bool:
        """Whether a path is the one that is good for once, which it was with this."""
        good = bool(cls.once) and hmac.compare_digest(path.encode("utf-8", "replace"), cls.once)
        cls.once = b"" if good else cls.once
        return good

    @classmethod
    def has_room(cls, stream: tornado.iostream.IOStream) -> bool:
        """Take a connection in, if need be for the oldest of those that have not shown the token.

        Whoever holds all of them open would keep the user out, were it the newest that goes.
        """
        cls.streams = {old: known for old, known in cls.streams.items() if not old.closed()}
        if len(cls.streams) >= CONNECTIONS:
            stranger = next((old for old, known in cls.streams.items() if not known), None)
            if stranger is None:
                return False
            stranger.close()
            del cls.streams[stranger]
        cls.streams[stream] = False
        return True


class Server(tornado.httpserver.HTTPServer):
    """A web server with so many connections at most."""

    def handle_stream(self, stream: tornado.iostream.IOStream, address: Any) -> None:
        """Serve a new connection, or close it."""
        if not State.has_room(stream):
            return stream.close()
        super().handle_stream(stream, address)


def tell(**news: object) -> None:
    """Write one line for the parent, who may be gone."""
    with contextlib.suppress(OSError):
        sys.stdout.write(json.dumps(news) + "\n")
        sys.stdout.flush()


class Gate(tornado.web.RequestHandler):
    """Refuses, without a word, who has not the token or asks for another host.

    A name may be made to resolve to this machine.
    """

    stream: tornado.iostream.IOStream

    def set_default_headers(self) -> None:
        """Say on every answer how a browser is to treat it."""
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        """Check host and token before anything else."""
        if not State.local(self.request.host):
            raise tornado.web.HTTPError(403)
        if State.spends(self.request.path):
            self.redirect(f"/{State.token.decode()}/")
            raise tornado.web.Finish
        if not State.admits(self.request.path):
            raise tornado.web.HTTPError(403)
        connection: Any = self.request.connection
        self.stream = connection.stream
        State.streams[self.stream] = True

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """End with the status alone."""
        self.finish()


class Nothing(Gate):
    """Whatever else is asked for with the token."""

    def get(self) -> None:
        """Say that it is not here."""
        raise tornado.web.HTTPError(404)


class Page(Gate):
    """The page itself."""

    async def get(self) -> None:
        """Send the page; close on a browser that does not take it."""
        try:
            await asyncio.wait_for(self.finish(State.page), IDLE)
        except (TimeoutError, tornado.iostream.StreamClosedError):
            self.stream.close()


class Frames(Gate, tornado.websocket.WebSocketHandler):
    """A viewer's stream of frames, and the keys pressed there."""

    busy = False
    heard = 0

    def prepare(self) -> None:
        """Refuse one viewer too many, and pages of other sites, which browsers let connect."""
        super().prepare()
        # Tornado asks `check_origin` only where there is an origin; every browser gives one.
        if not self.check_origin(self.request.headers.get("Origin", "")):
            raise tornado.web.HTTPError(403)
        if len(State.viewers) >= VIEWERS:
            raise tornado.web.HTTPError(503)

    def check_origin(self, origin: str) -> bool:
        """Whether a page is ours."""
        scheme, _, host = origin.partition("://")
        return scheme == "http" and State.local(host)

    def open(self, *args: str, **kwargs: str) -> None:
        """Note a new viewer."""
        self.set_nodelay(True)
        State.viewers.add(self)
        tell(viewers=len(State.viewers))

    def on_message(self, message: str | bytes) -> None:
        """Pass one printable character on, unless there were too many since the last frame."""
        self.heard += 1
        if self.heard > PATIENCE:
            self.stream.close()
        key = message if isinstance(message, str) and len(message) == 1 else ""
        if key.isprintable() and key and self.heard <= KEYS:
            tell(key=key)

    def on_close(self) -> None:
        """Forget a viewer."""
        State.viewers.discard(self)
        tell(viewers=len(State.viewers))

    async def show(self, frame: bytes) -> None:
        """Send a frame, unless the last one is still on its way."""
        self.heard = 0
        if self.busy:
            return
        self.busy = True
        try:
            await self.write_message(frame, binary=True)
        except tornado.websocket.WebSocketClosedError:
            State.viewers.discard(self)
        finally:
            self.busy = False


def listen(application: tornado.web.Application, port: int) -> int:
    """Listen on `port` or, where it is taken, the next one that is free."""
    for candidate in [*range(port, min(port + TRIES, 65536)), 0]:
        try:
            sockets = tornado.netutil.bind_sockets(candidate, address=HOST)
        except OSError:
            continue
        server = Server(
            application, max_header_size=HEAD, max_body_size=BODY, idle_connection_timeout=IDLE,
            max_buffer_size=2**16,
        )  # fmt: skip
        server.add_sockets(sockets)
        return int(sockets[0].getsockname()[1])
    raise OSError("no free port")


async def orphaned() -> None:
    """Return once the parent is gone, even if someone else still holds our input open."""
    parent = os.getppid()
    while os.getppid() == parent:
        await asyncio.sleep(1.0)


async def obey() -> None:
    """Read messages until the input ends."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=2**20)
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    pending: set[asyncio.Task[None]] = set()
    with contextlib.suppress(asyncio.IncompleteReadError):
        while True:
            head = await reader.readexactly(5)
            body = await reader.readexactly(int.from_bytes(head[:4], "big"))
            if head[4:] == b"P":
                State.page = body
            else:
                for viewer in list(State.viewers):
                    task = loop.create_task(viewer.show(body))
                    pending.add(task)
                    task.add_done_callback(pending.discard)


def read_line() -> bytes:
    """Read a line of the input, and not a byte more: the rest is for the loop."""
    return b"".join(iter(lambda: os.read(0, 1).strip(), b""))


async def serve(port: int) -> None:
    """Listen, and go on until the parent has had enough or is no more."""
    # Not an argument: those are in the list of processes, which every user can read.
    State.token, State.once = read_line(), b"/" + read_line() + b"/"
    application = tornado.web.Application(
        [(r"/[^/]*/", Page), (r"/[^/]*/frames", Frames)], default_handler_class=Nothing,
        websocket_max_message_size=MESSAGE, websocket_ping_interval=PING,
        websocket_ping_timeout=PING,
    )  # fmt: skip
    State.port = listen(application, port)
    tell(port=State.port)
    ends = [asyncio.ensure_future(obey()), asyncio.ensure_future(orphaned())]
    await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    # Browsers keep connections open; there is nothing to say goodbye for.
    os._exit(0)


def main(port: int) -> None:
    """Serve in this process, and nothing else."""
    # Whatever is drawn can wait; what is controlled cannot.
    os.nice(5)
    # Refused requests are not worth a line in the user's terminal.
    logging.disable(logging.CRITICAL)
    asyncio.run(serve(port))


if __name__ == "__main__":
    main(int(sys.argv[1]))
