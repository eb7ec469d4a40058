"""The live view: who listens, for how long, what becomes of a frame, what a key does."""

import gc
import os
import pty
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
import urllib.error
import urllib.request
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np
import psutil
import pytest
from bounded import PATIENCE, ended, started, wait_until

from fpid_pin import Arm, Experiment, FpidError, Plant, paper_controller, paper_experiment, simulate
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold
from fpid_pin.simulation.engine import Simulation
from fpid_pin.view import live, play, realtime
from fpid_pin.view.keyboard import Keyboard
from fpid_pin.view.link import LiveLink, can_open_browser
from fpid_pin.view.live_session import _Hands
from fpid_pin.view.realtime import Timing, keep_time

LIVE = """
import fpid_pin as fp, sys
from fpid_pin.view import live
report = live(fp.paper_experiment(), fp.paper_controller(), open_browser=False,
              announce=lambda text: print(text, flush=True))
print("ended with a report of", type(report.timing).__name__, flush=True)
"""


def listeners(pid):
    """Every address that a process and its children listen on."""
    family = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    found = []
    for process in family:
        for c in process.net_connections("all"):
            if c.status == psutil.CONN_LISTEN or c.type == socket.SOCK_DGRAM:
                found.append(c.laddr if isinstance(c.laddr, str) else c.laddr.ip)
    return found


def answers(port):
    with socket.socket() as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def live_process():
    pipes = {"stdout": subprocess.PIPE, "stdin": subprocess.DEVNULL, "text": True}
    with started([sys.executable, "-c", LIVE], **pipes) as process:
        lines = iter(process.stdout.readline, "")
        line = next(line for line in lines if "http://" in line)
        port = int(line.partition("127.0.0.1:")[2].partition("/")[0])
        yield process, port


def test_only_loopback_is_listened_on_and_ctrl_c_leaves_nothing():
    with live_process() as (process, port):
        assert set(listeners(process.pid)) == {"127.0.0.1"}
        children = psutil.Process(process.pid).children(recursive=True)
        assert len(children) == 1
        process.send_signal(signal.SIGINT)
        assert "ended with a report of Timing" in process.stdout.read()
        assert process.wait(PATIENCE) == 0
        assert wait_until(lambda: not any(c.is_running() for c in children))
        assert not answers(port)


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


def test_no_listener_outlives_a_killed_parent():
    with live_process() as (process, port):
        assert answers(port)
        process.kill()
        assert wait_until(lambda: not answers(port))


def test_a_port_in_use_is_left_alone_and_said():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port, said = taken.getsockname()[1], []
        with LiveLink("page", port=port, announce=said.append) as link:
            assert link.port != port
            assert said == [f"port {port} is in use; taking {link.port}"]
            assert urllib.request.urlopen(link.url, timeout=10).read() == b"page"
        assert not answers(link.port)


HANDSHAKE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
}


OWN = {"Origin": "http://127.0.0.1:{port}"}
EVIL = {"Origin": "http://evil.example:{port}"}
#: Path, headers beside the usual ones, status.
REQUESTS = [
    ("/{token}/", {}, 200),
    ("/{token}/", {"Host": "evil.example:{port}"}, 403),
    ("/{token}/frames", OWN, 101),
    ("/{token}/frames", {"Origin": "http://evil.example"}, 403),
    ("/{token}/frames", EVIL | {"Host": "evil.example:{port}"}, 403),
    # Programs give no origin: one could end the session.
    ("/{token}/frames", {}, 403),
    ("/{token}/other", {}, 404),
    # Without the token nothing is served or heard, whatever else is right.
    ("/", {}, 403),
    ("/frames", OWN, 403),
    ("/?{token}", {}, 403),
    ("/{token}x/", {}, 403),
    ("/{token}x/frames", OWN, 403),
    ("/\u00ff\u00fe/frames", OWN, 403),
    ("*", {}, 403),
]


def test_pages_of_other_sites_are_refused():
    """A name that resolves to this machine, or a page open in the same browser, gets nothing."""
    with LiveLink("page", announce=lambda text: None) as link:
        for template, headers, status in REQUESTS:
            path = template.format(token=link.url.split("/")[3])
            own = {key: value.format(port=link.port) for key, value in headers.items()}
            upgrade = HANDSHAKE if path.endswith("/frames") else {}
            lines = {"Host": f"127.0.0.1:{link.port}"} | upgrade | own
            text = "".join(f"{key}: {value}\r\n" for key, value in lines.items())
            with socket.create_connection(("127.0.0.1", link.port), timeout=10.0) as client:
                client.sendall(f"GET {path} HTTP/1.1\r\n{text}\r\n".encode())
                answer = client.recv(65536)
                while status == 200 and not answer.endswith(b"page"):
                    answer += client.recv(65536)
            assert int(answer.split()[1]) == status, (template, headers)
            head, _, body = answer.partition(b"\r\n\r\n")
            assert body == (b"page" if status == 200 else b"")
            for words in (b"x-frame-options: deny", b"frame-ancestors 'none'", b"no-referrer"):
                assert words in head.lower()


