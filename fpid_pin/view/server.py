"""The live page's web server: a process of its own, on 127.0.0.1 alone, that ends with its parent.

Run as a script by `fpid_pin.view.link`, so that neither its imports nor its work touch the process
that controls. It reads messages from its standard input, a length (4 bytes, big-endian), a kind
(1 byte) and a body: ``P`` the page, ``F`` a frame for every viewer. It writes lines of JSON:
``{"port": 7000}`` once it listens, ``{"viewers": 1}`` and ``{"key": "+"}`` as they happen.
When its standard input ends, for whatever reason, so does it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import sys
from typing import ClassVar

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

HOST = "127.0.0.1"
# A frame behind is dropped for a viewer whose last one is still on its way.
_TRIES = 50


class State:
    """The page, and who is looking at it."""

    page = b""
    port = 0
    viewers: ClassVar[set[Frames]] = set()

    @classmethod
    def local(cls, host: str) -> bool:
        """Whether a request is for this very server: names that merely resolve to it are not."""
        return host in (f"{HOST}:{cls.port}", f"localhost:{cls.port}")


def tell(**news: object) -> None:
    """Write one line for the parent, who may be gone."""
    with contextlib.suppress(OSError):
        sys.stdout.write(json.dumps(news) + "\n")
        sys.stdout.flush()


class Local(tornado.web.RequestHandler):
    """Refuses requests meant for another host: a name may be made to resolve to this machine."""

    def prepare(self) -> None:
        """Check the host before anything else; Tornado itself lets matching origins through."""
        if not State.local(self.request.host):
            raise tornado.web.HTTPError(403)


class Page(Local):
    """The page itself."""

    def get(self) -> None:
        """Send the page."""
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.write(State.page)


class Frames(Local, tornado.websocket.WebSocketHandler):
    """A viewer's stream of frames, and the keys pressed there."""

    busy = False

    def check_origin(self, origin: str) -> bool:
        """Refuse pages of other sites, which browsers let connect anywhere."""
        scheme, _, host = origin.partition("://")
        return scheme == "http" and State.local(host)

    def open(self, *args: str, **kwargs: str) -> None:
        """Note a new viewer."""
        self.set_nodelay(True)
        State.viewers.add(self)
        tell(viewers=len(State.viewers))

    def on_message(self, message: str | bytes) -> None:
        """Pass one printable character on."""
        if isinstance(message, str) and len(message) == 1 and message.isprintable():
            tell(key=message)

    def on_close(self) -> None:
        """Forget a viewer."""
        State.viewers.discard(self)
        tell(viewers=len(State.viewers))

    async def show(self, frame: bytes) -> None:
        """Send a frame, unless the last one is still on its way."""
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
    for candidate in [*range(port, min(port + _TRIES, 65536)), 0]:
        try:
            sockets = tornado.netutil.bind_sockets(candidate, address=HOST)
        except OSError:
            continue
        tornado.httpserver.HTTPServer(application).add_sockets(sockets)
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
    try:
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
    except asyncio.IncompleteReadError:
        return


async def serve(port: int) -> None:
    """Listen, and go on until the parent has had enough or is no more."""
    application = tornado.web.Application([("/", Page), ("/frames", Frames)])
    State.port = listen(application, port)
    tell(port=State.port)
    ends = [asyncio.ensure_future(obey()), asyncio.ensure_future(orphaned())]
    await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    # Browsers keep connections open; there is nothing to say goodbye for.
    os._exit(0)


if __name__ == "__main__":
    # Whatever is drawn can wait; what is controlled cannot.
    os.nice(5)
    # Refused requests are not worth a line in the user's terminal.
    logging.disable(logging.WARNING)
    asyncio.run(serve(int(sys.argv[1])))
