"""The control loop in real time, and a look at it: its period, its keys, its page."""

import contextlib
import gc
import math
import os
import select
import sys
import time
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation.engine import Simulation
from fpid_pin.simulation.entry import warm
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.view.link import LiveLink
from fpid_pin.view.replay import experiment_scene, render

HELP = "keys, here or in the page: 1-9 choose a joint, + and - push it, q ends"
_PUSH_TIME = 0.2
# The reference is looked at this far ahead to place the camera, s.
_PREVIEW = 20.0
# Sleep until this much before a tick, then spin: the scheduler wakes us some 0.1 ms late.
_SPIN = 2.5e-4
# Further behind than this (a suspended laptop) the schedule starts anew.
_GIVE_UP = 0.1


@dataclass(eq=False)
class Timing:
    """How a period was kept."""

    step: float  # the period [s]
    late: "array[float]" = field(default_factory=lambda: array("f"))  # each tick's beginning [s]
    missed: int = 0  # ticks whose work was done later than one step after they were due
    restarts: int = 0  # how often the schedule was given up and begun anew

    @property
    def ticks(self) -> int:
        """How many there were."""
        return len(self.late)

    @property
    def worst(self) -> float:
        """Largest lateness [s]."""
        return max(self.late, default=0.0)

    def lateness(self, percentile: float) -> float:
        """Return a percentile of how late ticks began [s]; NaN before any."""
        return float(np.percentile(self.late, percentile)) if self.late else math.nan

    def __str__(self) -> str:
        part = 100.0 * self.missed / self.ticks if self.ticks else 0.0
        late = ", ".join(
            f"{name} {1e6 * self.lateness(p):.0f} us"
            for name, p in (("median", 50.0), ("99th", 99.0), ("99.9th percentile", 99.9))
        )
        return (
            f"{self.ticks} ticks of {1e3 * self.step:g} ms, {self.missed} deadlines missed "
            f"({part:.3g} %); lateness: {late}, worst {1e6 * self.worst:.0f} us"
        )


def keep_time(
    tick: Callable[[], bool], step: float, *, idle: Callable[[], bool], every: float
) -> Timing:
    """Call `tick` every `step` [s] until it or `idle` returns False; Ctrl-C ends it too.

    `idle` is for what is not urgent: it is called right after a tick, `every` so many seconds.
    Sleeps, then spins for the last quarter of a millisecond. The garbage collector waits.
    """
    timing = Timing(step)
    collecting = gc.isenabled()
    try:
        gc.collect()
        gc.disable()
        due = time.perf_counter() + step
        idle_due = due
        while True:
            left = due - time.perf_counter() - _SPIN
            if left > 0.0:
                time.sleep(left)
            while (now := time.perf_counter()) < due:
                pass
            timing.late.append(now - due)
            going = tick()
            end = time.perf_counter()
            if end > due + step:
                timing.missed += 1
            if not going:
                break
            if end >= idle_due:
                if not idle():
                    break
                idle_due = max(idle_due + every, end)
            due += step
            if time.perf_counter() - due > _GIVE_UP:
                timing.restarts += 1
                due = time.perf_counter() + step
    except KeyboardInterrupt:
        pass
    finally:
        if collecting:
            gc.enable()
    return timing


@contextlib.contextmanager
def urgent() -> Iterator[bool]:
    """Ask the system to run this process before others while the block lasts.

    Yields whether it does: that takes a system with real-time scheduling, and its permission.
    """
    try:
        # Processes that we start meanwhile stay ordinary.
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(10))
    except (OSError, AttributeError):
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextlib.contextmanager
def keyboard() -> Iterator[Callable[[], str]]:
    """Yield what returns the keys pressed since last asked; it never waits.

    Without a terminal there are none. The terminal is as it was before when the block ends, and
    Ctrl-C still interrupts.
    """
    terminal = -1
    # No terminal, no standard input, or a system without either.
    with contextlib.suppress(ImportError, OSError, ValueError, AttributeError):
        import termios
        import tty

        descriptor = sys.stdin.fileno()
        # A background job would be stopped for touching the terminal.
        if os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp():
            before = termios.tcgetattr(descriptor)
            tty.setcbreak(descriptor)
            terminal = descriptor

    def keys() -> str:
        if terminal < 0 or not select.select([terminal], [], [], 0.0)[0]:
            return ""
        return os.read(terminal, 64).decode("utf-8", errors="ignore")

    try:
        yield keys
    finally:
        if terminal >= 0:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(terminal, termios.TCSADRAIN, before)


@dataclass(frozen=True, eq=False)
class LiveReport:
    """What came of a live session.

    Attributes
    ----------
    timing
        How the control loop kept its period.
    send_times
        How long each frame took to send [s]; empty without a view.
    dropped
        Frames left out because the server was busy.
    pushes
        Disturbances given: (time [s], joint, torque [N m]).
    q, q_ref
        Where the arm was at the end, and where it should have been [rad], (n,).
    fault
        Why the robot ended it; empty where it did not.
    """

    timing: Timing
    send_times: FloatArray
    dropped: int
    pushes: tuple[tuple[float, str, float], ...]
    q: FloatArray
    q_ref: FloatArray
    fault: str

    def __str__(self) -> str:
        lines = [str(self.timing)]
        if frames := self.send_times.size:
            median = 1e3 * float(np.median(self.send_times))
            sent = f"{frames} frames sent, median {median:.3f} ms each"
            lines.append(f"{sent}, {self.dropped} dropped")
        return "\n".join([*lines, *([self.fault] if self.fault else [])])


