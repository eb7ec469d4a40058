"""The operator's kernels against closed forms, on records short enough to run line by line."""

import mpmath as mp
import numpy as np
import pytest

from fpid_pin.fractional import Crone, ExponentialSum
from fpid_pin.kernels.operator import record, sample

pytestmark = pytest.mark.kernels

STEP, SAMPLES = 0.01, 60
T = np.arange(SAMPLES) * STEP
DESIGN = ExponentialSum(32)


def started(order, initialisation="caputo", design=DESIGN):
    order = np.atleast_1d(np.asarray(order, dtype=np.float64))
    modes = design.coefficients(order, step=STEP, horizon=SAMPLES * STEP)
    return modes.records(initialisation)


def recorded(order, f, rate, initialisation="caputo", design=DESIGN, differenced=False):
    """The kernel over one signal, (N,), for each order: (N, orders)."""
    records = started(order, initialisation, design)
    f, rate = (np.repeat(x[:, None], records.ops.size, axis=1) for x in (f, rate))
    last = rate if differenced else np.concatenate([rate[:1], rate[:-1]])
    out = np.empty_like(f)
    record(*records, f, rate, last, out, STEP)
    return out


def of_power(order, power):
    """Gamma(b + 1)/Gamma(b + 1 - a) t^(b - a) without t = 0."""
    b, a = mp.mpf(power), mp.mpf(order)
    return np.array(
        [float(mp.gamma(b + 1) / mp.gamma(b + 1 - a) * mp.mpf(t) ** (b - a)) for t in T[1:]]
    )


def of_sin(order, w):
    """w t^(1 - a) E_(2, 2 - a)(-(w t)^2), the Mittag-Leffler series."""
    a = mp.mpf(order)

    def value(t):
        series = mp.nsum(
            lambda k: (-1) ** int(k) * (w * t) ** (2 * k) / mp.gamma(2 * k + 2 - a), [0, 40]
        )
        return float(w * mp.mpf(t) ** (1 - a) * series)

    return np.array([value(t) for t in T[1:]])


@pytest.mark.parametrize("order", [0.1, 0.5, 0.9])
def test_smooth_signals_have_their_derivatives(order):
    w = 3.0
    for f, rate, truth, limit in (
        (np.sin(w * T), w * np.cos(w * T), of_sin(order, w), 1e-6),
        (T, np.ones(SAMPLES), of_power(order, 1), 1e-8),
        (T**2, 2.0 * T, of_power(order, 2), 1e-8),
        (T**3, 3.0 * T**2, of_power(order, 3), 1e-8),
    ):
        got = recorded(order, f, rate)[:, 0]
        assert got[0] == 0.0
        assert np.abs(got[1:] - truth).max() < limit * np.abs(truth).max()


def test_a_rate_that_is_singular_in_its_slope_costs_the_first_samples_only():
    order = 0.5
    got, truth = recorded(order, T**1.5, 1.5 * np.sqrt(T))[1:, 0], of_power(order, 1.5)
    error = np.abs(got - truth) / truth.max()
    assert error.max() < 1e-3
    assert error[20:].max() < 1e-5


@pytest.mark.parametrize("initialisation", ["caputo", "riemann_liouville", "grunwald_letnikov"])
def test_orders_0_and_1_are_the_signal_and_its_rate(initialisation):
    f, rate = np.cos(5.0 * T), -5.0 * np.sin(5.0 * T)
    out = recorded([0.0, 1.0], f, rate, initialisation)
    assert (out[:, 0] == f).all()
    assert (out[:, 1] == rate).all()


@pytest.mark.parametrize("order", [0.2, 0.7])
def test_what_was_before_the_start_is_as_the_initialisation_says(order):
    """A constant: nothing, or the step response t^-a/Gamma(1 - a) with or without its kick."""
    f, rate = np.full(SAMPLES, 2.0), np.zeros(SAMPLES)
    jump = np.array([float(2 * mp.mpf(t) ** -order * mp.rgamma(1 - order)) for t in T[1:]])
    assert not recorded(order, f, rate).any()
    rest = recorded(order, f, rate, "riemann_liouville")[:, 0]
    kicked = recorded(order, f, rate, "grunwald_letnikov")[:, 0]
    assert rest[0] == 0.0
    assert kicked[0] == pytest.approx(2.0 * STEP**-order, rel=1e-12)
    assert np.abs(rest[1:] / jump - 1.0).max() < 1e-8
    assert (kicked[1:] == rest[1:]).all()


