"""Operators whose order varies, and a law's integrals, against closed forms; short enough to run
line by line. Operators of a fixed order are in tests/fractional/test_bank.py.
"""

from functools import cache

import mpmath as mp
import numpy as np
import pytest

from fpid_pin.fractional import ExponentialSum
from fpid_pin.kernels.operator import (
    advance_operator,
    initialise,
    variable_order_derivative,
)
from fpid_pin.kernels.records import INTEGRAL

pytestmark = pytest.mark.kernels

STEP, SAMPLES = 0.01, 60
T = np.arange(SAMPLES) * STEP
DESIGN = ExponentialSum(32)


def started(order, initialisation="caputo"):
    modes = DESIGN.coefficients([order], step=STEP, horizon=SAMPLES * STEP)
    return modes.records(initialisation)


NODES = 201


@cache
def table():
    orders = np.linspace(0.0, 1.0, NODES)
    return DESIGN.coefficients(orders, step=STEP, horizon=SAMPLES * STEP).table()


def varied(orders, f, rate, initialisation="caputo"):
    """Values and sensitivities of one operator whose order is orders[k] at sample k, (N,) each."""
    grid = table()
    op, poles, modes = (array[0] for array in started(orders[0], initialisation))
    y, slope = np.zeros((2, len(f)))
    y[0] = initialise(op, modes, f[0], rate[0])
    for k in range(1, len(f)):
        op.order = orders[k]
        y[k] = variable_order_derivative(
            op, grid, poles, modes, f[k], f[k - 1], rate[k], rate[k - 1], STEP
        )
        assert op.previous_sensitivity == slope[k - 1]
        slope[k] = op.sensitivity
    return y, slope


def test_an_order_that_falls_to_0_tends_to_caputo_s_limit():
    f, rate = np.cos(5.0 * T), -5.0 * np.sin(5.0 * T)
    y, _ = varied(np.concatenate([[0.3], np.zeros(SAMPLES - 1)]), f, rate)
    assert np.abs(y - (f - f[0])).max() < 1e-13
    y, _ = varied(np.zeros(SAMPLES), f, rate, "riemann_liouville")
    assert np.abs(y - f).max() < 1e-13


def test_an_order_moved_back_and_forth_gives_what_one_that_was_always_there_gives():
    """The modes know nothing of the order: not a bit is left of where it has been."""
    rng = np.random.default_rng(3)
    f, rate = np.sin(7.0 * T) + 0.3, 7.0 * np.cos(7.0 * T)
    wandered = np.clip(0.6 + np.cumsum(rng.normal(0.0, 0.2, SAMPLES)), 0.0, 1.0)
    wandered[0], wandered[40:] = 0.6, 0.6
    moved, was = (varied(orders, f, rate) for orders in (wandered, np.full(SAMPLES, 0.6)))
    assert (moved[0][40:] == was[0][40:]).all()
    assert (moved[1][40:] == was[1][40:]).all()
    assert (moved[0][1:40] != was[0][1:40]).any()


@pytest.mark.parametrize("cell", [0, 1, 2, 9, 17, 18, 19])
def test_between_nodes_it_is_the_cubic_through_the_four_around_it(cell):
    """Four in the middle of which the order lies, or the last ones: by NumPy's polynomials."""
    nodes, columns = np.linspace(0.0, 1.0, 21), np.random.default_rng(4).normal(size=(3, 21))
    op, poles, modes = (array[0] for array in started(0.5))
    first = min(max(cell - 1, 0), 17)
    for op.order in (nodes[cell] + np.array([0.1, 0.5, 0.9]) / 20.0).tolist():
        y = variable_order_derivative(op, columns, poles[:0], modes[:0], 0.3, 0.7, 2.0, 3.0, STEP)
        weighted = np.array([2.0, 3.0, -0.4 / STEP - 2.5]) @ columns
        around = slice(first, first + 4)
        cubic = np.polynomial.Polynomial.fit(nodes[around], weighted[around], 3)
        assert y == pytest.approx(cubic(op.order), rel=1e-10)
        assert op.sensitivity == pytest.approx(cubic.deriv()(op.order), rel=1e-10)


#: Columns of a law's numbers here: a signal, the order, the output, its derivative.
SIGNAL, ORDER, OUTPUT, BY_ORDER = range(4)


def integrated(f, order, *, held=None, varies=False):
    """I^order of a signal and its derivative by the order, tick by tick, (N,) each."""
    op, poles, modes = (array[0] for array in started(1.0 - order))
    op.kind, op.source, op.output, op.sign = INTEGRAL, SIGNAL, OUTPUT, 1.0
    op.variable, op.order_column = varies, ORDER if varies else -1
    numbers, grid, found = np.zeros(4), table(), []
    for k in range(SAMPLES):
        numbers[SIGNAL], numbers[ORDER] = f[k], order
        stays = held is not None and held[k]
        advance_operator(op, grid, poles, modes, numbers, k > 0, stays, 0.0, STEP)
        found.append(numbers[[OUTPUT, BY_ORDER]])
    return np.array(found).T


def test_an_integral_of_order_1_is_the_trapezoidal_sum_of_what_was_not_held():
    f = np.random.default_rng(5).normal(size=SAMPLES) + 2.0
    held = np.isin(np.arange(SAMPLES), (0, 10, 11, 30))
    grows = STEP / 2 * (f[1:] + f[:-1]) * ~held[1:]
    truth = np.concatenate([[0.0], np.cumsum(grows)])
    assert integrated(f, 1.0, held=held)[0] == pytest.approx(truth, rel=1e-13)


def test_what_an_integral_changes_by_its_order_is_a_difference_of_two_orders_a_sample_late():
    one, gap = np.ones(SAMPLES), 1e-4
    values, by_order = integrated(one, 0.6, varies=True)
    more, less = (integrated(one, 0.6 + d, varies=True)[0] for d in (gap, -gap))
    assert by_order[2:] == pytest.approx((more - less)[1:-1] / (2.0 * gap), rel=1e-4)
    assert values[1:] == pytest.approx(T[1:] ** 0.6 * float(mp.rgamma(1.6)), rel=1e-6)
