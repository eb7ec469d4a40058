"""Fractional operators of a law of one's own: against closed forms and sums over the whole past.

With 40 modes the kernel is within 1e-11; 24, the default, leave 6e-7.
"""

import math

import by_hand
import numpy as np
import pytest
from own_laws import Many, own
from scipy.special import digamma, gamma

import fpid_pin as fp
from fpid_pin.control.law import Derivative, Integral

STEP, ROWS = 1e-3, 400
ARM = fp.Arm.two_link().with_limits(effort=np.inf)
T = STEP * np.arange(ROWS)


def rows_of(e, rate):
    """Return q, v, q_ref, v_ref of each tick for errors and their rates, (rows, 2)."""
    still = np.zeros_like(e)
    return np.stack([-e, -rate, still, still], axis=1)


def signals_of(loop, rows, names):
    """Return what a loop's joints hold after each tick, by name, (rows, n)."""
    kept = {name: [] for name in names}
    for row in rows:
        loop.torque(*row)
        for name in names:
            kept[name].append(np.array(loop.state.joints[name]))
    return {name: np.array(values) for name, values in kept.items()}


def parabola(order, t=T):
    """Return D^order t^2, whose rate is straight: no rule between samples is wrong by anything."""
    return 2.0 * t ** (2.0 - order) / gamma(3.0 - order)


def off(got, expected):
    return np.abs(got - expected).max() / np.abs(expected).max()


def test_several_operators_of_one_signal_are_the_closed_forms():
    e = np.outer(T**2, [1.0, -3.0])
    loop = Many().start(ARM, step=STEP, horizon=1.0)
    found = signals_of(loop, rows_of(e, np.outer(2.0 * T, [1.0, -3.0])), ("d_e", "half", "i_e"))
    sizes = np.array([1.0, -3.0])
    assert off(found["d_e"], sizes * np.stack([parabola(0.7), parabola(0.9)], axis=1)) < 1e-9
    assert off(found["half"], np.outer(parabola(0.5), sizes)) < 1e-9
    # int t^2 is a cubic, whose rate the rule takes for what it is: a parabola.
    exact = 2.0 * T**2.6 / math.gamma(3.6)
    assert off(found["i_e"], np.outer(exact, sizes)) < 1e-9


def test_operators_of_the_surface_and_of_what_is_remembered_are_sums_over_the_whole_past():
    """Their rate is not known: straight between samples, as L1 and the trapezoidal rule are."""
    rng = np.random.default_rng(0)
    e = 0.2 * np.sin(np.outer(T, [9.0, 17.0])) + 0.1
    rate = 0.2 * np.cos(np.outer(T, [9.0, 17.0])) * [9.0, 17.0] + 0.05 * rng.normal(size=(ROWS, 2))
    loop = Many().start(ARM, step=STEP, horizon=1.0)
    found = signals_of(loop, rows_of(e, rate), ("s", "half", "slow", "i_s", "d_s", "d_slow"))
    assert np.array_equal(found["s"], -(rate + 2.0 * found["half"]))
    integral = by_hand.PiecewiseLinear(0.4, STEP, ROWS)
    assert off(found["i_s"], [integral(s) for s in found["s"]]) < 1e-9
    for name, order, signal in (("d_s", 0.6, "s"), ("d_slow", 0.3, "slow")):
        derivative = by_hand.L1(order, STEP, ROWS)
        assert off(found[name], [derivative(x) for x in found[signal]]) < 1e-9


@pytest.mark.parametrize("sign", [1, -1])
def test_an_integral_is_held_while_the_torque_is_cut_and_it_would_push_further(sign):
    """The torque is -S's integral, so S pushes downwards: sign = -1 says so."""

    def surface(c):
        c.s = -(c.e_dot + 2.0 * c.e)

    law = own(
        lambda c: 5.0 * c.e - c.i_s, surface=surface,
        operators={"i_s": Integral(0.5, of="s", sign=sign)},
    )  # fmt: skip
    loop = law.start(ARM.with_limits(effort=2.0), step=STEP)
    e = np.outer(np.sin(40.0 * T), [1.0, -0.8])
    rows = rows_of(e, 40.0 * np.outer(np.cos(40.0 * T), [1.0, -0.8]))
    found = signals_of(loop, rows, ("s", "i_s", "cut"))
    stays = np.diff(found["i_s"], axis=0) == 0.0
    # What was cut in the tick before counts.
    held = found["cut"][:-1] * sign * found["s"][1:] > 0.0
    assert np.array_equal(stays, held)
    assert 20 < held.sum() < held.size - 20


def test_an_order_that_adapts_and_its_slope_are_the_closed_forms():
    """The output is that of the operator that always had the order; its slope is a sample old."""

    def adapt(c):
        c.mu += c.h * c.pace

    law = own(
        lambda c: c.d_e, adapt=adapt, operators={"d_e": Derivative("mu", adapts=True)},
        numbers=lambda self, arm, step, horizon: {"mu": (0.3, 0.9), "pace": (1.0, -0.7)},
    )  # fmt: skip
    loop = law.start(ARM, step=STEP, horizon=1.0)
    e, rate = np.outer(T**2, [1.0, 1.0]), np.outer(2.0 * T, [1.0, 1.0])
    found = signals_of(loop, rows_of(e, rate), ("mu", "d_e", "d_e_by_order"))
    mu = found["mu"]
    assert mu[-1] == pytest.approx([0.3 + 0.399, 0.9 - 0.7 * 0.399])
    t = T[1:, np.newaxis]
    value = parabola(mu[1:], t)
    assert off(found["d_e"][1:], value) < 2e-6
    slope = value * (digamma(3.0 - mu[1:]) - np.log(t))
    assert off(found["d_e_by_order"][2:], slope[:-1]) < 2e-4


def test_a_caputo_derivative_alone_is_at_rest_at_the_error_that_it_began_with():
    """What CONTRIBUTING warns of: D^mu of a constant is 0, unless the error came from 0."""

    def torque(c):
        return 20.0 * c.d_e + 20.0 * c.e_dot

    still = fp.Experiment(ARM, fp.references.Hold((0.5, 0.5)), q0=(0.2, 0.7), duration=3.0)
    ends = []
    for start in ("caputo", "grunwald_letnikov"):
        operators = {"d_e": Derivative(0.3)}
        law = own(torque, operators=operators, initialisation=start, uses_model=True)
        ends.append(fp.simulate(still, law).error)
    assert np.abs(ends[0] - [0.3, -0.2]).max() < 1e-12
    assert np.abs(ends[1][-1]).max() < 0.5 * 0.2
