import tracemalloc
from functools import partial

import exact_derivatives as exact
import numpy as np
import pytest

from fpid_pin.exceptions import DesignError
from fpid_pin.fractional import Bank, ExponentialSum
from fpid_pin.fractional.design import modes_of

STEP, HORIZON = 1e-3, 20.0
GRID = {"step": STEP, "horizon": HORIZON}
ORDERS = np.round(np.arange(1, 20) / 20, 2)
SAMPLES = 20001
CHECKED = np.unique(np.r_[1:4, np.geomspace(5, SAMPLES - 1, 9).astype(int)])
SIGNALS = {
    "sin": (np.sin, np.cos, exact.of_sin),
    "exp": (lambda t: np.exp(-t), lambda t: -np.exp(-t), exact.of_exp),
    "t^1.5": (lambda t: t**1.5, lambda t: 1.5 * np.sqrt(t), partial(exact.of_power, power=1.5)),
    "t^2": (lambda t: t * t, lambda t: 2.0 * t, partial(exact.of_power, power=2)),
}


@pytest.fixture(scope="module")
def truth():
    return {name: exact.table(s[2], ORDERS, CHECKED * STEP) for name, s in SIGNALS.items()}


@pytest.mark.parametrize(
    ("modes", "smooth", "square"), [(24, 5e-7, 1e-6), (32, 2e-9, 1e-8), (40, 1e-11, 1e-11)]
)
def test_a_known_rate_meets_its_accuracy_for_all_orders(truth, modes, smooth, square):
    bank = Bank(ExponentialSum(modes), ORDERS, **GRID)
    t = np.repeat(np.arange(SAMPLES)[:, None] * STEP, ORDERS.size, axis=1)
    limits = {"sin": smooth, "exp": smooth, "t^1.5": 1e-4, "t^2": square}
    for name, (value, rate, _) in SIGNALS.items():
        found = bank.recorded(value(t), rate(t))[CHECKED]
        error = np.abs(found - truth[name]) / np.abs(truth[name]).max(axis=0)
        assert error.max() < limits[name], (name, error.max())
        if name == "t^1.5":
            assert error[CHECKED >= 10].max() < 1e-5


def test_memory_does_not_depend_on_the_horizon():
    order = np.full((2, 5), 0.4)
    sizes = []
    for horizon, samples in ((2.0, 10), (20.0, 10), (3600.0, 10), (3600.0, 3000)):
        # Once before, so that the design is fitted and the kernel compiled.
        Bank(ExponentialSum(32), order, step=STEP, horizon=horizon).update(order, order)
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


@pytest.mark.parametrize("horizon", [HORIZON, 3600.0])
def test_more_modes_are_better_and_the_stated_error_holds_between_the_fitted_orders(horizon):
    lags, orders = np.geomspace(STEP, horizon, 3000), np.linspace(0.013, 0.987, 23)
    grid = {"step": STEP, "horizon": horizon}
    last = np.inf
    for modes in (8, 16, 24, 32, 40):
        design = ExponentialSum(modes)
        stated = design.worst_error(**grid)
        found = np.abs(modes_of(design, orders, **grid).kernel_error(lags)).max()
        assert found <= stated * 1.001 < last
        last = stated


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8, 1e-11])
def test_a_tolerance_is_met_with_the_fewest_modes(tolerance):
    design = ExponentialSum(tolerance=tolerance)
    modes = design.poles(**GRID).size
    assert design.worst_error(**GRID) <= tolerance
    assert ExponentialSum(modes - 1).worst_error(**GRID) > tolerance


def test_a_tolerance_that_cannot_be_met_says_which_is_and_with_how_many_modes():
    with pytest.raises(DesignError, match=r"got 1e-16; \d\.\de-1\d is met, with \d+ modes") as e:
        ExponentialSum(tolerance=1e-16).poles(step=STEP, horizon=0.1)
    words = str(e.value).replace(",", "").split()
    met, modes = float(words[-6]), int(words[-2])
    assert ExponentialSum(modes).worst_error(step=STEP, horizon=0.1) == pytest.approx(met, rel=0.1)
