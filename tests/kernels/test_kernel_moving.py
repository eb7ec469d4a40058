"""Orders that move: `operator.moving` against mpmath, `law.bend` against its equation."""

from functools import partial
from math import factorial

import mpmath as mp
import numpy as np
import pytest

from fpid_pin.fractional import ExponentialSum
from fpid_pin.kernels import law
from fpid_pin.kernels.operator import OPERATOR, begin, derivative, moving

pytestmark = pytest.mark.kernels

STEP, SAMPLES, NODES = 0.01, 60, 201
GAP = 1.0 / (NODES - 1)
T = np.arange(SAMPLES) * STEP
DESIGN = ExponentialSum(32)
#: Both ends, nodes, middles between nodes, and beside the ends, where the cubic is not centred.
ORDERS = [
    0.0, 0.2 * GAP, GAP, 0.1, 0.1 + GAP / 2, 0.37, 0.5, 0.783, 1.0 - GAP, 1.0 - 0.3 * GAP, 1.0,
]  # fmt: skip
W = 3.0  # [rad/s]


def table(design=DESIGN, nodes=NODES):
    orders = np.linspace(0.0, 1.0, nodes)
    return design.coefficients(orders, step=STEP, horizon=SAMPLES * STEP).table()


def operator(order, initialisation="caputo", design=DESIGN):
    modes = design.coefficients([order], step=STEP, horizon=SAMPLES * STEP)
    ops, poles, modes = modes.records(initialisation)
    return ops[0], poles[0], modes[0]


def streamed(orders, f, rate, initialisation="caputo", grid=None):
    """Values and slopes of one operator whose order is orders[k] at sample k, (N,) each."""
    grid = table() if grid is None else grid
    op, poles, modes = operator(orders[0], initialisation)
    y, slope = np.zeros((2, len(f)))
    y[0] = begin(op, modes, f[0], rate[0])
    for k in range(1, len(f)):
        op.order = orders[k]
        y[k] = moving(op, grid, poles, modes, f[k], f[k - 1], rate[k], rate[k - 1], STEP)
        slope[k] = op.slope
    return y, slope


def fixed(order, f, rate, initialisation="caputo"):
    op, poles, modes = operator(order, initialisation)
    y = np.zeros(len(f))
    y[0] = begin(op, modes, f[0], rate[0])
    for k in range(1, len(f)):
        y[k] = derivative(op, poles, modes, f[k], f[k - 1], rate[k], rate[k - 1], STEP)
    return y


def of_sin(order, t):
    """D^a sin w t, w t^(1 - a) sum_k (-(w t)^2)^k/Gamma(2 k + 2 - a): an entire function of a."""
    x = W * mp.mpf(t)
    series = mp.fsum((-1) ** k * x ** (2 * k) / mp.gamma(2 * k + 2 - order) for k in range(16))
    return W * mp.mpf(t) ** (1 - order) * series


def of_square(order, t):
    return 2 / mp.gamma(3 - order) * mp.mpf(t) ** (2 - order)


def bound(function, order):
    """What a cubic through four nodes may be wrong by in value and slope: f'''' h^4/24, h^3/4."""
    around = [min(max(order + x * GAP, 0.0), 1.0) for x in (-2, 2)]
    fourth = max(abs(float(mp.diff(function, a, 4))) for a in around)
    return 1.1 * fourth * GAP**4 / factorial(4), 1.1 * fourth * GAP**3 / 4.0


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    ("exact", "f", "rate", "modes"),
    [
        (of_square, T**2, 2.0 * T, 1e-8),
        (of_sin, np.sin(W * T), W * np.cos(W * T), 1e-6),
    ],
)
def test_value_and_slope_are_those_of_the_exact_derivative(exact, f, rate, modes, order):
    """To the cubic's own error, and what operators of 32 modes leave of the largest value.

    That is 1e-8 of t^2, whose rate they take as it is, and 1e-6 of a sine. To the slope it is no
    more than ten times that: the weights are smooth in the order.
    """
    y, slope = streamed(np.full(SAMPLES, order), f, rate)
    with mp.workdps(30):
        modes *= float(max(abs(exact(a, T[-1])) for a in (0.0, 0.5, 1.0)))
        for k in (1, 10, SAMPLES - 1):
            of_order = partial(exact, t=T[k])
            value_error, slope_error = bound(of_order, order)
            truth = float(mp.diff(of_order, mp.mpf(order)))
            assert abs(y[k] - float(of_order(order))) <= value_error + modes
            assert abs(slope[k] - truth) <= slope_error + 10.0 * modes


