"""Every law against a loop written out with Pinocchio, on arms of two, six and seven joints.

The other side is in `by_hand`. Laws without operators differ by rounding alone; those with
fractional operators by what the other side's rule is wrong by.
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


def both(arm, law, loop, *, duration=1.0, finer=1, **changes):
    """Return the run, and the other side's angles and torques, whose step may be `finer`.

    The plant carries a load that no law knows of.
    """
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    motion = Sinusoid(0.3, 2.0, phase=phase, offset=arm.home)

    def sample(t):
        return [x[0] for x in motion.sample(np.array([t]))]

    q0, v0 = sample(0.0)[0] + 0.03, sample(0.0)[1]
    plant = arm.with_payload(0.4)
    step = loop.h * finer
    experiment = fp.Experiment(
        arm, motion, q0, v0, plant=fp.Plant(arm=plant), step=step, duration=duration, **changes
    )
    rows = finer * (experiment.rows - 1) + 1
    q, torque = by_hand.simulate(loop, plant, sample, q0, v0, rows)
    run = fp.simulate(experiment, law)
    assert run.outcome.completed
    return run, q[::finer], torque[::finer]


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


@ARMS
@pytest.mark.parametrize("dynamics", ["pinocchio", "compiled"])
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


ORDERS = 0.85, 0.8


def fractional(arm, operator, step, rows):
    """Return an adaptive FPID whose modes are exact within 1e-11, and the one written out."""
    m = weight(arm)
    gains, rates = [60 * m, 80 * m, 15 * m], [400 * m] * 3
    ours = fp.AdaptiveFpid(
        *gains, *ORDERS, learning_rate=400 * m, design=fp.fractional.ExponentialSum(modes=40)
    )
    return ours, by_hand.Fpid(gains, rates, operator, ORDERS, step, rows)


@ARMS
def test_the_fractional_law_with_l1_sums_differs_by_their_own_order(name):
    """Same Euler steps on both sides, so what is left falls with h^(2 - mu), the roughest term."""
    arm, gaps = arm_of(name), []
    for step in (2e-3, 1e-3):
        ours, theirs = fractional(arm, by_hand.L1, step, 1001)
        run, q, _ = both(arm, ours, by_hand.Loop(arm, theirs, step))
        gaps.append(np.abs(run.q - q).max())
    assert gaps[1] < 1e-3
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2.0 - ORDERS[1], abs=0.1)


@ARMS
def test_the_fractional_law_with_grunwald_letnikov_sums_ten_times_finer_has_the_same_limit(name):
    """Both loops are of order one: Euler's steps, the held torque, the sum (1) itself."""
    arm, gaps = arm_of(name), []
    for step in (2e-3, 1e-3):
        ours, theirs = fractional(arm, by_hand.GrunwaldLetnikov, step / 10.0, 5001)
        loop = by_hand.Loop(arm, theirs, step / 10.0)
        run, q, _ = both(arm, ours, loop, finer=10, duration=0.5)
        gaps.append(np.abs(run.q - q).max())
    assert gaps[1] < 3e-3
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.15)
