"""Every law against a loop written out with Pinocchio.

The other side is in `by_hand`; both differ by rounding alone. With orders one an FPID is the
integer PID, and adaptive, to the last bit: D^1 e is the measured rate and I^1 e is int e, so
nothing is approximated, and the order of operations is part of the promise (the README's "bit by
bit"). Laws with fractional operators are in tests/simulation/test_independent_operator.py.
"""

import dataclasses
import functools

import by_hand
import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.references import Sinusoid

STEP = 1e-3


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


@pytest.mark.filterwarnings("ignore:.*gravity at the start:fpid_pin.FpidWarning")
@pytest.mark.parametrize(
    ("name", "dynamics"),
    [("two_link", "pinocchio"), ("two_link", "compiled"), ("ur5", "pinocchio"),
     ("panda", "compiled")],
)  # fmt: skip
@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_the_loop_written_out_with_all_that_the_engine_does_for_it(law, dynamics, name):
    """Scale, feedforward and observer; then also cut at effort limits, and never wound up."""
    arm = arm_of(name)
    options = {"scale": np.linspace(0.9, 1.3, arm.n), "observer": 40.0}
    for _ in ("free", "limited"):
        ours, theirs = LAWS[law](weight(arm), arm)
        options |= {} if ours.uses_model else {"feedforward": True}
        loop = by_hand.Loop(arm, theirs, STEP, **options)
        run, q, torque = both(arm, dataclasses.replace(ours, **options), loop, dynamics=dynamics)
        assert np.abs(run.q - q).max() < 1e-10
        assert np.abs(run.torque - torque).max() < 1e-9 * np.abs(torque).max()
        arm = arm.with_limits(effort=0.9 * np.abs(torque).max(axis=0))
    assert (np.abs(torque) == loop.limit).any(axis=1).sum() > 3


TICKS = 1500
KP, KI, KD = np.array([10.0, 12.0]), np.array([25.0, 20.0]), np.array([20.0, 15.0])
RATES = np.array([[25.0, 17.0], [3.0, 0.7], [11.0, 29.0]])
K0, K1 = np.array([1.0, 0.6]), np.array([2.0, 1.7])
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [np.inf, (9.0, 4.0)], ids=["unlimited", "saturated"])


def signals(seed):
    """Return q, v, q_ref, v_ref, (ticks, 4, 2): smooth enough to integrate, rough in the last bits.

    Errors of about 1 rad that change sign every 100 ticks or so, with noise, so that limits are
    met from both sides and left again.
    """
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(TICKS)[:, np.newaxis, np.newaxis]
    waves = np.sin(rng.uniform(5.0, 30.0, (4, 2)) * t + rng.uniform(0.0, 6.0, (4, 2)))
    return rng.uniform(0.3, 0.8, (4, 2)) * waves + rng.normal(0.0, 0.01, (TICKS, 4, 2))


def written_out(arm, law, scale):
    if isinstance(scale, str):
        scale = np.diag(arm.mass_matrix(arm.home)) if scale == "inertia" else np.ones(2)
    return by_hand.Loop(arm, law, STEP, scale=np.asarray(scale))


def adaptive(scale, rates, **changes):
    return fp.AdaptiveFpid(
        kp=KP, ki=KI, kd=KD, learning_rate=rates, k0=K0, k1=K1, scale=scale, **changes
    )


@LIMITS
@SCALES
@pytest.mark.parametrize("rates", [np.zeros((3, 2)), RATES], ids=["fixed", "learning"])
def test_at_orders_one_it_is_the_plain_integer_loop_on_any_signal(rates, scale, limit):
    arm = fp.Arm.two_link().with_limits(effort=limit)
    loop = adaptive(scale, rates).start(arm, step=STEP)
    pid = fp.Pid(kp=KP, ki=KI, kd=KD, scale=scale).start(arm, step=STEP)
    law = by_hand.Fpid([KP, KI, KD], rates, k0=K0, k1=K1)
    plain, beyond, moved = written_out(arm, law, scale), 0, 0.0
    for row in signals(seed=2):
        gains = law.gains
        torque = plain.torque(*row, np.zeros(2))
        beyond += (np.abs(torque) == limit).sum() / (2 * TICKS)
        moved = max(moved, np.abs(gains[0] - KP).min())
        assert np.array_equal(loop.torque(*row), torque)
        shown = loop.signals()
        assert np.array_equal([shown[name] for name in ("kp", "ki", "kd")], gains)
        assert np.array_equal(shown["s"], law.s)
        assert rates.any() or np.array_equal(pid.torque(*row), torque)
    assert (moved > 1.0) == rates.any()
    # Some tenths of the ticks are beyond the limit, so that the held integrals count.
    assert 0.1 < beyond < 0.9 if np.isfinite(limit).all() else beyond == 0.0


@pytest.mark.parametrize("changes", [{"regressors": "integer"}, {"design": fp.fractional.Crone()}])
def test_neither_the_design_nor_the_regressors_matter_at_orders_one(changes):
    """The gradient of the integer law has the integer regressors, and no operator is at work."""
    experiment = fp.paper_experiment(duration=1.0)
    one = fp.simulate(experiment, adaptive("none", RATES))
    other = fp.simulate(experiment, adaptive("none", RATES, **changes))
    for name in ("q", "torque", "kp", "ki", "kd", "s"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
