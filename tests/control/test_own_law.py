"""A law of one's own in its three forms; what the engine does for it; that its faults are its own.

tests/own_laws.py has the laws. That they are the loops that are written out is in
test_laws.py, that a law runs as it stands in its file in test_law_files.py.
"""

import dataclasses
import math
import re
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike
from own_laws import (
    PDS,
    JointGravity,
    JointPd,
    JointPid,
    PythonFractional,
    PythonPid,
    RobotComputedTorque,
    own,
)

import fpid_pin as fp
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation.engine import Simulation

STEP = 1e-3
ARM = fp.Arm.two_link()
LIMIT = (28.0, 8.0)
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [None, LIMIT], ids=["unlimited", "saturated"])


def two_link(limit=None):
    return ARM if limit is None else ARM.with_limits(effort=limit)


def paper(duration=1.0, limit=None, **changes):
    experiment = fp.paper_experiment(duration=duration)
    return dataclasses.replace(experiment, arm=two_link(limit), dynamics="compiled", **changes)


def signals(count=500, seed=0):
    """Return q, v, q_ref, v_ref, a_ref, (count, 5, 2)."""
    return np.random.default_rng(seed).normal(0.0, 1.0, (count, 5, 2))


def same_run(one, other):
    assert one.outcome == other.outcome
    for name in ("t", "q", "v", "torque"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


# ---------------------------------------------------------------------- the forms


@LIMITS
@SCALES
@pytest.mark.parametrize("form", PDS)
def test_a_pd_is_its_own_line_scaled_and_clipped_in_every_form(form, scale, limit):
    """The same operations in the same order: no tolerance."""
    arm, kp, kd = two_link(limit), np.array([30.0, 20.0]), np.array([7.0, 3.0])
    s = {"none": np.ones(2), "inertia": np.diag(arm.mass_matrix(arm.home))}.get(scale, scale)
    loop, cut = form(kp, kd, scale=scale).start(arm, step=STEP), 0
    for q, v, q_ref, v_ref, a_ref in signals():
        u = s * (kp * (q_ref - q) + kd * (v_ref - v))
        cut += int((np.abs(u) > arm.effort_limit).any())
        torque = loop.torque(q, v, q_ref, v_ref, a_ref)
        assert np.array_equal(torque, np.clip(u, -arm.effort_limit, arm.effort_limit))
    assert (cut > 50) == (limit is not None)


@pytest.mark.parametrize("dynamics", ["compiled", "pinocchio"])
def test_a_pd_moves_alike_in_every_form_with_all_that_the_engine_does_for_it(dynamics):
    """Over more than a block of rows."""
    experiment = dataclasses.replace(
        paper(4.2), dynamics=dynamics, plant=fp.Plant(effort_limit=(30.0, 8.0), dry_friction=0.3),
        sensors=fp.Sensors(1e-4, 1e-4, velocity="differentiated", delay=2),
    )  # fmt: skip
    options = {"feedforward": True, "observer": 20.0}
    options["supervisor"] = fp.Supervisor(2.0, 1.0, observer=20.0)
    first, *others = fp.simulate(experiment, [form(60.0, 12.0, **options) for form in PDS])
    for other in others:
        same_run(first, other)


def test_the_model_is_asked_as_the_package_s_laws_ask_it():
    experiment = paper()
    gains = {"kp": (40.0, 30.0), "kd": (20.0, 5.0), "scale": (0.7, 1.9)}
    same_run(*fp.simulate(experiment, [JointGravity(**gains), fp.PdGravity(**gains)]))
    same_run(*fp.simulate(experiment, [RobotComputedTorque(), fp.ComputedTorque(100.0, 20.0)]))


def test_what_a_joint_remembers_is_on_record_with_the_torque_that_it_made():
    def torque(c):
        c.rate += 0.1 * (c.e_dot - c.rate)
        return c.kp * c.e + c.rate

    run = fp.simulate(paper(), own(torque, memory=("rate",)))
    assert list(run.signals) == ["rate"]
    assert np.array_equal(run.torque, 2.0 * run.error + run.rate)
    rate, e_dot = np.zeros(2), run.v_ref - run.v
    for k in range(len(run.t)):
        rate = rate + 0.1 * (e_dot[k] - rate)
        assert np.array_equal(run.rate[k], rate)
    assert dict(fp.simulate(paper(0.01), JointPd(30.0, 7.0)).signals) == {}


def test_a_law_in_python_has_memory_operators_and_the_model():
    run = fp.simulate(paper(0.3), PythonFractional(40.0, 10.0))
    bank = fp.fractional.Bank(fp.fractional.ExponentialSum(modes=24), [0.5, 0.5], step=STEP,
                              horizon=20.0)  # fmt: skip
    half = [bank.update(e, r) for e, r in zip(run.error, run.v_ref - run.v, strict=True)]
    assert np.array_equal(run.half, half)
    weight = [ARM.gravity_vector(q) for q in run.q]
    u = 40.0 * run.error + 10.0 * (run.v_ref - run.v) + half + weight
    assert run.torque == pytest.approx(u, rel=1e-13)


def test_each_loop_has_a_memory_of_its_own_and_a_reset_is_a_start():
    for law in (fp.paper_controller(), JointPid(40.0, 20.0, 25.0), PythonFractional(40.0, 10.0)):
        first, second = (law.start(ARM, step=STEP) for _ in range(2))
        rows = signals(50, seed=3)
        alone = [first.torque(*row) for row in rows]
        assert np.array_equal([second.torque(*row) for row in rows], alone)
        first.reset()
        assert np.array_equal([first.torque(*row) for row in rows], alone)


# ---------------------------------------------------------------------- faults while it runs

NEVER = 10.0  # rad; the reference is sin t


@dataclass(frozen=True, eq=False)
class Faulty(PythonPid):
    """A PID that breaks where the reference is beyond `breaks_at`."""

    breaks_at: ArrayLike = NEVER
    how: str = "raises"

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        u = super().control(state, q, v, q_ref, v_ref, a_ref)
        if not (q_ref > self.breaks_at).any():
            return u
        if self.how == "raises":
            raise ZeroDivisionError("thirteen is an\nunlucky number")
        wrong = {"shape": np.zeros(3), "scalar": 0.0, "runs": u[np.newaxis], "words": "no torque"}
        wrong["complex"] = u + 0j
        wrong["nan"] = np.where(q_ref > self.breaks_at, np.nan, u)
        return wrong.get(self.how)


CAUSES = {
    "raises": r"ZeroDivisionError: thirteen is an.*unlucky number",
    "shape": r"expected shape \(2,\), got \(3,\)",
    "scalar": r"expected shape \(2,\), got \(\)",
    "runs": r"expected shape \(2,\), got \(1, 2\)",
    "nothing": r"expected shape \(2,\), got None",
    "words": r"expected shape \(2,\), got 'no torque'",
    "complex": r"expected shape \(2,\), got \[\(?\S*j",
    "nan": r"torque is not finite",
}


@pytest.mark.parametrize("how", CAUSES)
def test_a_fault_ends_its_run_with_its_cause_and_leaves_the_others_alone(how):
    broken, sound = (Faulty(30.0, 7.0, 4.0, breaks_at=angle, how=how) for angle in (0.1, NEVER))
    run, other = fp.simulate(paper(0.2), [broken, sound])
    whole, tick = fp.simulate(paper(0.2), sound), math.ceil(math.asin(0.1) / STEP)
    same_run(other, whole)
    assert not run.outcome.completed
    assert run.outcome.time == pytest.approx(tick * STEP, abs=1e-12)
    assert re.search(CAUSES[how], run.outcome.cause)
    assert "\n" not in run.outcome.cause
    # What came before is on record, as it would have been without the fault to come.
    assert np.array_equal(run.q, whole.q[:tick])
    assert np.array_equal(run.torque, whole.torque[:tick])
    costs = fp.evaluate(paper(0.2), [broken, sound])
    assert np.isinf(costs).tolist() == [True, False]
    # In single use it is an error, in a line; also where a simulation is ticked.
    loop = dataclasses.replace(broken, breaks_at=-1.0).start(ARM, step=STEP)
    if how != "nan":
        with pytest.raises(SimulationError, match=CAUSES[how]) as caught:
            loop.torque(*np.zeros((4, 2)))
        assert "\n" not in str(caught.value)
        simulation = Simulation(paper().with_dynamics("pinocchio"), broken)
        for _ in range(tick):
            simulation.tick()
        with pytest.raises(SimulationError, match=CAUSES[how]):
            simulation.tick()


# ---------------------------------------------------------------------- faults that are seen first


def late_field(c):
    if c.t > 1.0:
        return c.nope
    return c.e


def helper(c):
    return c.missing


def in_a_helper(c):
    return c.e + (helper(c) if c.t > 1.0 else 0.0)


def catches(c):
    try:
        return c.e / c.kp
    except ZeroDivisionError:
        return 0.0


def without_return(c):
    c.kp += 1.0


def returns_sometimes(c):
    if c.t < 1.0:
        return c.e


def raises_late(c):
    if c.t > 1.0:
        raise ValueError("too late")
    return c.e


def raises_in_a_helper(c):
    return raises_late(c)


def beyond(joints, own, model):
    for j in range(joints.size + 1):
        joints[j].u_law = 0.0


def into_own(joints, own, model):
    joints[0].u_law = own[0, 0]


def of_self(self, c):
    return c.e


def line_of(function, offset):
    return rf"line {function.__code__.co_firstlineno + offset} of test_own_law.py"


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: own(late_field), f"{line_of(late_field, 2)}.*no number 'nope'"),
        (lambda: own(in_a_helper), f"{line_of(helper, 1)}.*no number 'missing'"),
        (lambda: own(helper), f"Own.torque, {line_of(helper, 1)}: the law has no number 'missing'"),
        (lambda: own(catches),
         rf"catches cannot be compiled \({line_of(catches, 3)}\): No implementation of"),
        (lambda: own(without_return),
         f"Own.torque, {line_of(without_return, 0)}: expected a number to be returned, got None"),
        # Compiled code would go on, with whatever torque there was.
        (lambda: own(returns_sometimes),
         f"Own.torque, {line_of(returns_sometimes, 1)}: expected a number .* on every way, got no"),
        (lambda: own(raises_late), f"Own.torque, {line_of(raises_late, 2)}: expected no raise"),
        (lambda: own(raises_in_a_helper), f"Own.torque, {line_of(raises_late, 2)}: expected no"),
        (lambda: own(of_self),
         rf"Own.torque, {line_of(of_self, 0)}: .* static method of \(c\), got \(self, c\)"),
        (lambda: own(torques=beyond), f"Own.torques, {line_of(beyond, 2)}: IndexError"),
        (lambda: own(torques=into_own), f"Own.torques, {line_of(into_own, 1)}: IndexError"),
        (lambda: own(lambda c: c.e, adapt=helper), f"Own.adapt, {line_of(helper, 1)}: the law has"),
        (lambda: own(), r"Own: expected functions \(torque, or torques, or control\), got none"),
        (lambda: own(3.0), "Own.torque: expected a function, got float"),
    ],
)  # fmt: skip
def test_a_function_that_cannot_be_is_one_line_with_its_place_when_the_law_starts(make, line):
    for start in (lambda law: law.start(ARM, step=STEP), lambda law: fp.simulate(paper(), law)):
        with pytest.raises(SimulationError, match=line) as caught:
            start(make())
        assert "\n" not in str(caught.value)
