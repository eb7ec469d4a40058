"""The live server under attack: from programs, from a flood, and from a page in a real browser.

Every load is bounded in count and in time. `FPID_TORTURE=full` sends more of it.
"""

import contextlib
import itertools
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import psutil
import pytest
from bounded import PATIENCE, ended, finished, started, wait_until

from fpid_pin import paper_controller, paper_experiment
from fpid_pin.view import live, server
from fpid_pin.view.link import LiveLink

pytestmark = pytest.mark.torture
FULL = os.environ.get("FPID_TORTURE") == "full"
HANDSHAKE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
FRAME = [((0.1, 0.2), (0.3, 0.4), (5.0, 6.0))]


def frame_of(text, kind=1, last=True):
    """Return a client's websocket frame; its mask is nought."""
    data = text.encode() if isinstance(text, str) else text
    size = len(data)
    head = bytes([kind | (0x80 if last else 0), 0x80 | (size if size < 126 else 126)])
    if size >= 126:
        head = head[:1] + (bytes([0x80 | 126]) + size.to_bytes(2, "big") if size < 65536
                           else bytes([0x80 | 127]) + size.to_bytes(8, "big"))  # fmt: skip
    return head + bytes(4) + data


class Client:
    """A program that speaks to the server as it likes."""

    def __init__(self, link):
        self.port, self.token = link.port, link.url.split("/")[3]
        self.socket = socket.create_connection(("127.0.0.1", link.port), timeout=10.0)

    def ask(self, path, lines="", host=None, method="GET"):
        """Send the head of a request; return the status, or 0 where the server just closes."""
        host = host or f"127.0.0.1:{self.port}"
        self.send(f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n{lines}\r\n".encode())
        return self.status()

    def status(self):
        try:
            answer = self.socket.recv(4096)
        except (ConnectionError, TimeoutError):
            return 0
        return int(answer.split()[1]) if answer else 0

    def send(self, data):
        with contextlib.suppress(OSError):
            self.socket.sendall(data)

    def watch(self):
        """Become a viewer, as our own page does."""
        lines = f"{HANDSHAKE}Origin: http://127.0.0.1:{self.port}\r\n"
        return self.ask(f"/{self.token}/frames", lines)

    def read_to_the_end(self):
        """Read what the server sends until it closes; return how many bytes that were."""
        self.socket.settimeout(PATIENCE)
        size = 0
        with contextlib.suppress(ConnectionError):
            while data := self.socket.recv(65536):
                size += len(data)
        return size

    def __enter__(self):
        return self

    def __exit__(self, *rest):
        self.socket.close()


@pytest.fixture
def link():
    with LiveLink("page", announce=lambda text: None) as link:
        yield link
        assert psutil.Process(link.pid).is_running()


def served(link):
    with urllib.request.urlopen(link.url, timeout=10.0) as answer:
        return answer.read() == b"page"


def heard(link, count):
    """Return the next keys that a link hears, so many at least."""
    keys = []
    assert wait_until(lambda: keys.append(link.keys()) or len("".join(keys)) >= count)
    return "".join(keys)


@contextlib.contextmanager
def session(duration):
    """Run a live session in a thread; give its link's stand-in and where its report will be."""
    said, reports = [], []

    class Address:
        url, port = "", 0

    Address.said = said

    def work():
        reports.append(
            live(paper_experiment(), paper_controller(), duration=duration, open_browser=False,
                 priority=False, announce=said.append)
        )  # fmt: skip

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    assert wait_until(lambda: any("http" in text for text in said))
    Address.url = next(text for text in said if "http" in text).split()[1]
    Address.port = int(Address.url.split(":")[2].split("/")[0])
    yield Address, thread, reports
    assert ended(thread)


# ------------------------------------------------------------------ who is heard


def test_without_the_token_no_key_is_heard(link):
    origins = ("", f"Origin: http://127.0.0.1:{link.port}\r\n")
    for token, origin in itertools.product(("", "x", "{token}x", "%2e%2e/{token}"), origins):
        with Client(link) as client:
            path = f"/{token.format(token=client.token)}/frames".replace("//", "/")
            assert client.ask(path, HANDSHAKE + origin) in (403, 404)
            client.send(frame_of("q") * 10)
            # A viewer's key comes through, and nothing before it.
            with Client(link) as viewer:
                assert viewer.watch() == 101
                viewer.send(frame_of("+"))
                assert heard(link, 1) == "+"
            assert wait_until(lambda: link.keys() == "" and link.viewers == 0)


def test_a_program_without_an_origin_cannot_end_the_session():
    """It could: browsers give an origin, and only that was checked."""
    with session(duration=PATIENCE) as (link, _, reports):
        for path in ("/frames", "/{token}/frames"):
            with Client(link) as client:
                assert client.ask(path.format(token=client.token), HANDSHAKE) == 403
                client.send(frame_of("q"))
        with Client(link) as viewer:
            assert viewer.watch() == 101
            # It goes on: a viewer's push is taken, and then its end.
            viewer.send(frame_of("+"))
            assert wait_until(lambda: any(" N m on " in text for text in link.said))
            viewer.send(frame_of("q"))
    assert len(reports[0].pushes) == 1


# ------------------------------------------------------------------ floods


def flood(client, stop):
    """Press + as often as the network takes it; return how often that was."""
    block = frame_of("+") * 4096
    limit = time.monotonic() + PATIENCE
    sent = 0
    while time.monotonic() < limit and not stop.is_set():
        try:
            sent += client.socket.send(block)
        except OSError:
            break
    return sent // len(frame_of("+"))


def test_a_flood_of_keys_neither_keeps_the_session_nor_floods_the_arm():
    """464,000 of them in nine seconds did."""
    seconds, stop, sent = (9.0 if FULL else 1.0), threading.Event(), []

    def press(link):
        while not stop.is_set():
            # Dropped, it comes back.
            with contextlib.suppress(OSError), Client(link) as client:
                client.watch()
                sent.append(flood(client, stop))

    with session(duration=seconds) as (link, thread, reports):
        presses = threading.Thread(target=press, args=(link,), daemon=True)
        presses.start()
        # The flood goes on until the session has come to its end.
        over = ended(thread)
        stop.set()
        assert ended(presses)
        assert over
    report = reports[0]
    assert report.timing.ticks == round(1000 * seconds)
    assert len(report.pushes) <= server.KEYS * report.send_times.size < sum(sent)


def test_a_flooded_session_is_ended_by_a_key():
    with session(duration=300.0) as (link, thread, _), Client(link) as noisy:
        noisy.watch()
        noisy.socket.settimeout(1.0)
        stop = threading.Event()
        presses = threading.Thread(target=flood, args=(noisy, stop), daemon=True)
        presses.start()
        with Client(link) as client:
            assert client.watch() == 101
            client.send(frame_of("q"))
            over = ended(thread)
        stop.set()
        assert ended(presses)
        assert over


def test_keys_are_capped_between_frames_and_a_viewer_that_goes_on_is_dropped(link):
    with Client(link) as client:
        assert client.watch() == 101
        client.send(frame_of("+") * 100)
        assert heard(link, server.KEYS) == "+" * server.KEYS
        link.send(0.0, FRAME)
        assert client.socket.recv(65536)
        # Of the hundred no more came, though the server has read them all: these are later.
        client.send(frame_of("-") * 3)
        assert heard(link, 3) == "---"
        client.send(frame_of("+") * 300)
        client.read_to_the_end()
    assert wait_until(lambda: link.keys() == "" and link.viewers == 0)


# ------------------------------------------------------------------ sizes


def resident(link):
    return psutil.Process(link.pid).memory_info().rss / 1e6


def pour(client, head, megabytes):
    """Send a head and then zeros, for as long as they are taken; return how many MB were."""
    client.send(head)
    client.socket.settimeout(2.0)
    poured = 0
    with contextlib.suppress(OSError):
        for _ in range(megabytes):
            client.socket.sendall(bytes(10**6))
            poured += 1
    return poured


CHUNKED = "Transfer-Encoding: chunked\r\n\r\n7fffffff\r\n"
LENGTH = "Content-Length: 150000000\r\n\r\n"
BODIES = {
    "wrong host": ("POST / HTTP/1.1\r\nHost: evil.example\r\n", LENGTH),
    "own host": ("POST /{token}/ HTTP/1.1\r\nHost: {host}\r\n", LENGTH),
    "chunked": ("POST /{token}/ HTTP/1.1\r\nHost: {host}\r\n", CHUNKED),
    "head": ("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n", "X: "),
    "address": ("GET /", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES if FULL else ["wrong host", "chunked", "head"])
def test_what_is_too_large_takes_no_memory(link, name):
    """Eight requests of 150 MB took 1.2 GB, before anyone asked whom they were for."""
    served(link)
    before = resident(link)
    clients = [Client(link) for _ in range(8 if FULL else 2)]
    head = "".join(BODIES[name]).format(token=clients[0].token, host=f"127.0.0.1:{link.port}")
    poured = [pour(client, head.encode(), 150 if FULL else 10) for client in clients]
    assert resident(link) - before < 20.0
    for client in clients:
        client.socket.close()
    # Not read, not even to be thrown away.
    assert max(poured) < 10
    assert served(link)


@pytest.mark.parametrize(
    "message",
    [frame_of("x" * 17), frame_of("x" * 10**6), frame_of("x" * 10, last=False) * 3,
     bytes([0x81, 0xFF]) + (2**62).to_bytes(8, "big") + bytes(4)],
    ids=["long", "1 MB", "in parts", "2^62"],
)  # fmt: skip
def test_a_message_longer_than_a_key_costs_a_viewer_its_place(link, message):
    with Client(link) as client:
        assert client.watch() == 101
        client.send(message)
        client.read_to_the_end()
    assert link.keys() == ""
    assert served(link)


# ------------------------------------------------------------------ numbers and patience


def connections(link):
    found = psutil.Process(link.pid).net_connections("tcp")
    return sum(c.status == psutil.CONN_ESTABLISHED for c in found)


def test_connections_are_capped_and_the_user_gets_in(link):
    clients = [Client(link) for _ in range(500 if FULL else 150)]
    assert served(link)
    assert connections(link) <= server.CONNECTIONS
    for client in clients:
        client.socket.close()


def test_viewers_are_capped(link):
    clients = [Client(link) for _ in range(server.VIEWERS + 2)]
    statuses = [client.watch() for client in clients]
    assert statuses == [101] * server.VIEWERS + [503] * 2
    assert wait_until(lambda: link.keys() == "" and link.viewers == server.VIEWERS)
    clients[0].socket.close()
    assert wait_until(lambda: link.keys() == "" and link.viewers == server.VIEWERS - 1)
    with Client(link) as late:
        assert late.watch() == 101
    for client in clients:
        client.socket.close()


IMPATIENT = """
from fpid_pin.view import server
server.PING = server.IDLE = 0.5
server.main(0)
"""


@contextlib.contextmanager
def impatient(page):
    """Run a server that waits for half a second only; give what a client needs of its link."""
    command = [sys.executable, "-c", IMPATIENT]
    with started(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:

        class Address:
            url, port, pid = "http://127.0.0.1/token/", 0, process.pid

        process.stdin.write(b"token\nonce\n" + len(page).to_bytes(4, "big") + b"P" + page)
        process.stdin.flush()
        Address.port = json.loads(process.stdout.readline())["port"]
        yield Address, process
        process.kill()


def test_who_asks_for_nothing_or_never_ends_asking_is_dropped():
    with impatient(b"page") as (address, _):
        began = time.monotonic()
        clients = [Client(address) for _ in range(10)]
        with clients[0] as slow:
            slow.socket.settimeout(0.1)
            for letter in f"GET /token/ HTTP/1.1\r\nX: {'a' * 1000}":
                slow.send(letter.encode())
                with contextlib.suppress(TimeoutError):
                    if not slow.socket.recv(1):
                        break
            else:
                pytest.fail("the server waited for the last letter")
        for client in clients[1:]:
            assert client.read_to_the_end() == 0
            client.socket.close()
        # Not at once: they had their time.
        assert time.monotonic() - began > 0.4
        assert wait_until(lambda: connections(address) == 0)


def test_who_does_not_take_the_page_is_dropped():
    page = b"x" * 30_000_000  # which no buffer on the way holds
    with impatient(page) as (address, process), Client(address) as deaf:
        head = f"GET /token/ HTTP/1.1\r\nHost: 127.0.0.1:{address.port}\r\n\r\n"
        deaf.send(head.encode())
        assert deaf.socket.recv(1) == b"H"
        assert wait_until(lambda: connections(address) == 0)
        assert deaf.read_to_the_end() < len(page)
        assert process.poll() is None


@pytest.mark.skipif(not FULL, reason="seven seconds: FPID_TORTURE=full")
def test_a_viewer_that_does_not_answer_is_dropped():
    with impatient(b"page") as (address, _), Client(address) as silent:
        assert silent.watch() == 101
        # A ping, half a second for the answer, and five for the client to close by itself.
        assert wait_until(lambda: connections(address) == 0)


# ------------------------------------------------------------------ nonsense


def nonsense(rng, token, port):
    """Return requests and messages with a few bytes changed, lost or doubled, or mere noise."""
    origin, own = f"Origin: http://127.0.0.1:{port}\r\n", f"Host: 127.0.0.1:{port}\r\n"
    sound = [
        f"GET /{token}/ HTTP/1.1\r\n{own}\r\n".encode(),
        f"GET /{token}/frames HTTP/1.1\r\n{own}{HANDSHAKE}{origin}\r\n".encode()
        + b"".join(frame_of("a", kind) for kind in (1, 2, 9, 10, 1, 0, 8)),
        b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
    ]  # fmt: skip
    data = bytearray(rng.choice(sound))
    for _ in range(rng.randrange(1, 6)):
        k = rng.randrange(len(data))
        kind = rng.randrange(4)
        if kind == 0:
            data[k] = rng.randrange(256)
        elif kind == 1:
            del data[k : k + rng.randrange(20)]
        elif kind == 2:
            data[k:k] = data[k : k + rng.randrange(60)]
        else:
            data[k:k] = rng.randbytes(rng.randrange(60))
        if not data:
            data += b"\0"
    return bytes(data)


def test_nonsense_is_survived_and_says_nothing(link, tally):
    rng, token = random.Random(5), link.url.split("/")[3]
    # Without the token: what is heard would be a way in.
    for _ in range(3000 if FULL else 60):
        with Client(link) as client:
            client.send(nonsense(rng, "guess", link.port))
            client.socket.shutdown(socket.SHUT_WR)
            client.socket.settimeout(0.2)
            with contextlib.suppress(OSError):
                assert b"page" not in client.socket.recv(65536).partition(b"\r\n\r\n")[2]
        tally("requests of nonsense")
    assert link.keys() == ""
    for _ in range(3000 if FULL else 60):
        with Client(link) as client:
            client.send(nonsense(rng, token, link.port))
        tally("and with the token")
    assert set(link.keys()) <= set(map(chr, range(32, 256)))
    assert served(link)
    assert resident(link) < 200.0


# ------------------------------------------------------------------ a page in a browser


@pytest.mark.browser
@pytest.mark.skipif(not FULL, reason="thirty seconds: FPID_TORTURE=full")
def test_a_hostile_page_beside_the_live_one_gets_nothing():
    if shutil.which("chromium") is None:
        pytest.skip("no chromium here (apt-get install chromium)")
    pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with session(duration=300.0) as (link, thread, reports):
        script = Path(__file__).with_name("hostile_page.py")
        done = finished([sys.executable, script, link.url, "300" if FULL else "60"], timeout=200)
        assert done.returncode == 0, done.stderr
        # The user's own page, in the same browser, went on and then ended it.
        assert ended(thread)
    found = json.loads(done.stdout)
    assert found.pop("rebound name") == [403]
    assert found.pop("frame") == [False]
    assert found.pop("frames meanwhile") > 3
    # An opaque answer is one that the page cannot look into.
    assert found.pop("post blindly") in ("opaque", "refused", "nothing")
    assert found.keys() >= {"socket", "socket with the token", "script", "read with the token"}
    assert set(found.values()) <= {"refused", "nothing", "cut off"}, found
    assert reports[0].pushes == ()
    assert reports[0].fault == ""
