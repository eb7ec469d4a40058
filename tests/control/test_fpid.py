"""An adaptive FPID: its orders from the record, what bounds gains, the measured derivative.

That it is the law of the paper is in tests/simulation/test_independent_operator.py.
"""

import dataclasses
import math

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import Safeguards, adapt_orders
from fpid_pin.control.fpid import adapt_gains
from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.kernels.compiled import kernel

STEP = 1e-3
PAPER = fp.paper_controller(supervised=False)


def moving(rate=1.0, **changes):
    return dataclasses.replace(PAPER, order_learning_rate=rate, **changes)


def ran(controller, duration=1.0, **changes):
    experiment = fp.paper_experiment(duration=duration)
    return fp.simulate(dataclasses.replace(experiment, **changes), controller)


def streamed(orders, f, rate, h, horizon):
    """D^alpha of signals (N, n) whose orders change at every sample, and dD/dalpha.

    By as many whole operators as there are samples: at each the one that always had its order.
    The slope is the difference of two more, their orders 1e-4 to either side.
    """
    rows, n = f.shape
    bend = 1e-4
    low, high = np.maximum(orders - bend, 0.0), np.minimum(orders + bend, 1.0)
    bank = fp.fractional.Bank(PAPER.design, np.stack([orders, low, high]), step=h, horizon=horizon)
    shape = (3, rows, n)
    out = np.empty((3, rows, n))
    for k in range(rows):
        seen = bank.update(np.broadcast_to(f[k], shape), np.broadcast_to(rate[k], shape))
        out[:, k] = seen[:, k]
    slope = (out[2] - out[1]) / (high - low)
    slope[0] = 0.0
    return out[0], slope


@pytest.mark.parametrize("scale", ["none", "inertia"])
def test_the_record_satisfies_the_law(scale):
    """Orders, gains and torque recomputed from q alone; slopes by differences of operators.

    A cubic over 1/200 of an order gives values within |ln h|^4/24/200^4, slopes within
    |ln h|^3/4/200^3 of the largest: 6e-8 and 1e-5, what h = 1 ms lets through being the worst.
    """
    gamma = np.array([[0.7, 1.3], [0.9, 0.4]])
    bounds = (0.05, 0.95)
    controller = moving(
        gamma, scale=scale, integral_order_bounds=bounds, derivative_order_bounds=bounds
    )
    run = ran(controller, 0.6)
    h, e, rate = run.step, run.error, run.v_ref - run.v
    integral = np.zeros_like(e)
    steps = h * (e[1:] + e[:-1]) / 2 + h**2 * (rate[:-1] - rate[1:]) / 12
    integral[1:] = np.cumsum(steps, axis=0)
    s = controller.scale_on(run.arm)
    i_e, i_slope = streamed(1.0 - run.integral_order, integral, e, h, 0.6)
    d_e, d_slope = streamed(run.derivative_order, e, rate, h, 0.6)
    u = s * (run.kp * e + run.ki * i_e + run.kd * d_e)
    assert np.abs(run.u_fpid - u).max() < 1e-7 * np.abs(u).max()
    surface = -(rate + 2.0 * e + integral)
    for name, gains, slope, pace in (
        ("integral_order", run.ki, -i_slope, gamma[0]),
        ("derivative_order", run.kd, d_slope, gamma[1]),
    ):
        order = getattr(run, name)
        # S and the gain of the last tick; the slope of the one before that.
        growth = -h * pace * surface[1:-1] * s * gains[1:-1] * slope[:-2]
        want = np.clip(order[1:-1] + growth, *bounds)
        assert np.abs(order[2:] - want).max() < 1e-5 * np.abs(growth).max()
        assert (order[:2] == order[0]).all()
        assert np.ptp(order, axis=0).min() > 0.01
    for gains, phi in zip((run.kp, run.ki, run.kd), (e, i_e, d_e), strict=True):
        growth = -h * 25.0 * surface * phi
        assert np.abs(np.diff(gains, axis=0) - growth[:-1]).max() < 1e-7 * np.abs(growth).max()


def test_orders_stay_within_their_bounds_from_the_start():
    controller = moving(
        100.0, integral_order_bounds=(0.2, 0.9), derivative_order_bounds=(0.5, 0.92),
        integral_order=(0.0, 1.0), derivative_order=(0.1, 1.0),
    )  # fmt: skip
    run = ran(controller, 2.0)
    for order, low, high in (
        (run.integral_order, 0.2, 0.9), (run.derivative_order, 0.5, 0.92)
    ):  # fmt: skip
        # 1 - (1 - lambda) is lambda to rounding.
        assert order.min() == pytest.approx(low, abs=1e-15)
        assert order.max() == pytest.approx(high, abs=1e-15)
        assert order[0] == pytest.approx([low, high], abs=1e-15)


