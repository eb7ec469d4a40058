"""Orders that adapt, as a user meets them: the law from the record, bounds, files, refusals."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import adapt_orders
from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.exceptions import ArgumentError

RATE = 1.0
PAPER = fp.paper_controller(supervised=False)


def moving(rate=RATE, **changes):
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


def test_white_noise_of_the_rate_does_not_drive_mu():
    """E[S dD/dmu] of noise alone would be positive with both of one sample; not a sample apart.

    The arm stands still where it should be, so that there is nothing but noise: 0.05 rad/s for
    20 s moves mu by gamma h S K slope of random sign, a random walk; drift would be 60 times that.
    """
    law = moving(0.1, learning_rate=0.0)
    loop = law.start(fp.Arm.two_link(), step=1e-3, horizon=20.0)
    rest = np.zeros(2)
    orders = np.empty((20000, 2))
    for k, noise in enumerate(0.05 * np.random.default_rng(1).normal(size=orders.shape)):
        loop.torque(rest, noise, rest, rest)
        orders[k] = loop.signals()["derivative_order"]
    steps = np.diff(orders, axis=0)
    walk = np.sqrt(len(steps)) * steps.std(axis=0)
    assert (np.abs(orders[-1] - orders[0]) < 3.0 * walk).all()


# ------------------------------------------------------------------------------ files


# ------------------------------------------------------------------------------ rates to begin with


def test_suggested_rates_move_an_order_by_1_in_five_seconds_of_a_twentieth_of_a_radian():
    """S k1 e, the term's slope e for lambda and w e for mu, both times s K: as the rule says."""
    arm = fp.Arm.from_example("ur5")
    law = adapt_orders(fp.suggest_gains(arm), arm)
    m = np.diag(arm.mass_matrix(arm.home))
    w = np.sqrt(law.scale * law.kp / m)
    e, wait = 0.05, 5.0
    for row, gain, slope in zip(law.order_learning_rate, (law.ki, law.kd), (e, w**2 * e),
                                strict=True):  # fmt: skip
        assert row * 2.0 * e * law.scale * gain * slope * wait == pytest.approx(np.ones(arm.n))
    assert law.integral_order_bounds == (0.02, 0.9)
    assert law.derivative_order_bounds == (0.3, 0.95)
    faster = adapt_orders(fp.suggest_gains(arm), arm, speed=3.0)
    assert faster.order_learning_rate == pytest.approx(3.0 * law.order_learning_rate)


def test_suggested_gains_may_come_with_them_in_files():
    arm, table = fp.Arm.two_link(), {"kind": "suggested_fpid"}
    suggested = from_dict(table | {"order_learning_rate": "suggested"}, fp.Controller)
    law = adapt_orders(fp.suggest_gains(arm), arm)
    assert (suggested.on(arm).order_learning_rate == law.order_learning_rate).all()
    assert suggested.on(arm).derivative_order_bounds == law.derivative_order_bounds
    plain, slow = (from_dict(table | {"order_learning_rate": r}, fp.Controller) for r in (0, 0.5))
    assert not plain.on(arm).moves_orders
    assert float(slow.on(arm).order_learning_rate) == 0.5
    assert from_dict(to_dict(suggested), fp.Controller).order_learning_rate == "suggested"
    for rate, told in ((-1.0, "expected a number >= 0, got -1"), ("fast", "suggested")):
        with pytest.raises(ArgumentError, match=f"order_learning_rate: .*{told}"):
            fp.SuggestedFpid(order_learning_rate=rate)


def test_an_order_that_no_gain_or_surface_counts_stays():
    arm = fp.Arm.two_link()
    law = adapt_orders(dataclasses.replace(PAPER, ki=(0.0, 20.0)), arm)
    assert (law.order_learning_rate[0] == 0.0).tolist() == [True, False]
    assert (law.order_learning_rate[1] > 0.0).all()
    assert not adapt_orders(dataclasses.replace(PAPER, k1=0.0), arm).moves_orders


# ------------------------------------------------------------------------------ bad input