def test_a_server_gone_mad_does_not_keep_the_loop_from_its_work():
    """Keys come as fast as a pipe takes them; it once read until there were none."""
    readable, writable = os.pipe()
    os.set_blocking(readable, False)
    stop = threading.Event()

    def flood():
        limit = time.monotonic() + PATIENCE
        while not stop.is_set() and time.monotonic() < limit:
            os.write(writable, b'{"key": "+"}\n' * 4096)

    with LiveLink("page", announce=lambda text: None) as link:
        own, link._in = link._in, readable
        thread = threading.Thread(target=flood, daemon=True)
        thread.start()
        full = wait_until(lambda: len(link.keys()) == 128)
        heard = [len(link.keys()) for _ in range(20)]
        link._in = own
        stop.set()
        while thread.is_alive():
            with suppress(BlockingIOError):
                os.read(readable, 2**20)
        os.close(readable)
        os.close(writable)
    assert full
    assert max(heard) <= 128


def test_of_many_keys_at_once_a_few_are_obeyed_and_the_end_always():
    said, robot = [], Simulation(paper_experiment(), paper_controller())
    hands = _Hands(robot, Arm.two_link(), 0, np.array((3.0, 1.0)), said.append)
    assert hands.take("2" + "+" * 1000)
    assert len(hands.pushes) == 15
    assert len(said) == 16
    assert not hands.take("+" * 1000 + "q")


def test_sending_never_waits_for_a_server_that_is_stopped():
    frame = [(np.zeros(300), np.zeros(300), np.zeros(300))]
    with LiveLink("page", announce=lambda text: None) as link:
        os.kill(link.pid, signal.SIGSTOP)
        # 7 MB, of which a pipe holds 64 kB: a send that waited would not come back.
        sending = threading.Thread(
            target=lambda: [link.send(0.01 * k, frame) for k in range(2000)], daemon=True
        )
        sending.start()
        sent = ended(sending)
        os.kill(link.pid, signal.SIGCONT)
        assert sent
        assert link.dropped > 0
        # The stream is still in step: what was cut short is completed before the next frame.
        for k in range(50):
            link.send(1.0 * k, frame)
        assert urllib.request.urlopen(link.url, timeout=10).read() == b"page"


def test_a_dead_server_ends_play_with_a_line_and_the_link_without_one(wave):
    def kill(text):
        if "open " in text:
            for child in psutil.Process().children():
                if "server.py" in " ".join(child.cmdline()):
                    child.kill()

    with pytest.raises(FpidError, match="its server was ended from outside"):
        play(wave, open_browser=False, announce=kill)


