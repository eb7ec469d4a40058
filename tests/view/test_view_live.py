"""The live view: who listens, for how long, who is heard; its period, frames, keys and command."""

import gc
import os
import pty
import random
import re
import signal
import socket
import subprocess
import sys
import termios
import threading
import urllib.error
import urllib.request
from contextlib import suppress

import numpy as np
import psutil
import pytest
from bounded import PATIENCE, ended, started, wait_until

from fpid_pin import Arm, Experiment, FpidError, Plant, paper_controller, paper_experiment, simulate
from fpid_pin.cli import commands
from fpid_pin.cli.configuration import demo_config
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold
from fpid_pin.simulation.engine import Simulation
from fpid_pin.view import live, live_session, play
from fpid_pin.view.link import LiveLink, can_open_browser
from fpid_pin.view.live_session import KeyInput, keep_time, keyboard

LIVE = """
import fpid_pin as fp, sys
from fpid_pin.view import live
report = live(fp.paper_experiment(), fp.paper_controller(), open_browser=False,
              announce=lambda text: print(text, flush=True))
print("ended with a report of", type(report.timing).__name__, flush=True)
"""
FRAME = [(np.zeros(2), np.ones(2), np.ones(2))]


def addresses(pid):
    """Every network address that a process and its children listen on."""
    family = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    return {
        c.laddr.ip
        for process in family
        for c in process.net_connections("inet")
        if c.status == psutil.CONN_LISTEN or c.type == socket.SOCK_DGRAM
    }


def answers(port):
    with socket.socket() as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_only_loopback_is_listened_on_and_nothing_outlives_ctrl_c_or_a_kill(end):
    pipes = {"stdout": subprocess.PIPE, "stdin": subprocess.DEVNULL, "text": True}
    with started([sys.executable, "-c", LIVE], **pipes) as process:
        line = next(line for line in iter(process.stdout.readline, "") if "http://" in line)
        port = int(re.search(r"127.0.0.1:(\d+)", line)[1])
        assert answers(port)
        assert addresses(process.pid) == {"127.0.0.1"}
        (child,) = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(end)
        said = process.stdout.read()
        assert ("ended with a report of Timing" in said) == (end == signal.SIGINT)
        assert process.wait(PATIENCE) == (0 if end == signal.SIGINT else -end)
        assert wait_until(lambda: not child.is_running())
        assert not answers(port)


@pytest.fixture
def link():
    with LiveLink("page", announce=lambda text: None) as opened:
        yield opened


def served(link):
    with urllib.request.urlopen(link.url, timeout=10.0) as answer:
        return answer.read() == b"page"


def test_a_port_in_use_is_left_alone_and_said():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port, said = taken.getsockname()[1], []
        with LiveLink("page", port=port, announce=said.append) as link:
            assert link.port != port
            assert said == [f"port {port} is in use; taking {link.port}"]
            assert served(link)
        assert not answers(link.port)


HANDSHAKE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)


def message(text):
    """Return a websocket message as a client sends it; its mask is nought."""
    data = text.encode()
    size = bytes([len(data)]) if len(data) < 126 else bytes([126]) + len(data).to_bytes(2, "big")
    return bytes([0x81, 0x80 | size[0]]) + size[1:] + bytes(4) + data


class Client:
    """A program that speaks to the server as it likes."""

    def __init__(self, link):
        self.port, self.token = link.port, link.url.split("/")[3]
        self.socket = socket.create_connection(("127.0.0.1", link.port), timeout=10.0)

    def __enter__(self):
        return self

    def __exit__(self, *rest):
        self.socket.close()

    def send(self, data):
        with suppress(OSError):
            self.socket.sendall(data)

    def ask(self, path, **headers):
        """Ask for a path; return the answer."""
        lines = {"Host": f"127.0.0.1:{self.port}"} | headers
        text = "".join(f"{k}: {v.format(port=self.port)}\r\n" for k, v in lines.items())
        upgrade = HANDSHAKE if path.endswith("/frames") else ""
        path = path.format(token=self.token)
        self.send(f"GET {path} HTTP/1.1\r\n{text}{upgrade}\r\n".encode())
        return self.socket.recv(65536)

    def watch(self):
        """Become a viewer, as the page does."""
        assert self.ask("/{token}/frames", Origin="http://127.0.0.1:{port}").split()[1] == b"101"
        return self


