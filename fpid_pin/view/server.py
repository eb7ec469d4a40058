"""The live page's server: meshcat's own, on 127.0.0.1 alone, in a process of its own.

Run as a script by `fpid_pin.view.link`. Messages come through meshcat's ZeroMQ socket. The first is
the token that admits a viewer, an address that is good for one redirection, and the page; its
answer is the port. All others are frames; the answer says how often the page was fetched, and which
keys were pressed since the last frame.
"""

import hmac
import logging
import os
import sys
from functools import partial
from typing import Any

import tornado.httpserver
import tornado.ioloop
import tornado.web
from meshcat.servers.zmqserver import WebSocketHandler, ZMQWebSocketBridge, find_available_port

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


class LocalApplication(tornado.web.Application):
    """A web application for this machine alone, that takes small requests only."""

    port = 0

    def listen(self, port: int, *args: Any, **options: Any) -> tornado.httpserver.HTTPServer:
        """Listen on `port` or, where it is taken, on the next one that is free."""
        small: dict[str, Any]
        small = {"max_header_size": 8192, "max_body_size": 0, "max_buffer_size": 2**16}
        listen = partial(super().listen, address=HOST, idle_connection_timeout=IDLE, **small)
        server: tornado.httpserver.HTTPServer
        server, self.port = find_available_port(listen, port)
        return server


class Gate(tornado.web.RequestHandler):
    """Refuses who does not know the token, with 403 and nothing more."""

    bridge: "Bridge"

    def set_default_headers(self) -> None:
        """Say on every answer how a browser is to treat it."""
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Check the token before anything else."""
        shown = self.path_args[0].encode("utf-8", "replace")
        if self.bridge.once and hmac.compare_digest(shown, self.bridge.once):
            self.bridge.once = b""
            self.redirect(f"/{self.bridge.token.decode()}/")
            raise tornado.web.Finish
        if not self.bridge.token or not hmac.compare_digest(shown, self.bridge.token):
            raise tornado.web.HTTPError(403)

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """End with the status alone."""
        self.finish()


class Page(Gate):
    """The page itself."""

    def initialize(self, bridge: "Bridge") -> None:
        """Keep whose page it is."""
        self.bridge = bridge

    async def get(self, token: str) -> None:
        """Send the page, and count it once it has been sent."""
        await self.finish(self.bridge.page)
        self.bridge.served += 1


class Viewer(WebSocketHandler, Gate):  # type: ignore[misc]
    """Meshcat's stream to a browser, and the keys pressed there."""

    def open(self, token: str) -> None:
        """Note a new viewer."""
        self.set_nodelay(True)
        super().open()

    def on_message(self, message: str | bytes) -> None:
        """Keep a key for the loop: of many the first few, and always the one that ends it."""
        key, kept = str(message), self.bridge.keys
        ends = key == "q" and "q" not in kept
        if ends or (len(key) == 1 and key.isprintable() and len(kept) < KEYS):
            self.bridge.keys += key


class Bridge(ZMQWebSocketBridge):  # type: ignore[misc]
    """Meshcat's server with a page of ours, and keys as the answer to a frame."""

    token, once, page, keys, served = b"", b"", b"", "", 0

    def make_app(self) -> LocalApplication:
        """Serve the page and its stream; names that merely resolve to this machine get nothing."""
        app = LocalApplication(
            websocket_max_message_size=16, websocket_ping_interval=PING,
            websocket_ping_timeout=PING,
        )  # fmt: skip
        own = {"bridge": self}
        rules = [(r"/([^/]*)/", Page, own), (r"/([^/]*)/frames", Viewer, own)]
        app.add_handlers(r"127\.0\.0\.1|localhost", rules)
        return app

    def handle_zmq(self, frames: list[bytes]) -> None:
        """Take the page, or pass a frame on to every viewer."""
        if not self.page:
            self.token, self.once, self.page = frames
            self.zmq_socket.send(str(self.app.port).encode())
            return
        # The answer comes first: a viewer that has just gone must not keep the loop from it.
        self.zmq_socket.send(f"{self.served} {self.keys}".encode())
        self.keys = ""
        self.forward_to_websockets((b"", b"", frames[0]))


def main(port: int, url: str, parent: int) -> None:
    """Serve in this process, and nothing else, for as long as the parent lives."""
    # Drawing can wait, the control loop cannot.
    os.nice(5)
    # Refused requests are not worth a line in the user's terminal.
    logging.disable(logging.CRITICAL)
    bridge = Bridge(zmq_url=url, port=port)

    def end_with_parent() -> None:
        if os.getppid() != parent:
            os._exit(0)

    tornado.ioloop.PeriodicCallback(end_with_parent, 1000.0).start()
    bridge.run()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
