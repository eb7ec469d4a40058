"""Every law against a loop written out with Pinocchio, on arms of two, six and seven joints.

The other side is in `by_hand`; both differ by rounding alone. Laws with fractional operators are in
tests/simulation/test_independent_operator.py.
"""

import dataclasses
import functools

import by_hand
import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.references import Sinusoid

STEP = 1e-3
ARMS = pytest.mark.parametrize("name", ["two_link", "ur5", "panda"])


@functools.cache
def arm_of(name):
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    return arm.with_armature(0.02).with_friction(viscous=0.05).with_limits(effort=np.inf)


def weight(arm):
    """Return M_jj at home, (n,): gains in units of it are alike on all joints."""
    return np.diag(arm.mass_matrix(arm.home))


def both(arm, law, loop, **changes):
    """Return the run, and the other side's angles and torques; no law knows the plant's load."""
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    motion = Sinusoid(0.3, 2.0, phase=phase, offset=arm.home)

    def sample(t):
        return [x[0] for x in motion.sample(np.array([t]))]

    q0, v0 = sample(0.0)[0] + 0.03, sample(0.0)[1]
    plant = arm.with_payload(0.4)
    experiment = fp.Experiment(
        arm, motion, q0, v0, plant=fp.Plant(arm=plant), step=loop.h, duration=0.5, **changes
    )
    q, torque = by_hand.simulate(loop, plant, sample, q0, v0, experiment.rows)
    run = fp.simulate(experiment, law)
    assert run.outcome.completed
    return run, q, torque


#: Pairs of ours and theirs, for gains in units of `weight` and an arm.
LAWS = {
    "PID": lambda m, arm: (fp.Pid(60 * m, 80 * m, 15 * m), by_hand.Pid(60 * m, 80 * m, 15 * m)),
    "PD + gravity": lambda m, arm: (
        fp.PdGravity(60 * m, 15 * m, ki=80 * m), by_hand.PdGravity(60 * m, 80 * m, 15 * m)
    ),
    "gravity only": lambda m, arm: (fp.GravityOnly(), by_hand.GravityOnly()),
    "computed torque": lambda m, arm: (
        fp.ComputedTorque(60.0, 15.0, ki=80.0), by_hand.ComputedTorque(60.0, 15.0, 80.0)
    ),
    "sliding mode": lambda m, arm: (
        fp.SlidingMode(8.0, 10 * m, 0.3), by_hand.SlidingMode(8.0, 10 * m, 0.3)
    ),
    "adaptive integer PID": lambda m, arm: (
        fp.AdaptiveFpid(60 * m, 80 * m, 15 * m, learning_rate=400 * m),
        by_hand.Fpid([60 * m, 80 * m, 15 * m], [400 * m] * 3),
    ),
    "Slotine-Li": lambda m, arm: (
        fp.SlotineLi(8.0, 15 * m, 2.0, 0.7, leakage=0.3),
        by_hand.SlotineLi(arm, 8.0, 15 * m, 2.0, 0.7, 0.3),
    ),
}  # fmt: skip


def same(run, q, torque):
    assert np.abs(run.q - q).max() < 1e-10
    assert np.abs(run.torque - torque).max() < 1e-9 * np.abs(torque).max()


@pytest.mark.parametrize(
    ("name", "dynamics"),
    [("two_link", "pinocchio"), ("two_link", "compiled"), ("ur5", "pinocchio"),
     ("panda", "compiled")],
)  # fmt: skip
@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_the_loop_written_out(law, dynamics, name):
    arm = arm_of(name)
    ours, theirs = LAWS[law](weight(arm), arm)
    same(*both(arm, ours, by_hand.Loop(arm, theirs, STEP), dynamics=dynamics))


@pytest.mark.filterwarnings("ignore:.*gravity at the start:fpid_pin.FpidWarning")
@ARMS
@pytest.mark.parametrize("law", LAWS)
def test_so_it_is_with_scale_observer_feedforward_and_effort_limits(law, name):
    """What the engine does for every law: the torque in its parts, cut, and never wound up."""
    free = arm_of(name)
    options = {"scale": np.linspace(0.9, 1.3, free.n), "observer": 40.0}
    ours, theirs = LAWS[law](weight(free), free)
    if not ours.uses_model:
        options["feedforward"] = True
    ours = dataclasses.replace(ours, **options)
    _, _, torque = both(free, ours, by_hand.Loop(free, theirs, STEP, **options))
    _, theirs = LAWS[law](weight(free), free)
    arm = free.with_limits(effort=0.9 * np.abs(torque).max(axis=0))
    run, q, torque = both(arm, ours, by_hand.Loop(arm, theirs, STEP, **options))
    same(run, q, torque)
    assert (np.abs(torque) == arm.effort_limit).any(axis=1).sum() > 3
