"""Operators as SciPy's linear systems, against (j omega)^alpha and against the bank."""

import exact_derivatives as exact
import numpy as np
import pytest
from scipy import signal

from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import Bank, Crone, ExponentialSum, state_space

GRID = {"step": 1e-3, "horizon": 20.0}
DESIGNS = [ExponentialSum(24), Crone(1e-2, 1e3, 5, 1.0)]
OMEGA = np.geomspace(1.0, 200.0, 15)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("order", [0.0, 0.1, 0.5, 0.95])
def test_the_continuous_system_is_close_to_the_operator(design, order):
    found = signal.freqresp(state_space(design, order, **GRID), OMEGA)[1]
    limit = 0.05 if isinstance(design, Crone) else 1e-4
    assert np.abs(found / (1j * OMEGA) ** order - 1.0).max() < limit


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("order", [0.0, 0.1, 1.0])
def test_the_sampled_system_is_what_the_bank_does(design, order):
    value, rate = np.random.default_rng(2).normal(size=(2, 80))
    value[0] = rate[0] = 0.0  # from rest: both start at zero
    system = state_space(design, order, **GRID, sampled=True)
    found = signal.dlsim(system, np.stack([value, rate], axis=1))[1][:, 0]
    bank = Bank(design, order, **GRID, rate="measured")
    wanted = exact.stream(bank, value, rate)
    assert np.abs(found - wanted).max() < 1e-9 * np.abs(wanted).max()


def test_order_one_in_continuous_time_is_refused():
    with pytest.raises(ArgumentError, match="order: expected a number below 1"):
        state_space(ExponentialSum(8), 1.0, **GRID)