def test_a_filter_at_rest_answers_a_step_with_its_own_step_response():
    """Poles of one's own: H(s)/s as partial fractions, at t = 0 its gain at high frequencies."""
    design = Crone(0.1, 100.0, 2)
    got = recorded([0.3, 0.8], np.ones(SAMPLES), np.zeros(SAMPLES), "grunwald_letnikov", design)
    for column, order in enumerate((0.3, 0.8)):
        zeros, poles, gain = design.zpk(order)
        total = np.full(SAMPLES, gain * np.prod(zeros / poles))
        for p in poles:
            others = np.prod(p - poles[poles != p])
            total += gain * np.prod(p - zeros) / (p * others) * np.exp(p * T)
        assert got[:, column] == pytest.approx(total, rel=1e-9)


def test_a_rate_that_is_constant_over_a_step_is_the_l1_rule():
    order = 0.6
    f = np.random.default_rng(1).normal(size=SAMPLES).cumsum()
    change = np.diff(f, prepend=f[0])
    got = recorded(order, f, change / STEP, differenced=True)[:, 0]
    j = np.arange(SAMPLES)
    weights = ((j + 1.0) ** (1 - order) - j ** (1 - order)) * STEP**-order
    weights *= float(mp.rgamma(2 - order))
    want = np.convolve(change, weights)[:SAMPLES]
    assert np.abs(got - want).max() < 1e-8 * np.abs(want).max()


def streamed(records, f, rate, holds):
    """The kernel `sample` over signals (N, channels), and what it took for the last sample."""
    channels = records.ops.size
    f_, rate_, y = np.zeros((3, channels))
    out = np.empty_like(f)
    for k in range(len(f)):
        sample(k > 0, *records, f[k], f_, rate[k], rate_, holds[k], y, STEP)
        assert (f_ == f[k]).all()
        assert (rate_ == rate[k]).all()
        out[k] = y
    return out


def test_sample_by_sample_is_the_whole_record_bit_by_bit():
    order = np.array([0.0, 0.2, 0.7, 1.0])
    f, rate = np.sin(4.0 * T) + 0.5, 4.0 * np.cos(4.0 * T)
    for initialisation in ("caputo", "grunwald_letnikov"):
        want = recorded(order, f, rate, initialisation)
        signals = (np.repeat(x[:, None], 4, axis=1) for x in (f, rate))
        got = streamed(started(order, initialisation), *signals, np.zeros((SAMPLES, 4), dtype=bool))
        assert (got == want).all()


def test_a_held_channel_stands_still_and_forgets_what_passed_meanwhile():
    """It goes on as one that never saw those samples; its neighbour does not notice."""
    order, first, last = np.array([0.4, 0.4]), 20, 32
    f, rate = np.exp(-T) * np.sin(9.0 * T), np.ones(SAMPLES)
    holds = np.zeros((SAMPLES, 2), dtype=bool)
    holds[first:last, 0] = True
    # The value returns to where it was when the hold began, the rate does not.
    f[last - 1], rate[first - 1 : last] = f[first - 1], np.linspace(1.0, 3.0, last - first + 1)
    rate[last - 1] = rate[first - 1]
    both = (np.repeat(x[:, None], 2, axis=1) for x in (f, rate))
    got = streamed(started(order), *both, holds)
    assert (got[first:last, 0] == got[first - 1, 0]).all()
    assert (got[:, 1] == recorded(0.4, f, rate)[:, 0]).all()
    keep = np.r_[:first, last:SAMPLES]
    assert (got[keep, 0] == recorded(0.4, f[keep], rate[keep])[:, 0]).all()