def test_orders_are_held_while_the_torque_is_cut():
    law = dataclasses.replace(
        PAPER, kp=10.0, ki=20.0, kd=1.0, integral_order=0.8, derivative_order=0.9,
        order_learning_rate=1.0,
    )  # fmt: skip
    loop = law.start(fp.Arm.planar([1.0], [1.0]).with_limits(effort=1.0), step=1e-3)
    for _ in range(100):
        loop.torque([0.0], [0.0], [1.0], [0.0])
    held = loop.signals()
    assert (held["integral_order"], held["derivative_order"]) == (pytest.approx(0.8), 0.9)
    for _ in range(5):
        loop.torque([0.95], [0.0], [1.0], [0.0])
    freed = loop.signals()
    assert freed["integral_order"] != held["integral_order"]


def test_suggested_rates_move_an_order_by_1_in_five_seconds_of_a_twentieth_of_a_radian():
    """S k1 e, the term's slope e for lambda and w e for mu, both times s K: as the rule says."""
    arm = fp.Arm.from_example("ur5")
    fixed = fp.suggest_gains(arm)
    law = adapt_orders(fixed, arm)
    m = np.diag(arm.mass_matrix(arm.home))
    w = np.sqrt(law.scale * law.kp / m)
    e, wait = 0.05, 5.0
    for row, gain, slope in zip(law.order_learning_rate, (law.ki, law.kd), (e, w**2 * e),
                                strict=True):  # fmt: skip
        assert row * 2.0 * e * law.scale * gain * slope * wait == pytest.approx(np.ones(arm.n))
    assert law.integral_order_bounds == (0.02, 0.9)
    assert law.derivative_order_bounds == (0.3, 0.95)
    faster = adapt_orders(fixed, arm, speed=3.0)
    assert faster.order_learning_rate == pytest.approx(3.0 * law.order_learning_rate)


def test_suggested_gains_may_come_with_them_in_files():
    arm, table = fp.Arm.two_link(), {"kind": "suggested_fpid"}
    suggested = from_dict(table | {"order_learning_rate": "suggested"}, fp.Controller)
    law, found = adapt_orders(fp.suggest_gains(arm), arm), suggested.on(arm)
    assert (found.order_learning_rate == law.order_learning_rate).all()
    assert found.derivative_order_bounds == law.derivative_order_bounds
    plain, slow = (from_dict(table | {"order_learning_rate": r}, fp.Controller) for r in (0, 0.5))
    assert not plain.on(arm).moves_orders
    assert float(slow.on(arm).order_learning_rate) == 0.5
    assert from_dict(to_dict(suggested), fp.Controller).order_learning_rate == "suggested"


def test_an_order_that_no_gain_or_surface_counts_stays():
    arm = fp.Arm.two_link()
    law = adapt_orders(dataclasses.replace(PAPER, ki=(0.0, 20.0)), arm)
    assert (law.order_learning_rate[0] == 0.0).tolist() == [True, False]
    assert (law.order_learning_rate[1] > 0.0).all()
    assert not adapt_orders(dataclasses.replace(PAPER, k1=0.0), arm).moves_orders


# ---------------------------------------------------------------------- safeguards

START = np.array([10.0, 20.0, 5.0])


adapt = kernel(adapt_gains)


@kernel
def repeat(joints, history):
    c = joints[0]
    for k in range(history.shape[0]):
        adapt(c)
        history[k, 0], history[k, 1], history[k, 2] = c.kp, c.ki, c.kd


def adapted(guard, signals, ticks, rate=25.0):
    """Return the gains, (ticks, 3), of one joint whose [int e, e, e'] stays at `signals`.

    The law's own records are filled by its description; then the signals are held there.
    """
    law = fp.AdaptiveFpid(
        *START, learning_rate=rate, k0=1.0, k1=2.0, regressors="integer", safeguards=guard
    )
    arm = fp.Arm.planar([1.0], [1.0])
    joints = law.start(arm, step=STEP).state.joints
    joints["int_e"], joints["e"], joints["e_dot"] = signals
    joints["s"] = -(signals[2] + 2.0 * signals[1] + signals[0])
    history = np.empty((ticks, 3))
    repeat(joints, history)
    return history


