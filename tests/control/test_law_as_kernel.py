"""A law of one's own given as a kernel: the same law in NumPy to the last bit."""

import dataclasses
import os
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from bounded import finished
from fpid_pin.kernels.law import integral_step
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import winds_up

STEP = 1e-3
LIMIT = (28.0, 8.0)
NEVER = 10.0  # rad; the reference is sin t
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [None, LIMIT], ids=["unlimited", "saturated"])


@dataclass(frozen=True, eq=False)
class NumpyPd(fp.Controller):
    kp: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"

    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        return self.scale * (self.kp * (q_ref - q) + self.kd * (v_ref - v))


@kernel
def pd(joints, h, q, v, q_ref, v_ref, a_ref, torque):
    for j in range(joints.size):
        c = joints[j]
        torque[j] = c.scale * (c.kp * (q_ref[j] - q[j]) + c.kd * (v_ref[j] - v[j]))


@dataclass(frozen=True, eq=False)
class KernelPd(fp.Controller):
    kp: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "PD as a kernel"

    kernel = pd


@kernel
def pid(joints, h, q, v, q_ref, v_ref, a_ref, torque):
    for j in range(joints.size):
        c = joints[j]
        e = q_ref[j] - q[j]
        e_dot = v_ref[j] - v[j]
        if c.ticks > 0.0 and not winds_up(c.cut, e):
            c.int_e += integral_step(e, c.e, e_dot, c.e_dot, h)
        c.e = e
        c.e_dot = e_dot
        torque[j] = c.scale * (c.kp * e + c.ki * c.int_e + c.kd * e_dot)


@dataclass(frozen=True, eq=False)
class KernelPid(fp.Controller):
    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "PID as a kernel"

    kernel = pid
    memory = ("e", "e_dot", "int_e")


@kernel
def faulty(joints, h, q, v, q_ref, v_ref, a_ref, torque):
    pid(joints, h, q, v, q_ref, v_ref, a_ref, torque)
    for j in range(joints.size):
        if q_ref[j] > joints[j].breaks_at:
            torque[j] = np.nan


@dataclass(frozen=True, eq=False)
class Faulty(KernelPid):
    breaks_at: ArrayLike = NEVER

    kernel = faulty


@kernel
def watchful(joints, h, q, v, q_ref, v_ref, a_ref, torque):
    for j in range(joints.size):
        c = joints[j]
        c.was_cut = c.cut
        c.count = c.ticks
        c.allowed = c.limit
        torque[j] = c.kp * q_ref[j]


@dataclass(frozen=True, eq=False)
class Watchful(fp.Controller):
    """Notes what it was told, and pushes where the reference says."""

    kp: ArrayLike = 1.0

    kernel = watchful
    memory = ("was_cut", "count", "allowed")


def two_link(limit=None):
    arm = fp.Arm.two_link()
    return arm if limit is None else arm.with_limits(effort=limit)


def paper(duration=1.0, limit=None):
    return dataclasses.replace(fp.paper_experiment(duration=duration), arm=two_link(limit))


def signals(count=500, seed=0):
    """Return q, v, q_ref, v_ref, a_ref, (count, 5, 2)."""
    return np.random.default_rng(seed).normal(0.0, 1.0, (count, 5, 2))