@dataclass(eq=False)
class KeyInput:
    """Turns keys into pushes."""

    simulation: Simulation
    joint: int
    torque: FloatArray  # of a push, (n,) [N m]
    say: Callable[[str], None]
    pushes: list[tuple[float, str, float]] = field(default_factory=list)

    def take(self, keys: str) -> bool:
        """Obey keys; False for the one that ends the session, wherever it is."""
        arm = self.simulation.robot.experiment.arm
        for key in keys:
            if key.isdecimal() and 1 <= int(key) <= arm.n:
                self.joint = int(key) - 1
                self.say(f"joint {arm.joint_names[self.joint]}")
            elif key in "+=-_":
                torque = float(self.torque[self.joint]) * (1.0 if key in "+=" else -1.0)
                t, name = self.simulation.t, arm.joint_names[self.joint]
                self.simulation.push(self.joint, torque, _PUSH_TIME)
                self.pushes.append((t, name, torque))
                self.say(f"t = {t:.2f} s: {torque:+.1f} {arm.effort_units[self.joint]} on {name}")
        return "q" not in keys


@checked
def live(
    experiment: Experiment,
    controller: Controller,
    *,
    duration: float | None = None,
    fps: float = 40.0,
    view: bool = True,
    open_browser: bool = True,
    port: int | None = None,
    push_joint: str | int = 0,
    push_torque: float | None = None,
    priority: bool = True,
    announce: Callable[[str], None] | None = None,
) -> LiveReport:
    """Run a controller in real time at its step, and show it; Ctrl-C or ``q`` ends it.

    The loop computes and sends in this process; the page is served by another and drawn by the
    browser, so drawing does not disturb the period. Keys, in the terminal or in the page, choose
    a joint and push it.

    Parameters
    ----------
    experiment
        Arm, plant, reference, step; its own duration does not count.
    controller
        The law.
    duration
        How long [s]; None: until told to end.
    fps
        Frames a second, 1 to 240.
    view
        False: only the loop.
    open_browser, port
        As for `play`.
    push_joint
        The joint that + and - push at first.
    push_torque
        [N m]; None: a fifth of the joint's limit, or what gravity asks of it where it has none.
    priority
        Ask the system to run the loop before other programs; without its permission (Linux grants
        it to root and to those allowed ``rtprio``) they may delay it.
    announce
        Told what happens; None: what needs the user goes to the package's logger.

    Returns
    -------
    LiveReport

    Raises
    ------
    ArgumentError
        An argument out of range, an unknown joint.
    FpidError
        The server did not start.
    """
    fps = checks.number("fps", fps, low=1.0, high=240.0)
    if duration is not None:
        duration = checks.number("duration", duration, above=0.0)
    arm, step = experiment.arm, experiment.step
    if push_torque is None:
        free = np.maximum(2.0 * np.abs(arm.gravity_vector(np.zeros(arm.n))), 1.0)
        torque = np.where(np.isfinite(arm.effort_limit), 0.2 * arm.effort_limit, free)
    else:
        torque = np.full(arm.n, checks.number("push_torque", push_torque))
    # Whatever is yet to be compiled must not be in the first period.
    warm([experiment], [controller])
    simulation = Simulation(experiment, controller, horizon=duration or 3600.0)
    robot, say = simulation.robot, announce or (lambda text: None)
    hands = KeyInput(simulation, arm.joint_index(push_joint), torque, say)
    last = math.inf if duration is None else round(duration / step)
    sent: list[float] = []

    def tick() -> bool:
        try:
            simulation.tick()
        except SimulationError:
            return False  # Of a law of the user's own: the report has it.
        return robot.outcome is None and robot.row < last

    with contextlib.ExitStack() as stack:
        link: LiveLink | None = None
        if view:
            title = controller.name or "live"
            scene = experiment_scene(experiment, title, _PREVIEW) | {"live": True}
            page = render(scene, title)
            link = stack.enter_context(LiveLink(page, port=port, announce=announce))
        pressed = stack.enter_context(keyboard())

        def idle() -> bool:
            keys = pressed()
            if link is not None:
                start = time.perf_counter()
                link.send(simulation.t, [(robot.q, simulation.q_ref, robot.torque)])
                sent.append(time.perf_counter() - start)
                keys += link.keys()
            return hands.take(keys)

        try:
            if link is not None:
                link.show(open_browser)
            if priority and not stack.enter_context(urgent()):
                say("no permission for real-time priority: other programs may delay the loop")
            timing = keep_time(tick, step, idle=idle, every=1.0 / fps)
        except KeyboardInterrupt:
            # Before the first tick; later ones end `keep_time` itself.
            timing = Timing(step)
    return LiveReport(
        timing=timing, send_times=np.array(sent), dropped=0 if link is None else link.dropped,
        pushes=tuple(hands.pushes), q=robot.q.copy(), q_ref=simulation.q_ref.copy(),
        fault=str(robot.outcome or ""),
    )  # fmt: skip