def test_a_browser_is_started_with_an_address_that_is_good_for_once(monkeypatch):
    """Its arguments are in the list of processes; the token was there while the browser ran."""
    started, said = [], []
    monkeypatch.setenv("BROWSER", "one")
    monkeypatch.setattr("webbrowser.open", lambda url, new: started.append(url) or True)
    with LiveLink("page", announce=said.append) as link:
        link.show(open_browser=True)
        (address,) = started
        assert link.url.split("/")[3] not in address
        assert said == [f"live view on {link.url}"]
        with urllib.request.urlopen(address, timeout=10.0) as answer:
            assert (answer.url, answer.read()) == (link.url, b"page")
        for late in (address, address.rstrip("/"), f"{address}frames"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(late, timeout=10.0)
        with urllib.request.urlopen(link.url, timeout=10.0) as answer:
            assert answer.read() == b"page"


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


def test_a_live_robot_takes_the_steps_of_a_simulation():
    job, law = paper_experiment(duration=0.5).with_dynamics("compiled"), paper_controller()
    run = simulate(job, law)
    simulation = Simulation(job, law)
    robot = simulation.robot
    for k in range(500):
        assert np.array_equal(robot.q, run.q[k])
        simulation.tick()
        assert np.array_equal(robot.torque, run.torque[k])
        assert np.array_equal(simulation.q_ref, run.q_ref[k])
    assert np.array_equal(robot.q, run.q[500])


def test_a_push_is_a_disturbance_pulse():
    arm, law = Arm.two_link(), paper_controller()
    pulse = Pulse(torque=(0.0, 3.0), start=0.1, end=0.3)
    free = Experiment(arm, Hold(0.0), duration=0.5, dynamics="compiled")
    run = simulate(replace(free, plant=Plant(disturbance=pulse)), law)
    simulation = Simulation(free, law)
    for k in range(500):
        if k == 100:
            simulation.push("joint2", 3.0, 0.2)
        assert np.array_equal(simulation.robot.q, run.q[k])
        simulation.tick()


def test_a_robot_that_runs_away_says_so():
    job = Experiment(Arm.two_link(), Hold(0.0), runaway_speed=1.0, duration=1.0)
    simulation = Simulation(job, paper_controller())
    simulation.push(1, 500.0, 1.0)
    while simulation.robot.outcome is None:
        assert simulation.t < 1.0
        simulation.tick()
    assert "joint" in str(simulation.robot.outcome)
    assert "beyond 1 rad/s" in str(simulation.robot.outcome)


def test_live_runs_for_its_duration_and_reports():
    report = live(paper_experiment(), paper_controller(), duration=0.5, view=False)
    assert report.timing.ticks == 500
    assert report.timing.lateness(50.0) <= report.timing.lateness(99.9) <= report.timing.worst
    assert report.send_times.size == 0
    run = simulate(paper_experiment(duration=0.5), paper_controller())
    assert np.abs(report.q - run.q[500]).max() < 1e-9


def test_lateness_is_counted_to_a_microsecond():
    timing = Timing(1e-3)
    rng = np.random.default_rng(1)
    late = rng.exponential(5e-5, 20_000)
    for value in late:
        timing.note(float(value))
    for percentile in (50.0, 99.0, 99.9):
        exact = np.percentile(late, percentile, method="inverted_cdf")
        assert timing.lateness(percentile) == pytest.approx(exact, abs=1.01e-6)
    assert timing.worst == late.max()
    assert "deadlines missed" in str(timing)


class Clock:
    """Stands for `time`: it moves when read (a microsecond), slept on or worked on, else not.

    A sleep ends 0.6 ms later than asked for, which is more than the loop's spinning hides.
    """

    READ, LATE = 1e-6, 6e-4

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

    monkeypatch.setattr(realtime, "time", clock)
    timing = keep_time(tick, PERIOD, idle=lambda: True, every=1.0)
    due = PERIOD * np.arange(1, TICKS + 1)
    return timing, np.array(begins) - due, np.array(ends) - due


def test_lateness_does_not_add_up(monkeypatch):
    """Each tick is as late as its own sleep, no more.

    Were the next counted from when a tick began, the last would be late by 199 times 0.35 ms =
    70 ms (what spinning leaves of 0.6), from when it ended, by 270 ms.
    """
    timing, late, _ = kept(monkeypatch, lambda k: 1e-3)
    assert late.min() > 0.0
    assert late.max() < Clock.LATE
    assert (timing.ticks, timing.missed, timing.restarts) == (TICKS, 0, 0)
    assert timing.worst == pytest.approx(late.max(), abs=5 * Clock.READ)


def test_an_overrun_is_made_up_for_and_every_late_end_is_counted(monkeypatch):
    timing, late, ended = kept(monkeypatch, lambda k: 2e-2 if k == 50 else 1e-3)
    # Ticks follow each other at once, 1 ms of work each, until all 18 ms are caught up with.
    assert late[51] == pytest.approx(18e-3, abs=1e-3)
    assert np.diff(late[51:66]) == pytest.approx([-1e-3] * 14, abs=10 * Clock.READ)
    assert late[75:].max() < Clock.LATE
    missed = int((ended > PERIOD).sum())
    assert missed > 10
    assert timing.missed == missed
    assert timing.worst == pytest.approx(late.max(), abs=5 * Clock.READ)
    assert timing.restarts == 0


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
        with Keyboard() as keyboard:
            assert keyboard.present
            assert keyboard.keys() == ""
            os.write(leader, b"2+")
            assert wait_until(lambda: keyboard.keys() == "2+")
            assert not termios.tcgetattr(follower)[3] & termios.ICANON
        assert termios.tcgetattr(follower) == before
    os.close(leader)


def test_without_a_terminal_there_are_no_keys(monkeypatch, tmp_path):
    with (tmp_path / "empty").open("w+") as file:
        monkeypatch.setattr(sys, "stdin", file)
        with Keyboard() as keyboard:
            assert not keyboard.present
            assert keyboard.keys() == ""


def test_bad_input_to_the_live_view_is_named(wave):
    job, law = paper_experiment(), paper_controller()
    with pytest.raises(ArgumentError, match="speed: expected a number > 0"):
        play(wave, speed=0.0)
    with pytest.raises(ArgumentError, match="port: expected a whole number"):
        play(wave, port=70_000, open_browser=False)
    with pytest.raises(ArgumentError, match="joint: expected one of joint1, joint2"):
        live(job, law, push_joint="joint9", view=False)
    with pytest.raises(ArgumentError, match="controller: expected a Controller"):
        live(job, None)
    assert not [c for c in psutil.Process().children() if "server.py" in " ".join(c.cmdline())]