def test_the_slope_is_the_difference_of_two_operators():
    """Of a rough signal, to the fourth differences of the operator itself over a wider gap."""
    rng = np.random.default_rng(2)
    rate = rng.normal(size=SAMPLES)
    f = np.concatenate([[0.0], np.cumsum(STEP * (rate[1:] + rate[:-1]) / 2.0)])
    for order in (0.1234, 0.5, 0.8765):
        _, slope = streamed(np.full(SAMPLES, order), f, rate)
        gap = 1e-4
        upper, lower = (fixed(order + side * gap, f, rate) for side in (1.0, -1.0))
        # A rate of random signs is led by its newest sample, whose weight goes like h^-a: ln h to
        # the power of its derivatives.
        fourth = np.abs(rate).max() * np.log(STEP) ** 4
        near = 1.1 * fourth * GAP**3 / 4.0
        assert np.abs(slope - (upper - lower) / (2.0 * gap))[1:].max() < near


@pytest.mark.parametrize("initialisation", ["caputo", "riemann_liouville", "grunwald_letnikov"])
@pytest.mark.parametrize("order", ORDERS[1:])
def test_an_order_that_stays_gives_what_the_fixed_operator_gives(order, initialisation):
    """At a node to rounding; between them to what the cubic makes of the exact derivative."""
    w = 5.0
    f, rate = np.cos(w * T), -w * np.sin(w * T)
    y, _ = streamed(np.full(SAMPLES, order), f, rate, initialisation)
    want = fixed(order, f, rate, initialisation)
    if abs(order / GAP - round(order / GAP)) < 1e-9:
        assert np.abs(y - want).max() < 1e-13 * np.abs(want).max()

    def exact(a, t):
        jump = 0.0 if initialisation == "caputo" else mp.mpf(t) ** -a * mp.rgamma(1 - a)
        series = mp.fsum(
            (-1) ** k * (w * mp.mpf(t)) ** (2 * k) / mp.gamma(2 * k + 3 - a) for k in range(16)
        )
        return jump - w**2 * mp.mpf(t) ** (2 - a) * series

    with mp.workdps(30):
        for k in (1, 10, SAMPLES - 1):
            limit, _ = bound(partial(exact, t=T[k]), order)
            assert abs(y[k] - want[k]) <= limit + 1e-13 * np.abs(want).max()


def test_an_order_that_falls_to_0_tends_to_caputo_s_limit():
    f, rate = np.cos(5.0 * T), -5.0 * np.sin(5.0 * T)
    y, _ = streamed(np.concatenate([[0.3], np.zeros(SAMPLES - 1)]), f, rate)
    assert np.abs(y - (f - f[0])).max() < 1e-13
    y, _ = streamed(np.zeros(SAMPLES), f, rate, "riemann_liouville")
    assert np.abs(y - f).max() < 1e-13


def test_an_order_moved_back_and_forth_gives_what_one_that_was_always_there_gives():
    """The modes know nothing of the order: not a bit is left of where it has been."""
    rng = np.random.default_rng(3)
    f, rate = np.sin(7.0 * T) + 0.3, 7.0 * np.cos(7.0 * T)
    wandered = np.clip(0.6 + np.cumsum(rng.normal(0.0, 0.2, SAMPLES)), 0.0, 1.0)
    wandered[0], wandered[40:] = 0.6, 0.6
    stayed = np.full(SAMPLES, 0.6)
    grid = table()
    moved, was = (streamed(orders, f, rate, grid=grid) for orders in (wandered, stayed))
    assert (moved[0][40:] == was[0][40:]).all()
    assert (moved[1][40:] == was[1][40:]).all()
    assert (moved[0][1:40] != was[0][1:40]).any()


def test_the_slope_of_a_sample_ago_is_kept():
    grid = table()
    op, poles, modes = operator(0.4)
    begin(op, modes, 0.0, 1.0)
    seen = [0.0]
    for k in range(1, 5):
        moving(op, grid, poles, modes, T[k], T[k - 1], 1.0, 1.0, STEP)
        assert op.slope_ == seen[-1]
        seen.append(float(op.slope))


# ------------------------------------------------------------------------------ the law

H = 1e-3


def joint(s=-0.7, **values):
    """A joint and its two operators, as `bend` takes them."""
    c, ops = np.zeros(1, law.JOINT)[0], np.zeros(2, OPERATOR)
    given = {
        "s": s, "scale": 2.0, "ki": 20.0, "kd": 5.0, "gamma_io": 0.3, "gamma_do": 0.4,
        "i_order_max": 1.0, "d_order_max": 1.0, "i_order_0": 0.2, "d_order_0": 0.8,
    } | values  # fmt: skip
    for name, value in given.items():
        c[name] = value
    ops["order"], ops["slope_"], ops["slope"] = [0.1, 0.9], [0.25, -0.5], [9.0, 9.0]
    return c, ops[0], ops[1]


def test_orders_follow_the_gradient_by_the_slope_of_a_sample_ago():
    c, i_op, d_op = joint()
    law.bend(c, i_op, d_op, 0, H)
    # alpha = 1 - lambda: dI^lambda e/dlambda is -dD/dalpha.
    lam = 0.9 - H * 0.3 * -0.7 * 2.0 * 20.0 * -0.25
    mu = 0.9 - H * 0.4 * -0.7 * 2.0 * 5.0 * -0.5
    assert lam != 0.9 != mu
    assert (c.lam, c.mu) == (pytest.approx(lam, rel=1e-15), pytest.approx(mu, rel=1e-15))
    assert (i_op.order, d_op.order) == (pytest.approx(1.0 - lam, rel=1e-14), c.mu)