def same_run(one, other):
    assert one.outcome == other.outcome
    for name in ("t", "q", "v", "torque"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def gains(scale="none"):
    return {"kp": (40.0, 30.0), "ki": (25.0, 20.0), "kd": (20.0, 5.0), "scale": scale}


def population(law=KernelPid, **fields):
    scales = ["none", "inertia", (0.7, 1.9), 2.0, "none"]
    return [
        law(20.0 + 5.0 * k, (10.0, 3.0 * k), 4.0 + k, scale, **fields)
        for k, scale in enumerate(scales)
    ]


# ---------------------------------------------------------------------- the law itself


@LIMITS
@SCALES
def test_a_pd_has_the_bits_of_its_twin_in_numpy(scale, limit):
    arm = two_link(limit)
    loops = [law((30.0, 20.0), 7.0, scale).start(arm, step=STEP) for law in (KernelPd, NumpyPd)]
    for row in signals():
        one, other = (loop.torque(*row) for loop in loops)
        assert np.array_equal(one, other)


@LIMITS
@SCALES
def test_a_pid_with_anti_windup_has_the_bits_of_the_package_s(scale, limit):
    """int e is kept in memory, held by `cut`, and begins with the second tick."""
    loops = [law(**gains(scale)).start(two_link(limit), step=STEP) for law in (KernelPid, fp.Pid)]
    for row in signals(1000, seed=1):
        one, other = (loop.torque(*row) for loop in loops)
        assert np.array_equal(one, other)
    one, other = (
        fp.simulate(paper(2.0, limit), law(**gains(scale))) for law in (KernelPid, fp.Pid)
    )
    assert limit is None or (np.abs(one.torque) == limit).any()
    same_run(one, other)


# ---------------------------------------------------------------------- what it is told


def test_it_is_told_ticks_limit_and_what_was_cut():
    loop = Watchful(kp=(100.0, 1.0)).start(two_link(LIMIT), step=STEP)
    asked = np.zeros(2)
    for tick, row in enumerate(signals(20, seed=2)):
        torque = loop.torque(*row)
        seen = loop.signals()
        assert (seen["count"] == tick).all()
        assert np.array_equal(seen["allowed"], LIMIT)
        assert np.array_equal(
            seen["was_cut"], asked - np.clip(asked, *np.outer([-1.0, 1.0], LIMIT))
        )
        asked = np.array([100.0, 1.0]) * row[2]
        assert np.array_equal(torque, np.clip(asked, *np.outer([-1.0, 1.0], LIMIT)))
    assert np.abs(asked[0]) > LIMIT[0]


def test_an_arm_without_limits_cuts_nothing():
    loop = Watchful(kp=1e9).start(two_link(), step=STEP)
    for row in signals(5):
        assert np.array_equal(loop.torque(*row), 1e9 * row[2])
    assert (loop.signals()["was_cut"] == 0.0).all()
    assert (loop.signals()["allowed"] == np.inf).all()


def test_each_loop_has_a_memory_of_its_own():
    law = KernelPid(**gains())
    first, second = (law.start(two_link(), step=STEP) for _ in range(2))
    rows = signals(50, seed=3)
    alone = [first.torque(*row) for row in rows]
    assert np.array_equal([second.torque(*row) for row in rows], alone)


# ---------------------------------------------------------------------- what it leaves behind


def test_a_run_records_the_memory_of_the_tick_that_made_each_torque():
    run = fp.simulate(paper(), KernelPid(**gains()))
    assert set(run.signals) == {"e", "e_dot", "int_e"}
    assert np.array_equal(run.e, run.error)
    assert np.array_equal(run.e_dot, run.v_ref - run.v)
    assert (run.int_e[0] == 0.0).all()
    kp, ki, kd = (np.array(gains()[name]) for name in ("kp", "ki", "kd"))
    assert np.array_equal(run.torque, kp * run.e + ki * run.int_e + kd * run.e_dot)
    e, e_dot = run.e, run.e_dot
    growth = 0.5 * STEP * (e[1:] + e[:-1]) + STEP * STEP / 12.0 * (e_dot[:-1] - e_dot[1:])
    assert np.array_equal(run.int_e[1:], np.cumsum(growth, axis=0))


def test_a_law_without_memory_records_none():
    assert dict(fp.simulate(paper(0.01), KernelPd(30.0, 7.0)).signals) == {}


# ---------------------------------------------------------------------- populations


@LIMITS
def test_a_population_has_the_bits_of_its_members_alone(limit):
    experiment, laws = paper(1.0, limit), population()
    for run, law in zip(fp.simulate(experiment, laws), laws, strict=True):
        alone = fp.simulate(experiment, law)
        same_run(run, alone)
        assert np.array_equal(run.int_e, alone.int_e)
    alone = [fp.evaluate(experiment, law)[0] for law in laws]
    assert np.isfinite(alone).all()
    assert np.array_equal(fp.evaluate(experiment, laws), alone)


def test_kernels_numpy_and_the_package_s_laws_run_side_by_side():
    experiment = paper(0.3)
    laws = [KernelPd(30.0, 7.0), NumpyPd(30.0, 7.0), fp.paper_controller(), KernelPid(**gains())]
    runs = fp.simulate(experiment, laws)
    for run, law in zip(runs, laws, strict=True):
        same_run(run, fp.simulate(experiment, law))
    same_run(runs[0], runs[1])


# ---------------------------------------------------------------------- faults


def first_tick_beyond(angle):
    return int(np.flatnonzero(np.sin(STEP * np.arange(1001)) > angle)[0])


@LIMITS
def test_a_torque_that_is_no_number_ends_its_run_and_no_other(limit):
    experiment, thresholds = paper(1.0, limit), [NEVER, 0.1, NEVER, 0.3, NEVER]
    laws = [
        dataclasses.replace(law, breaks_at=angle)
        for law, angle in zip(population(Faulty), thresholds, strict=True)
    ]
    sound = [fp.simulate(experiment, law) for law in population()]
    runs = fp.simulate(experiment, laws)
    for run, whole, angle in zip(runs, sound, thresholds, strict=True):
        if angle == NEVER:
            same_run(run, whole)
            continue
        tick = first_tick_beyond(angle)
        assert not run.outcome.completed
        assert run.outcome.time == pytest.approx(tick * STEP, abs=1e-12)
        assert run.outcome.cause == "torque is not finite"
        # What came before is on record, as it would have been without the fault to come.
        assert np.array_equal(run.q, whole.q[:tick])
        assert np.array_equal(run.torque, whole.torque[:tick])
    costs = fp.evaluate(experiment, laws)
    assert np.array_equal(np.isinf(costs), np.array(thresholds) != NEVER)
    assert costs[2] == fp.evaluate(experiment, population()[2])[0]


def test_a_law_with_neither_torque_nor_kernel_says_so():
    @dataclass(frozen=True, eq=False)
    class Idle(fp.Controller):
        pass

    run = fp.simulate(paper(0.01), Idle())
    assert "Idle has neither torque nor kernel" in run.outcome.cause


# ---------------------------------------------------------------------- without compilation


def test_it_is_the_same_law_line_by_line():
    """Most tests above, interpreted: what a debugger steps through is what runs."""
    done = finished(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__,
         "-k", "not line_by_line and not population and not side_by_side"],
        timeout=250, env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " passed" in done.stdout
