import sys
import types

import control
import exact_derivatives as exact
import numpy as np
import pytest
from scipy import signal

from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional import (
    L1,
    Bank,
    Crone,
    ExponentialSum,
    fpid_state_space,
    state_space,
    to_control,
    zeros_poles_gain,
)

STEP, HORIZON = 1e-3, 20.0
GRID = {"step": STEP, "horizon": HORIZON}
DESIGNS = [ExponentialSum(24), Crone(1e-2, 1e3, 5, 1.0)]
OMEGA = np.geomspace(1.0, 200.0, 15)
S = 1j * OMEGA


def response(system):
    eye = np.eye(len(system.A))
    inner = np.array([np.linalg.solve(x * eye - system.A, system.B) for x in S])
    return (system.C @ inner + system.D)[:, 0, 0]


def fpid(lam, mu, design=DESIGNS[0], gains=(10.0, 25.0, 20.0), **options):
    kp, ki, kd = gains
    orders = {"integral_order": lam, "derivative_order": mu}
    return fpid_state_space(kp=kp, ki=ki, kd=kd, **orders, design=design, **GRID, **options)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("order", [0.0, 0.1, 0.5, 0.95])
@pytest.mark.parametrize("horizon", [HORIZON, 3600.0])
def test_state_space_and_zpk_are_one_system_close_to_the_operator(design, order, horizon):
    system = state_space(design, order, step=STEP, horizon=horizon)
    assert isinstance(system, signal.StateSpace)
    got = response(system)
    limit = 0.05 if isinstance(design, Crone) else 1e-4 if horizon == HORIZON else 1e-3
    assert np.abs(got / S**order - 1).max() < limit
    zpk = zeros_poles_gain(design, order, step=STEP, horizon=horizon)
    assert isinstance(zpk, signal.ZerosPolesGain)
    other = signal.freqs_zpk(zpk.zeros, zpk.poles, zpk.gain, OMEGA)[1]
    assert np.abs(got / other - 1).max() < 1e-9
    assert (zpk.poles < 0).all()
    assert (zpk.zeros <= 0).all()
    if isinstance(design, ExponentialSum):
        # Every zero lies below its pole, above the next slower one: one by one, to rounding.
        zeros, poles = np.sort(-zpk.zeros), np.sort(-zpk.poles)
        assert (zeros <= poles * (1 + 1e-12)).all()
        assert (zeros[1:] >= poles[:-1] * (1 - 1e-12)).all()


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
@pytest.mark.parametrize("order", [0.0, 0.4, 1.0])
def test_the_sampled_export_is_what_the_bank_does(design, rule, order):
    value, rate = np.random.default_rng(2).normal(size=(2, 80))
    # From rest: both start at zero.
    value[0] = rate[0] = 0.0
    system = state_space(design, order, **GRID, sampled=True, rate=rule)
    assert system.dt == STEP
    measured = rule == "measured"
    inputs = np.stack([value, rate], axis=1) if measured else value[:, None]
    state, got = np.zeros(len(system.A)), []
    for u in inputs:
        got.append((system.C @ state + system.D @ u)[0])
        state = system.A @ state + system.B @ u
    bank = Bank(design, order, **GRID, rate=rule)
    want = exact.stream(bank, value, rate if measured else None)
    assert np.abs(got - want).max() < 1e-9 * np.abs(want).max()


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize(("lam", "mu"), [(0.9, 0.9), (0.3, 0.6), (1.0, 0.0), (0.0, 0.5)])
def test_a_whole_fpid_has_the_response_of_equation_10(design, lam, mu):
    system = fpid(lam, mu, design)
    want = 10.0 + 25.0 * S**-lam + 20.0 * S**mu
    limit = 1e-3 if isinstance(design, ExponentialSum) else 0.06
    assert np.abs(response(system) / want - 1).max() < limit
    if isinstance(design, ExponentialSum) and mu > 0 and 0 < lam < 1:
        # Shared poles: one set of modes, and each term's own fast one.
        assert len(system.A) <= 26


def test_a_pure_derivative_needs_a_filter_and_a_gain_alone_is_a_gain():
    with pytest.raises(DesignError, match="derivative_order: expected a number below 1"):
        fpid(1.0, 1.0)
    want = 10.0 + 25.0 / S + 20.0 * S / (1.0 + 1e-3 * S)
    assert np.allclose(response(fpid(1.0, 1.0, filter_time=1e-3)), want, rtol=1e-10)
    assert np.allclose(response(fpid(0.5, 0.5, gains=(4.0, 0.0, 0.0))), 4.0)


def test_python_control_reads_the_same_system():
    for sampled in (False, True):
        system = state_space(ExponentialSum(24), 0.5, **GRID, sampled=sampled)
        other = to_control(system)
        assert isinstance(other, control.StateSpace)
        assert other.dt == (STEP if sampled else 0)
        assert np.array_equal(other.A, system.A)
    plant = control.tf([1.0], [1.0, 0.4, 0.0])
    law = to_control(fpid(0.8, 0.8, ExponentialSum(16), (10.0, 1.0, 5.0)))
    _, phase_margin, _, crossover = control.margin(plant * law)
    s = 1j * crossover
    exact_loop = (10 + s**-0.8 + 5 * s**0.8) / (s * s + 0.4 * s)
    assert abs(abs(exact_loop) - 1) < 1e-3
    assert abs(np.degrees(np.angle(exact_loop)) + 180 - phase_margin) < 0.1


def test_without_python_control_the_error_says_what_to_install(monkeypatch):
    """A folder named control imports as an empty package: that is not it."""
    system = state_space(ExponentialSum(8), 0.5, step=STEP)
    for module in (types.ModuleType("control"), None):
        monkeypatch.setitem(sys.modules, "control", module)
        with pytest.raises(DesignError, match=r"pip install 'fpid_pin\[control\]'"):
            to_control(system)


def test_what_cannot_be_exported_is_refused():
    with pytest.raises(ArgumentError, match="order 1 is s, not proper"):
        state_space(ExponentialSum(), 1.0, step=STEP)
    with pytest.raises(ArgumentError, match="design: expected one with modes, got L1"):
        state_space(L1(), 0.5, step=STEP, horizon=1.0)