def heard(link, count):
    """Return the next keys that a link hears, so many at least."""
    keys = []

    def enough():
        link.send(0.0, FRAME)
        keys.append(link.keys())
        return len("".join(keys)) >= count

    assert wait_until(enough)
    return "".join(keys)


def answered(link):
    """Send one frame and return the keys of its own answer; `heard` may take two answers as one."""
    assert wait_until(link._hear)
    link.keys()
    link.send(0.0, FRAME)
    assert wait_until(link._hear)
    return link.keys()


OWN = {"Origin": "http://127.0.0.1:{port}"}
EVIL = {"Origin": "http://evil.example:{port}"}
#: Path, headers beside the usual ones, status.
REQUESTS = [
    ("/{token}/", {}, 200),
    ("/{token}/", {"Host": "evil.example:{port}"}, 404),
    ("/{token}/frames", OWN, 101),
    ("/{token}/frames", EVIL, 403),
    ("/{token}/frames", EVIL | {"Host": "evil.example:{port}"}, 404),
    # Without the token nothing is served or heard, whatever else is right.
    ("/", {}, 404),
    ("//", {}, 403),
    ("//frames", OWN, 403),
    ("/frames", OWN, 404),
    ("/{token}x/", {}, 403),
    ("/{token}x/frames", OWN, 403),
    ("/\u00ff\u00fe/frames", OWN, 403),
]


def test_without_the_token_or_from_another_site_nothing_is_served_and_no_key_heard(link):
    for path, headers, status in REQUESTS:
        with Client(link) as client:
            answer = client.ask(path, **headers)
            assert int(answer.split()[1]) == status, (path, headers)
            assert (b"page" in answer) == (status == 200)
            if status in (101, 200, 403):
                for words in (b"frame-ancestors 'none'", b"no-referrer"):
                    assert words in answer.lower()
            if status != 101:
                client.send(message("q"))
    with Client(link).watch() as viewer:
        viewer.send(message("+"))
        assert heard(link, 1) == "+"