#: Safeguards, [int e, e, e'], ticks and rate; what the gains come to, and how exactly.
HELD = {
    # gamma k0 (int e)^2 for ever.
    "none": (None, (0.3, 0.0, 0.0), 4000, 25.0, (10.0, 20.0 + 25.0 * 0.3**2 * 4.0, 5.0), 1e-9),
    "upper bounds": (
        Safeguards(4.0, [[10.5], [20.5], [5.5]]), (0.5, 0.4, 0.3), 5000, 25.0, (10.5, 20.5, 5.5), 0,
    ),
    "lower bounds": (
        Safeguards(4.0), (-2.0, 0.4, 0.3), 5000, 25.0, (4.0, 20.0 + 25.0 * 0.9 * 2.0 * 5.0, 4.0),
        1e-9,
    ),
    "bounds at the start": (Safeguards(maximum=8.0), (0.0,) * 3, 1, 25.0, (8.0, 8.0, 5.0), 0),
    # gamma |S| e = gamma nu |S| (K - K0): the offset is e/nu whatever the rate.
    "e-modification": (
        Safeguards(e_modification=0.4), (0.0, 0.1, 0.0), 10_000, 100.0, (10.25, 20.0, 5.0), 1e-4
    ),
    "e-modification, S = 0": (
        Safeguards(e_modification=0.4), (-0.2, 0.1, 0.0), 100, 25.0, START, 0
    ),
    # Gradient and leakage: K+ = K + h (gamma k1 e^2 - sigma (K - K0)).
    "sigma-modification": (
        Safeguards(sigma=4.0), (0.0, 0.1, 0.0), 250, 25.0,
        (10.0 + 25.0 * 2.0 * 0.1**2 / 4.0 * (1.0 - (1.0 - 4.0 * STEP) ** 250), 20.0, 5.0), 1e-9,
    ),
    "within the dead zone": (Safeguards(dead_zone=0.21), (0.0, 0.1, 0.0), 100, 25.0, START, 0),
    "beyond the dead zone": (
        Safeguards(dead_zone=0.15), (0.0, 0.1, 0.0), 1000, 25.0,
        (10.0 + 25.0 * (0.2 - 0.15) * 0.1, 20.0, 5.0), 1e-9,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HELD)
def test_gains_come_to_what_safeguards_leave_of_a_constant_signal(name):
    guard, signals, ticks, rate, expected, relative = HELD[name]
    gains = adapted(guard, signals, ticks, rate)
    assert gains[-1] == pytest.approx(expected, rel=relative, abs=0.0)
    (low,), (high,) = (bound.T for bound in Safeguards.bounds_of(guard, 1))
    assert ((low <= gains) & (gains <= high)).all()


def test_a_held_joint_does_not_even_leak():
    arm = fp.Arm.planar([1.0], [1.0]).with_limits(effort=0.5)
    law = fp.AdaptiveFpid(*START, learning_rate=25.0, safeguards=Safeguards(sigma=5.0))
    loop = law.start(arm, step=STEP)
    loop.torque([0.0], [0.0], [0.1], [0.0])
    loop.state.joints["kp"] = 30.0  # above the initial one, so that leakage would lower it
    for _ in range(100):
        loop.torque([0.0], [0.0], [0.1], [0.0])
    assert loop.signals()["kp"] == [30.0]


# ---------------------------------------------------------------------- on the measured angle

LAW = fp.AdaptiveFpid(
    kp=(10, 12), ki=(25, 20), kd=(20, 15), integral_order=0.9, derivative_order=(0.9, 0.6),
    order_learning_rate=0.1, safeguards=fp.Safeguards(sigma=0.03), feedforward=True,
)  # fmt: skip
ON_MEASUREMENT = dataclasses.replace(LAW, derivative_on="measurement")


def jump(law, by=0.2):
    """Return by how much the torque jumps with q_d, the arm and q'_d being at rest."""
    loop, rest = law.start(fp.Arm.two_link(), step=STEP), np.zeros(2)
    for _ in range(20):
        before = loop.torque(rest, rest, rest, rest, rest)
    return loop.torque(rest, rest, rest + by, rest, rest) - before


def test_a_jump_of_the_reference_kicks_by_the_closed_form_or_not_at_all():
    fixed = dataclasses.replace(
        LAW, order_learning_rate=0.0, learning_rate=0.0, safeguards=None, feedforward=False
    )
    without = jump(dataclasses.replace(fixed, kd=0.0))
    assert np.array_equal(jump(dataclasses.replace(fixed, derivative_on="measurement")), without)
    mu = np.array([0.9, 0.6])
    size = 6.0 * 0.2 * STEP**-mu / ([math.gamma(1.0 - m) for m in mu] * (2.0 - mu) * (3.0 - mu))
    assert jump(fixed) - without == pytest.approx([20, 15] * size, rel=1e-5)


def test_where_the_reference_holds_both_are_one_law():
    """D^mu (q_d - q) = -D^mu q: gains and orders that adapt, too."""
    arm = fp.Arm.two_link()
    experiment = fp.Experiment(
        arm, fp.references.Hold((0.4, -0.3)), q0=(0.0, 0.2), duration=2.0, dynamics="compiled"
    )
    error, measurement = fp.simulate(experiment, [LAW, ON_MEASUREMENT])
    for name in ("q", "torque", "kd", "derivative_order"):
        assert getattr(measurement, name) == pytest.approx(getattr(error, name), rel=1e-9, abs=1e-9)
    assert np.ptp(error.kd[:, 0]) > 1e-3
