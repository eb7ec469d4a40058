import math

import exact_derivatives as exact
import numpy as np
import pytest
from scipy.special import gamma

from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import (
    L1,
    Bank,
    Crone,
    ExponentialSum,
    GrunwaldLetnikov,
    RefinedOustaloup,
    frequency_response,
    kernel_error,
    noise_gains,
    report,
)

STEP = 1e-3
ALL = [
    ExponentialSum(24),
    Crone(0.1, 1e3, 4),
    RefinedOustaloup(0.1, 1e3, 4),
    GrunwaldLetnikov(),
    GrunwaldLetnikov(memory=0.2),
    L1(),
    L1(memory=0.2),
]


@pytest.mark.parametrize("design", ALL, ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
def test_the_frequency_response_is_what_a_sinusoid_settles_to(design, rule):
    order, omega, samples = np.array([0.0, 0.3, 0.9, 1.0]), 2 * np.pi * 20.0, 3001
    t = np.arange(samples) * STEP
    bank = Bank(design, order, step=STEP, horizon=3.0, rate=rule)
    columns = np.ones(4)
    value = np.multiply.outer(np.sin(omega * t), columns)
    rate = omega * np.multiply.outer(np.cos(omega * t), columns)
    out = exact.stream(bank, value, rate if rule == "measured" else None)
    tail = slice(2000, 3000)  # twenty whole periods
    got = 2j * (out[tail] * np.exp(-1j * omega * t[tail])[:, None]).mean(axis=0)
    want = frequency_response(design, order, omega, step=STEP, horizon=3.0, rate=rule)[0]
    # What is left of the start at order 0.3 decays like t^-1.3.
    assert np.abs(got / want - 1).max() < 2e-4


def test_the_response_of_full_memory_rules_is_that_of_a_very_long_one():
    order, omega = np.array([0.5, 0.9]), np.array([20.0, 400.0, math.pi / STEP])
    for rule in (GrunwaldLetnikov, L1):
        got = frequency_response(rule(), order, omega, step=STEP, horizon=1e4)
        want = frequency_response(rule(memory=300.0), order, omega, step=STEP, horizon=1e4)
        assert np.abs(got / want - 1).max() < 0.02


@pytest.mark.parametrize("order", [0.05, 0.5, 0.95])
def test_the_default_design_is_close_to_the_exact_operator_in_band(order):
    omega = np.geomspace(5.0, 300.0, 40)
    got = frequency_response(ExponentialSum(32), order, omega, step=STEP, horizon=20.0)
    assert np.abs(got / (1j * omega) ** order - 1).max() < 1e-4


@pytest.mark.parametrize("design", [*ALL[:3], GrunwaldLetnikov(), L1()], ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
def test_the_stated_output_noise_is_what_a_simulation_shows(design, rule):
    order = np.array([0.0, 0.3, 0.7, 0.95, 1.0])
    rng = np.random.default_rng(11)
    channels, samples = 80, 400
    shape = (5, channels)
    wide = np.broadcast_to(order[:, None], shape)
    stated = noise_gains(design, order, step=STEP, horizon=samples * STEP, rate=rule)
    for source, gain in enumerate(stated):
        if source == 1 and rule == "differenced":
            assert not gain.any()
            continue
        bank = Bank(design, wide, step=STEP, horizon=samples * STEP, rate=rule)
        value, rate = np.zeros(shape), np.zeros(shape)
        kept = []
        for k in range(samples):
            noise = rng.normal(size=shape) if k else np.zeros(shape)
            (value, rate)[source][...] = noise
            out = bank.update(value, rate if rule == "measured" else None)
            if k > samples - 100:
                kept.append(out.copy())
        found = np.std(kept, axis=(0, 2))
        assert np.allclose(found, gain, rtol=0.04, atol=1e-9)


@pytest.mark.parametrize("design", ALL[:3], ids=repr)
def test_the_nyquist_gain_is_the_output_for_an_alternating_rate(design):
    order = np.array([0.0, 0.5, 0.93, 1.0])
    stated = report(design, order, step=STEP, horizon=5.0).nyquist_gain
    bank = Bank(design, order, step=STEP, horizon=5.0)
    for k in range(5000):
        out = bank.update(np.zeros(4), np.full(4, (-1.0) ** k))
    assert np.allclose(np.abs(out), stated, rtol=1e-3, atol=1e-9)
    assert stated[-1] == 1.0
    assert stated[0] == 0.0


@pytest.mark.parametrize("order", [0.3, 0.8])
def test_the_kernel_is_the_response_to_a_step(order):
    lags = np.arange(1, 300) * STEP
    value = np.ones(300)
    for design in (ExponentialSum(24), Crone(0.1, 1e3, 4), GrunwaldLetnikov()):
        bank = Bank(
            design,
            order,
            step=STEP,
            horizon=1.0,
            initialisation="grunwald_letnikov",
            rate="differenced",
        )
        got = exact.stream(bank, value)[1:]
        want = lags**-order / gamma(1 - order)
        error = kernel_error(design, order, lags, step=STEP, horizon=1.0)
        assert np.abs(got / want - 1 - error).max() < 1e-9


@pytest.mark.parametrize("design", [ExponentialSum(12), Crone(0.1, 1e3, 3)], ids=repr)
def test_no_output_is_further_off_than_the_stated_bound(design):
    """The worst signal for a kernel error is the one whose rate follows the error's sign."""
    order, horizon = 0.6, 2.0
    bound = report(design, order, step=STEP, horizon=horizon).error_bound[0]
    t = np.arange(round(horizon / STEP) + 1) * STEP
    lag = np.maximum(t[-1] - t, 1e-9)
    sign = np.sign(kernel_error(design, order, lag, step=STEP, horizon=horizon))
    rate = np.where(sign == 0.0, 1.0, sign)
    # Piecewise constant rates: the rule between samples adds nothing with the value alone.
    value = np.concatenate([[0.0], np.cumsum(rate[1:] * STEP)])
    best, rough = (
        exact.stream(Bank(d, order, step=STEP, horizon=horizon, rate="differenced"), value)[-1]
        for d in (ExponentialSum(40), design)
    )
    assert 0.3 * bound < abs(rough - best) < bound * 1.01


@pytest.mark.parametrize("design", ALL, ids=repr)
def test_a_report_prints_a_row_for_each_order(design):
    found = report(design, [0.0, 0.5, 1.0], step=STEP, horizon=3.0)
    text = str(found)
    lines = text.splitlines()
    assert len(lines) == 8
    assert len({len(line) for line in lines[3:]}) == 1
    assert repr(design) in text
    assert found.order.tolist() == [0.0, 0.5, 1.0]
    # Orders 0 and 1 are exact.
    assert found.magnitude_error[[0, 2]].max() < 1e-12
    assert found.kernel_error[[0, 2]].max() == 0.0
    assert all(seconds > 0 for seconds in found.cost)


def test_a_report_says_where_the_design_can_be_trusted():
    trusted = report(ExponentialSum(24), [0.2, 0.8], step=STEP, horizon=20.0)
    assert (trusted.longest_horizon > 20.0).all()
    for k, order in enumerate(trusted.order):
        inside = np.geomspace(trusted.lowest_frequency[k], trusted.highest_frequency[k], 50)[1:-1]
        found = frequency_response(trusted.design, order, inside, step=STEP, horizon=20.0)
        assert np.abs(found / (1j * inside) ** order - 1).max() < 0.011
    narrow = report(Crone(1.0, 10.0, 1), 0.5, step=STEP, horizon=20.0)
    assert np.isnan(narrow.longest_horizon).all()


def test_a_report_draws_itself(tmp_path):
    path = tmp_path / "report.png"
    report(ExponentialSum(12), [0.3, 0.7], step=STEP, horizon=2.0).plot(path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_frequencies_above_nyquist_are_refused():
    with pytest.raises(ArgumentError, match="frequency: expected a number in"):
        frequency_response(ExponentialSum(), 0.5, 4000.0, step=STEP, horizon=1.0)