def test_a_browser_is_started_with_an_address_that_is_good_for_once(monkeypatch):
    """Its arguments are in the list of processes; the token was there while the browser ran."""
    opened, said = [], []
    monkeypatch.setenv("BROWSER", "one")
    monkeypatch.setattr("webbrowser.open", lambda url, new: opened.append(url) or True)
    with LiveLink("page", announce=said.append) as link:
        link.show(open_browser=True)
        (address,) = opened
        assert link.url.split("/")[3] not in address
        assert said == [f"live view on {link.url}"]
        with urllib.request.urlopen(address, timeout=10.0) as answer:
            assert (answer.url, answer.read()) == (link.url, b"page")
        for late in (address, f"{address}frames"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(late, timeout=10.0)
        assert served(link)


def test_no_display_is_said_and_the_address_given(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert not can_open_browser()
    said = []
    with LiveLink("page", announce=said.append) as link:
        link.show(open_browser=True)
        assert (
            said[-1] == f"no display or browser here; open {link.url} in a browser on this machine"
        )


@pytest.mark.torture
def test_a_flood_of_keys_is_cut_to_a_few_between_frames_and_the_end_comes_through(link):
    stop = threading.Event()

    def flood(client):
        with suppress(OSError):
            while not stop.is_set():
                client.socket.send(message("+") * 4096)

    with Client(link).watch() as noisy, Client(link).watch() as user:
        thread = threading.Thread(target=flood, args=(noisy,), daemon=True)
        thread.start()
        counts = [answered(link).count("+") for _ in range(20)]
        user.send(message("q"))
        assert wait_until(lambda: "q" in answered(link))
        stop.set()
        noisy.socket.shutdown(socket.SHUT_RDWR)
        assert ended(thread)
    assert 1 < max(counts) <= 16  # `server.KEYS`


LARGE = [
    "GET /{token}/ HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
    "POST /{token}/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 150000000\r\n\r\n",
    "POST /x HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n7fffffff\r\n",
]


@pytest.mark.torture
def test_what_is_too_large_takes_no_memory_and_nonsense_is_survived(link):
    def resident():
        return psutil.Process(link.pid).memory_info().rss / 1e6

    assert served(link)
    before, rng = resident(), random.Random(5)
    for head in LARGE:
        with Client(link) as client:
            client.send(head.format(token=client.token).encode())
            client.send(bytes(30_000_000))
    with Client(link).watch() as client:
        client.send(message("x" * 17))
        with suppress(ConnectionError):
            while client.socket.recv(65536):
                pass
    for _ in range(100):
        with Client(link) as client:
            client.send(rng.choice(LARGE).format(token=client.token).encode() + rng.randbytes(99))
            client.socket.shutdown(socket.SHUT_WR)
    assert resident() - before < 20.0
    link.send(0.0, FRAME)
    assert link.keys() == ""
    assert served(link)


def test_sending_never_waits_for_a_server_that_is_stopped(link):
    os.kill(link.pid, signal.SIGSTOP)
    sending = threading.Thread(
        target=lambda: [link.send(0.01 * k, FRAME) for k in range(2000)], daemon=True
    )
    sending.start()
    sent = ended(sending)
    os.kill(link.pid, signal.SIGCONT)
    assert sent
    assert link.dropped == 1999
    with Client(link).watch() as viewer:
        viewer.send(message("+"))
        assert heard(link, 1) == "+"
        # Two bytes of head, then the numbers.
        frame = np.frombuffer(viewer.socket.recv(30, socket.MSG_WAITALL)[2:], "<f4")
        assert frame.tolist() == [0, 0, 0, 1, 1, 1, 1]


def test_a_dead_server_ends_play_with_a_line_and_the_link_without_one(wave):
    def kill(text):
        if "open " in text:
            for child in psutil.Process().children():
                if "server.py" in " ".join(child.cmdline()):
                    child.kill()

    with pytest.raises(FpidError, match="its server was ended from outside"):
        play(wave, open_browser=False, announce=kill)


def test_keys_choose_joints_push_them_and_end_it():
    said, robot = [], Simulation(paper_experiment(), paper_controller())
    hands = KeyInput(robot, 0, np.array((3.0, 1.0)), said.append)
    assert hands.take("+2-x9")
    assert hands.pushes == [(0.0, "joint1", 3.0), (0.0, "joint2", -1.0)]
    assert said[1:] == ["joint joint2", "t = 0.00 s: -1.0 N m on joint2"]
    assert not hands.take("+++q")


def test_a_robot_that_runs_away_ends_the_session_and_is_told_of():
    wild = Plant(disturbance=Pulse(torque=(0.0, 500.0), start=0.0, end=1.0))
    job = Experiment(Arm.two_link(), Hold(0.0), runaway_speed=1.0, plant=wild)
    report = live(job, paper_controller(), duration=60.0, view=False)
    assert report.timing.ticks < 1000
    assert report.fault.startswith("diverged at 0.0")
    assert report.fault.endswith("beyond 1 rad/s")


def test_live_runs_for_its_duration_and_reports():
    report = live(paper_experiment(), paper_controller(), duration=0.5, view=False)
    assert report.timing.ticks == 500
    assert report.timing.lateness(50.0) <= report.timing.lateness(99.9) <= report.timing.worst
    assert report.send_times.size == 0
    run = simulate(paper_experiment(duration=0.5), paper_controller())
    assert np.abs(report.q - run.q[500]).max() < 1e-9


def test_bad_input_to_the_live_view_is_named(wave):
    job, law = paper_experiment(), paper_controller()
    with pytest.raises(ArgumentError, match="port: expected a whole number"):
        play(wave, port=70_000, open_browser=False)
    with pytest.raises(ArgumentError, match="joint: expected one of joint1, joint2"):
        live(job, law, push_joint="joint9", view=False)
    with pytest.raises(ArgumentError, match="controller: expected a Controller"):
        live(job, None)
    assert not [c for c in psutil.Process().children() if "server.py" in " ".join(c.cmdline())]


class Clock:
    """Stands for `time`: it moves when read (5 us), slept on or worked on, else not.

    A sleep ends 0.6 ms later than asked for, which is more than the loop's spinning hides.
    """

    READ, LATE = 5e-6, 6e-4

    def __init__(self):
        self.now = 0.0

    def perf_counter(self):
        self.now += self.READ
        return self.now

    def sleep(self, seconds):
        assert seconds > 0.0
        self.now += seconds + self.LATE


PERIOD, TICKS = 2e-3, 200


def kept(monkeypatch, work):
    """Keep a period of 2 ms over ticks that work ``work(k)`` s, by the clock above.

    Returns how late each began and ended, against a schedule counted from the start, s.
    """
    clock, begins, ends = Clock(), [], []

    def tick():
        begins.append(clock.now)
        clock.now += work(len(ends))
        ends.append(clock.now)
        return len(ends) < TICKS

    monkeypatch.setattr(live_session, "time", clock)
    timing = keep_time(tick, PERIOD, idle=lambda: True, every=1.0)
    due = PERIOD * np.arange(1, TICKS + 1)
    return timing, np.array(begins) - due, np.array(ends) - due


def test_lateness_does_not_add_up_an_overrun_is_made_up_for_and_late_ends_are_counted(monkeypatch):
    """Each tick is as late as its own sleep, no more.

    Were the next counted from when a tick began, the last would be late by 199 times 0.35 ms =
    70 ms (what spinning leaves of 0.6), from when it ended, by 270 ms.
    """
    timing, late, ended = kept(monkeypatch, lambda k: 2e-2 if k == 50 else 1e-3)
    assert late.min() > 0.0
    assert late[:51].max() < Clock.LATE
    # Ticks follow each other at once, 1 ms of work each, until all 18 ms are caught up with.
    assert late[51] == pytest.approx(18e-3, abs=1e-3)
    assert np.diff(late[51:66]) == pytest.approx([-1e-3] * 14, abs=10 * Clock.READ)
    assert late[75:].max() < Clock.LATE
    missed = int((ended > PERIOD).sum())
    assert missed > 10
    assert (timing.ticks, timing.missed, timing.restarts) == (TICKS, missed, 0)
    assert timing.worst == pytest.approx(late.max(), abs=5 * Clock.READ)


def test_after_a_long_stop_the_schedule_starts_anew(monkeypatch):
    """As after a suspended laptop: half a second is not made up for by 250 ticks at once."""
    timing, late, _ = kept(monkeypatch, lambda k: 0.5 if k == 50 else 1e-3)
    assert timing.restarts == 1
    assert timing.missed == 1
    assert np.ptp(late[51:]) < Clock.LATE
    assert late[51:] == pytest.approx([0.5] * (TICKS - 51), abs=PERIOD)


def test_keys_are_read_from_a_terminal_which_is_restored(monkeypatch):
    leader, follower = pty.openpty()
    before = termios.tcgetattr(follower)
    with open(follower, "rb", buffering=0) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
        with keyboard() as keys:
            assert keys() == ""
            os.write(leader, b"2+")
            assert wait_until(lambda: keys() == "2+")
            assert not termios.tcgetattr(follower)[3] & termios.ICANON
        assert termios.tcgetattr(follower) == before
    os.close(leader)


def test_without_a_terminal_there_are_no_keys(monkeypatch, tmp_path):
    with (tmp_path / "empty").open("w+") as file:
        monkeypatch.setattr(sys, "stdin", file)
        with keyboard() as keys:
            assert keys() == ""


def test_ctrl_c_before_the_first_tick_is_a_clean_end(monkeypatch):
    """It once fell between opening the view and the first period, and was a traceback."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(gc, "collect", interrupted)
    assert keep_time(lambda: True, 1e-3, idle=lambda: True, every=0.1).ticks == 0
    assert gc.isenabled()
    monkeypatch.undo()
    monkeypatch.setattr(LiveLink, "show", interrupted)
    report = live(paper_experiment(), paper_controller(), open_browser=False)
    assert report.timing.ticks == 0


def test_live_prints_lateness_with_and_without_the_view(tmp_path, capsys):
    config = tmp_path / "job.toml"
    config.write_text(demo_config().text)
    commands.live(config, duration=0.5, baseline=0.3, browser=False)
    text = capsys.readouterr().out
    for words in ("without the view: 300 ticks", "with the view:    500 ticks", "frames sent"):
        assert words in text
    assert text.count("99.9th percentile") == 2
    assert text.count("deadlines missed") == 2
