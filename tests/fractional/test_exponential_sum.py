import tracemalloc

import exact_derivatives as exact
import numpy as np
import pytest
from scipy.special import gamma

from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional import Bank, ExponentialSum, kernel_error
from fpid_pin.fractional.recorded import run_modes

STEP, HORIZON = 1e-3, 20.0
ORDERS = np.round(np.arange(1, 20) / 20, 2)
SAMPLES = 20001
CHECKED = np.unique(
    np.concatenate([np.arange(1, 12), np.geomspace(12, SAMPLES - 1, 14).astype(int)])
)
SIGNALS = {
    "sin": (np.sin, np.cos, exact.of_sin),
    "exp": (lambda t: np.exp(-t), lambda t: -np.exp(-t), exact.of_exp),
    "t^1.5": (
        lambda t: t**1.5,
        lambda t: 1.5 * np.sqrt(t),
        lambda a, t: exact.of_power(a, t, 1.5),
    ),
    "t^2": (lambda t: t * t, lambda t: 2.0 * t, lambda a, t: exact.of_power(a, t, 2)),
}


@pytest.fixture(scope="module")
def truth():
    times = CHECKED * STEP
    return {name: exact.table(s[2], ORDERS, times) for name, s in SIGNALS.items()}


def _streamed(design):
    t = np.arange(SAMPLES) * STEP
    one = np.ones(ORDERS.size)
    value = np.stack([np.multiply.outer(s[0](t), one) for s in SIGNALS.values()], axis=1)
    rate = np.stack([np.multiply.outer(s[1](t), one) for s in SIGNALS.values()], axis=1)
    order = np.broadcast_to(ORDERS, value.shape[1:])
    bank = Bank(design, order, step=STEP, horizon=HORIZON)
    return exact.stream(bank, value, rate)[CHECKED]


@pytest.mark.parametrize(
    ("modes", "smooth", "square"), [(24, 5e-7, 1e-6), (32, 2e-9, 1e-8), (40, 1e-11, 1e-11)]
)
def test_streaming_with_known_rate_meets_its_accuracy_for_all_orders(truth, modes, smooth, square):
    streamed = _streamed(ExponentialSum(modes))
    limits = {"sin": smooth, "exp": smooth, "t^1.5": 1e-4, "t^2": square}
    for index, (name, limit) in enumerate(limits.items()):
        scale = np.abs(truth[name]).max(axis=0)
        error = np.abs(streamed[:, index] - truth[name]) / scale
        assert error.max() < limit, (name, error.max())
        if name == "t^1.5":
            assert error[CHECKED >= 10].max() < 1e-5


def test_one_hour_at_a_millisecond_is_within_1e_minus_6_with_32_modes():
    order = np.array([0.9])
    t = np.arange(3_600_001) * STEP
    value, rate = np.sin(t)[:, None], np.cos(t)[:, None]
    checked = np.geomspace(1, t.size - 1, 25).astype(int)
    got = run_modes(ExponentialSum(32), order, value, rate, step=STEP, horizon=3600.0)[checked]
    want = exact.table(exact.of_sin, order, t[checked])
    assert np.abs(got - want).max() < 1e-6


def test_memory_does_not_depend_on_the_horizon():
    order = np.full((2, 5), 0.4)
    sizes = []
    for horizon, samples in ((2.0, 10), (20.0, 10), (3600.0, 10), (3600.0, 3000)):
        Bank(ExponentialSum(32), order, step=STEP, horizon=horizon)  # fits and compiles
        tracemalloc.start()
        bank = Bank(ExponentialSum(32), order, step=STEP, horizon=horizon)
        for _ in range(samples):
            bank.update(order, order)
        sizes.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert max(sizes) < 1.1 * min(sizes)


@pytest.mark.parametrize("modes", [1, 2, 3, 5, 12, 24, 32, 60])
@pytest.mark.parametrize("horizon", [0.0015, 0.1, 20.0, 3600.0])
def test_weights_are_never_negative(modes, horizon):
    c = ExponentialSum(modes).coefficients(np.linspace(0, 1, 12), step=STEP, horizon=horizon)
    assert c.poles.shape == (modes,)
    assert (c.poles >= 0.0).all()
    assert (c.weights >= 0.0).all()


def test_weights_of_an_order_do_not_depend_on_the_others():
    design = ExponentialSum(24)
    orders = np.linspace(0.0, 1.0, 30).reshape(2, 15)
    together = design.coefficients(orders, step=STEP, horizon=HORIZON).weights
    for index in np.ndindex(orders.shape):
        alone = design.coefficients(orders[index], step=STEP, horizon=HORIZON).weights
        assert np.array_equal(alone, together[(slice(None), *index)])


def test_more_modes_are_better_and_the_stated_error_holds_between_the_fitted_orders():
    lags = np.geomspace(STEP, HORIZON, 3000)
    orders = np.linspace(0.013, 0.987, 23)
    last = np.inf
    for modes in (8, 16, 24, 32, 40):
        design = ExponentialSum(modes)
        stated = design.worst_error(step=STEP, horizon=HORIZON)
        found = np.abs(kernel_error(design, orders, lags, step=STEP, horizon=HORIZON)).max()
        assert found <= stated * 1.001 < last
        last = stated


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8, 1e-11])
def test_a_tolerance_is_met_with_the_fewest_modes(tolerance):
    design = ExponentialSum(tolerance=tolerance)
    modes = design.poles(step=STEP, horizon=HORIZON).size
    assert design.worst_error(step=STEP, horizon=HORIZON) <= tolerance
    fewer = ExponentialSum(modes - 1).worst_error(step=STEP, horizon=HORIZON)
    assert fewer > tolerance


def test_a_tolerance_that_cannot_be_met_says_which_is_and_with_how_many_modes():
    with pytest.raises(DesignError, match=r"got 1e-16; \d\.\de-1\d is met, with \d+ modes") as e:
        ExponentialSum(tolerance=1e-16).poles(step=STEP, horizon=0.1)
    words = str(e.value).replace(",", "").split()
    met, modes = float(words[-6]), int(words[-2])
    assert ExponentialSum(modes).worst_error(step=STEP, horizon=0.1) == pytest.approx(met, rel=0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"modes": 0}, "modes: expected a whole number in \\[1, 128\\], got 0"),
        ({"modes": 2.5}, "modes: expected a whole number"),
        ({"tolerance": 0.0}, "tolerance: expected a number in \\(0, 1\\], got 0"),
        ({"modes": 3, "tolerance": 1e-3}, "either modes or tolerance, got both"),
    ],
)
def test_bad_arguments_are_named(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        ExponentialSum(**arguments)


def test_a_thousand_different_orders_are_fitted_in_one_call():
    orders = np.linspace(0.0, 1.0, 1000)
    c = ExponentialSum(24).coefficients(orders, step=STEP, horizon=HORIZON)
    inner = slice(1, -1)
    lags = np.geomspace(STEP, HORIZON, 200)
    kernel = np.exp(-np.multiply.outer(lags, c.poles)) @ c.weights[:, inner]
    wanted = lags[:, None] ** -orders[inner] / gamma(1.0 - orders[inner])
    assert np.abs(kernel / wanted - 1.0).max() < 1e-6
    # The ends are a constant and nothing.
    assert np.array_equal(c.weights[:, 0], [1.0] + [0.0] * 23)
    assert not c.weights[:, -1].any()
