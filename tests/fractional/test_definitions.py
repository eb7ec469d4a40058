from functools import partial

import exact_derivatives as exact
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import binom, gamma

from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import (
    L1,
    GrunwaldLetnikov,
    caputo,
    grunwald_letnikov,
    riemann_liouville,
)

STEP = 0.01
T = np.arange(400) * STEP
SIGNAL, RATE = np.sin(3 * T) + 0.7, 3 * np.cos(3 * T)


@pytest.mark.parametrize("order", [0.2, 0.5, 0.9])
def test_the_rules_are_the_sums_as_printed(order):
    j = np.arange(T.size)
    weights = (-1.0) ** j * binom(order, j) * STEP**-order
    want = [weights[: k + 1] @ SIGNAL[k::-1] for k in range(T.size)]
    assert np.abs(grunwald_letnikov(SIGNAL, order, STEP) - want).max() < 1e-9 * np.abs(want).max()

    lifted = caputo(SIGNAL, order, STEP, design=GrunwaldLetnikov())
    assert np.array_equal(lifted, grunwald_letnikov(SIGNAL - SIGNAL[0], order, STEP))

    weights = ((j + 1.0) ** (1 - order) - j ** (1 - order)) * STEP**-order / gamma(2 - order)
    want = [0.0] + [weights[: k + 1] @ np.diff(SIGNAL)[k::-1] for k in range(T.size - 1)]
    got = caputo(SIGNAL, order, STEP, design=L1())
    assert np.abs(got - want).max() < 1e-10

    start = SIGNAL[0] * T[1:] ** -order / gamma(1 - order)
    both = riemann_liouville(SIGNAL, order, STEP, design=L1())
    assert np.abs(both[1:] - got[1:] - start).max() < 1e-10
    assert both[0] == 0.0


@pytest.mark.parametrize(
    ("function", "truth", "everywhere", "later"),
    # Smooth at 0; nearly; and with a rate that is singular there, which stays limited.
    [
        (np.sin, exact.of_sin, 1e-9, 1e-9),
        (lambda t: t**2.3, partial(exact.of_power, power=2.3), 1e-7, 1e-9),
        (lambda t: t**1.2, partial(exact.of_power, power=1.2), 1e-3, 1e-9),
        (np.sqrt, partial(exact.of_power, power=0.5), 0.2, 1e-7),
    ],
    ids=["sin t", "t^2.3", "t^1.2", "t^0.5"],
)
def test_without_a_rate_a_recorded_signal_is_taken_for_a_smooth_one(
    function, truth, everywhere, later
):
    order, t = 0.87, np.arange(20001) * 1e-3
    checked = np.r_[1:30, np.geomspace(30, 20000, 20).astype(int)]
    want = exact.table(truth, [order], t[checked])[:, 0]
    error = np.abs(caputo(function(t), order, 1e-3)[checked] - want) / np.abs(want).max()
    assert error.max() < everywhere
    assert error[t[checked] > 1.0].max() < later
    jump = riemann_liouville(function(t) + 2.0, order, 1e-3)[checked]
    jump -= 2.0 * t[checked] ** -order / gamma(1 - order)
    assert np.abs(jump - want)[checked > 1000].max() < later * np.abs(want).max()


@pytest.mark.parametrize("samples", [2, 3, 4, 5, 6, 7])
def test_short_records_of_polynomials_have_their_rates(samples):
    t = np.arange(samples) * STEP
    power = min(samples - 1, 5)
    want = [exact.of_power(0.5, x, power) if x else 0.0 for x in t]
    got = caputo(t**power, 0.5, STEP)
    known = caputo(t**power, 0.5, STEP, rate=power * t ** (power - 1.0))
    assert np.abs(got - known).max() < 1e-11 * np.abs(want).max()
    if power <= 3:
        assert np.abs(got - want).max() < 1e-9 * np.abs(want).max()


@pytest.mark.parametrize(("order", "gain"), [(0.2, 1.06), (0.5, 1.16), (0.87, 1.28)])
def test_noise_passes_as_the_docstring_says_and_less_than_by_l1(order, gain):
    noise = np.random.default_rng(0).normal(size=(20001, 4))
    ours, l1 = (
        caputo(noise, order, 1e-3, axis=0, design=design)[1000:-50].std() * 1e-3**order
        for design in (None, L1())
    )
    assert abs(ours - gain) < 0.02
    assert ours < l1


@pytest.mark.parametrize("function", [caputo, riemann_liouville, grunwald_letnikov])
def test_any_axis_an_order_for_each_channel_and_exact_ends(function):
    rng = np.random.default_rng(3)
    signal = rng.normal(size=(3, 50, 2)).cumsum(axis=1)
    order = rng.uniform(0, 1, (3, 2))
    got = function(signal, order, STEP, axis=1)
    assert got.shape == signal.shape
    for i, j in np.ndindex(3, 2):
        alone = function(signal[i, :, j], order[i, j], STEP)
        assert np.abs(got[i, :, j] - alone).max() < 1e-9
    assert np.array_equal(function(SIGNAL, 0.0, STEP), SIGNAL)
    assert np.array_equal(function(SIGNAL, 0.0, STEP, rate=RATE), SIGNAL)
    assert np.array_equal(function(SIGNAL, 1.0, STEP, rate=RATE), RATE)
    rule = None if function is grunwald_letnikov else L1()
    difference = function(SIGNAL, 1.0, STEP, design=rule)[1:]
    assert np.abs(difference - np.diff(SIGNAL) / STEP).max() < 1e-10
    if rule is not None:  # else by the spline
        assert np.abs(function(SIGNAL, 1.0, STEP) - RATE).max() < 1e-6


@settings(max_examples=25)
@given(st.floats(0, 1), st.floats(-5, 5), st.integers(0, 100))
def test_a_constant_has_no_caputo_derivative(order, constant, seed):
    noise = np.random.default_rng(seed).normal(size=60)
    a, b = caputo(noise, order, STEP), caputo(noise + constant, order, STEP)
    want = constant if order == 0.0 else 0.0
    assert np.abs(b - a - want).max() < 1e-10


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"signal": np.r_[np.ones(17), np.nan, 1.0]}, r"signal\.17: expected .*finite, got nan"),
        ({"signal": [[1.0, 2.0], [0.0, np.inf]]}, r"signal\.1\.1: expected .*finite, got inf"),
        ({"rate": np.r_[np.ones(399), np.nan]}, r"rate\.399: expected .*finite, got nan"),
        ({"rate": np.ones(7)}, r"rate: expected shape \(400,\), got shape \(7,\)"),
        ({"signal": [1.0]}, "signal: expected at least 2 samples, got 1"),
        ({"signal": "abc"}, "signal: expected numbers"),
        ({"order": 1.01}, r"order: expected a number in \[0, 1\], got 1.01"),
        ({"order": [0.1, 0.2]}, r"order: expected a shape that broadcasts to \(\)"),
        ({"step": -1.0}, "step: expected a number > 0"),
        ({"axis": 3}, "axis: expected an axis of signal"),
        ({"initialisation": "zero"}, "initialisation: expected one of caputo"),
        ({"design": 3}, "design: expected a Design, got int"),
    ],
)
def test_bad_input_says_what_and_where(arguments, words):
    for function in (caputo, riemann_liouville, grunwald_letnikov):
        given = {"signal": SIGNAL, "order": 0.5, "step": STEP} | arguments
        with pytest.raises(ArgumentError, match=words):
            function(given.pop("signal"), given.pop("order"), given.pop("step"), **given)
