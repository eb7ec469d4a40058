"""The control loop's period, an account of it, and keys from the terminal."""

import gc
import os
import pty
import sys
import termios

import numpy as np
import pytest
from bounded import wait_until

from fpid_pin import paper_controller, paper_experiment
from fpid_pin.view import live, live_session
from fpid_pin.view.link import LiveLink
from fpid_pin.view.live_session import keep_time, keyboard


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
