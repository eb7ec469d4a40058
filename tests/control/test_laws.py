"""Every law against a loop written out with Pinocchio, and against closed forms of its theory.

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
from fpid_pin.arms.rigid_body import inertial_numbers
from fpid_pin.control import SlidingMode, SlotineLi
from fpid_pin.control.sliding_mode import natural_sizes
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
def test_without_learning_it_is_the_pid_on_any_signal(scale, limit):
    arm = fp.Arm.two_link().with_limits(effort=limit)
    pid = fp.Pid(kp=KP, ki=KI, kd=KD, scale=scale).start(arm, step=STEP)
    fpid = adaptive(scale, 0.0).start(arm, step=STEP)
    plain = written_out(arm, by_hand.Pid(KP, KI, KD), scale)
    beyond = 0
    for row in signals(seed=1):
        torque = plain.torque(*row, np.zeros(2))
        beyond += (np.abs(torque) == limit).sum() / (2 * TICKS)
        assert np.array_equal(pid.torque(*row), torque)
        assert np.array_equal(fpid.torque(*row), torque)
    # Some tenths of the ticks are beyond the limit, so that the held integrals count.
    assert 0.1 < beyond < 0.9 if np.isfinite(limit).all() else beyond == 0.0


@LIMITS
@SCALES
def test_with_learning_it_is_the_plain_adaptive_integer_loop(scale, limit):
    arm = fp.Arm.two_link().with_limits(effort=limit)
    loop = adaptive(scale, RATES).start(arm, step=STEP)
    law = by_hand.Fpid([KP, KI, KD], RATES, k0=K0, k1=K1)
    plain, moved = written_out(arm, law, scale), 0.0
    for row in signals(seed=2):
        gains = law.gains
        assert np.array_equal(loop.torque(*row), plain.torque(*row, np.zeros(2)))
        shown = loop.signals()
        assert np.array_equal([shown[name] for name in ("kp", "ki", "kd")], gains)
        assert np.array_equal(shown["s"], law.s)
        moved = max(moved, np.abs(gains[0] - KP).min())
    assert moved > 1.0


@pytest.mark.parametrize("changes", [{"regressors": "integer"}, {"design": fp.fractional.Crone()}])
def test_neither_the_design_nor_the_regressors_matter_at_orders_one(changes):
    """The gradient of the integer law has the integer regressors, and no operator is at work."""
    experiment = fp.paper_experiment(duration=1.0)
    one = fp.simulate(experiment, adaptive("none", RATES))
    other = fp.simulate(experiment, adaptive("none", RATES, **changes))
    for name in ("q", "torque", "kp", "ki", "kd", "s"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


@pytest.mark.parametrize(("k0", "k1"), [(25.0, 6.0), (9.0, 6.0)])
def test_computed_torque_on_the_exact_model_obeys_the_error_equation(k0, k1):
    arm = fp.Arm.two_link()
    experiment = fp.Experiment(
        arm=arm, reference=Sinusoid((0.8, 0.6)), q0=(0.3, -0.4), v0=(0.8, 0.6),
        step=5e-4, duration=1.5, integrator="rk4",
    )  # fmt: skip
    run = fp.simulate(experiment, fp.ComputedTorque(k0=k0, k1=k1))
    roots = np.roots([1.0, k1, k0]).astype(complex)
    if abs(roots[0] - roots[1]) < 1e-6:
        shape = (1.0 - roots[0] * run.t) * np.exp(roots[0] * run.t)
    else:
        shape = roots[1] * np.exp(roots[0] * run.t) - roots[0] * np.exp(roots[1] * run.t)
        shape /= roots[1] - roots[0]
    expected = np.outer(shape.real, run.error[0])
    assert np.abs(run.error - expected).max() < 1e-3 * np.abs(run.error[0]).max()


def test_sliding_mode_reaches_its_layer_and_stays_within_in_spite_of_a_payload():
    arm = fp.Arm.two_link()
    law = SlidingMode(slope=5.0, gain=(60.0, 30.0), boundary_layer=0.2)
    experiment = fp.Experiment(
        arm=arm, reference=Sinusoid(0.6), q0=(0.3, -0.3),
        plant=fp.Plant(arm=arm.with_payload(0.3)), duration=4.0,
    )  # fmt: skip
    run = fp.simulate(experiment, law)
    assert np.abs(run.s[0]).max() > 0.2
    assert np.abs(run.s[1000:]).max() < 0.2
    # Within the layer |e| <= layer/slope: e' + slope e = -S is a low-pass filter.
    assert np.abs(run.error[2500:]).max() < 0.2 / 5.0


def test_slotine_li_lyapunov_function_does_not_rise():
    arm = fp.Arm.two_link()
    law = SlotineLi(slope=5.0, damping=20.0, adaptation_rate=4.0, initial=0.5, friction=False)
    step = 5e-4
    loop = law.start(arm, step=step, horizon=10.0)
    mass, reach, _ = natural_sizes(arm)
    sizes = np.stack([mass, *3 * [mass * reach], *6 * [mass * reach**2]], axis=1)
    names = ["m", "h0", "h1", "h2", "j00", "j01", "j02", "j11", "j12", "j22"]
    q, v = np.array([0.3, -0.2]), np.zeros(2)
    values = []
    for k in range(1500):
        t = k * step
        torque = loop.torque(q, v, *np.outer([np.sin(t), np.cos(t), -np.sin(t)], np.ones(2)))
        estimates = np.stack([loop.state.joints[f"{name}_hat"] for name in names], axis=1)
        s = loop.signals()["s"]
        wrong = (estimates - inertial_numbers(arm.bodies)) / sizes
        values.append(0.5 * s @ arm.mass_matrix(q) @ s + 0.5 * (wrong**2).sum() / 4.0)
        v = v + step * arm.forward_dynamics(q, v, torque)
        q = q + step * v
    # In continuous time V' = -S^T K_D S; a step of h adds terms of the order of h.
    assert np.diff(values).max() < 5e-4 * values[0]
    assert values[-1] < 0.95 * values[0]