def test_orders_are_projected_to_their_bounds():
    """S pushes alpha of int e up and that of e down by 3e-3 at most."""
    c, i_op, d_op = joint(i_order_max=0.101, d_order_min=0.8995)
    law.bend(c, i_op, d_op, 0, H)
    assert (i_op.order, d_op.order) == (0.101, 0.8995)
    c, i_op, d_op = joint(s=0.7, i_order_min=0.099, d_order_max=0.9005)
    law.bend(c, i_op, d_op, 0, H)
    assert (i_op.order, d_op.order, c.lam, c.mu) == (0.099, 0.9005, 1.0 - 0.099, 0.9005)


def test_dead_zone_and_leakage_count_for_orders():
    guard = {"dead_zone": 0.5, "sigma": 3.0, "nu": 0.25}
    c, i_op, d_op = joint(**guard)
    law.bend(c, i_op, d_op, 1, H)
    s = -0.2  # what is beyond the dead zone
    for op, gamma, gain, start, before, slope in (
        (i_op, 0.3, 20.0, 0.2, 0.1, 0.25), (d_op, 0.4, 5.0, 0.8, 0.9, -0.5)
    ):  # fmt: skip
        leak = (3.0 + 0.25 * gamma * 0.2) * (before - start)
        want = before - H * gamma * s * 2.0 * gain * slope - H * leak
        assert op.order == pytest.approx(want, rel=1e-14)
    # Within the dead zone only the leak is left; without safeguards neither is.
    c, i_op, d_op = joint(s=0.4, **guard)
    law.bend(c, i_op, d_op, 1, H)
    assert i_op.order == pytest.approx(0.1 + H * 3.0 * 0.1, rel=1e-14)
    c, i_op, d_op = joint(s=0.4, **guard)
    law.bend(c, i_op, d_op, 0, H)
    assert i_op.order == pytest.approx(0.1 - H * 0.3 * 0.4 * 2.0 * 20.0 * 0.25, rel=1e-14)


def ticked(count, limit=np.inf, seed=0, **robot):
    """One joint whose orders move, driven by random signals: its record after each tick."""
    robots, joints = np.zeros(1, law.ROBOT), np.zeros((1, 1), law.JOINT)
    robots["h"], robots["threshold"], robots["moves"] = STEP, np.inf, 1
    given = {
        "kp": 10.0, "ki": 20.0, "kd": 5.0, "scale": 1.0, "k0": 1.0, "k1": 2.0, "limit": limit,
        "gamma_io": 1e-3, "gamma_do": 1e-3, "i_order_max": 1.0, "d_order_max": 1.0,
    }  # fmt: skip
    for name, value in given.items():
        joints[name] = value
    for name, value in robot.items():
        robots[name] = value
    modes = DESIGN.coefficients([[[0.3, 0.7]]], step=STEP, horizon=SAMPLES * STEP)
    ops, poles, modes = modes.records()
    torque, seen, grid = np.zeros((1, 1)), [], table()
    alive = np.ones(1, bool)
    for row in np.random.default_rng(seed).normal(size=(count, 5, 1, 1)):
        law.fpids(alive, robots, joints, ops, poles, modes, grid, row, torque)
        seen.append(joints[0, 0].copy())
    return np.array(seen)


def test_a_tick_uses_and_moves_the_orders_of_its_joint():
    seen = ticked(12)
    e, lam, mu = seen["e"], seen["lam"], seen["mu"]
    # At t = 0 there is no slope yet, and after it none of a sample before: two ticks stand still.
    assert (lam[1:3] == 0.7).all()
    assert (np.diff(lam[2:]) != 0.0).all()
    assert (np.diff(mu[2:]) != 0.0).all()
    i_e, _ = streamed(1.0 - lam, seen["int_e"], e)
    d_e, _ = streamed(mu, e, seen["e_dot"])
    assert seen["i_e"] == pytest.approx(i_e, rel=1e-12)
    assert seen["d_e"] == pytest.approx(d_e, rel=1e-12)


def test_orders_are_held_with_the_integral_where_the_torque_is_cut_or_a_supervisor_acts():
    cut = ticked(12, limit=1e-3)
    held = (np.sign(cut["cut"]) == -np.sign(cut["s"]))[:-1]
    assert held.any()
    assert not held.all()
    for name in ("lam", "mu"):
        assert (np.diff(cut[name])[held] == 0.0).all()
        assert (np.diff(cut[name])[3:][~held[3:]] != 0.0).all()
    acted = ticked(12, threshold=-1.0)
    assert (acted["lam"] == acted["lam"][0]).all()
    assert (acted["i_e"] == acted["i_e"][0]).all()
