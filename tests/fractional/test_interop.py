import sys
import types

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
    RefinedOustaloup,
    fpid_state_space,
    state_space,
    to_control,
    zeros_poles_gain,
)
from fpid_pin.fractional.interop import python_control

STEP, HORIZON = 1e-3, 20.0
DESIGNS = [ExponentialSum(24), Crone(1e-2, 1e3, 5, 1.0), RefinedOustaloup(1e-2, 1e3, 5)]
OMEGA = np.geomspace(1.0, 200.0, 15)


def _response(system, omega):
    s = 1j * omega
    eye = np.eye(len(system.A))
    return (
        np.array([(system.C @ np.linalg.solve(x * eye - system.A, system.B))[0] for x in s])
        + (system.D[0])
    )


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("order", [0.0, 0.1, 0.5, 0.95])
def test_state_space_and_zpk_are_one_system_close_to_the_operator(design, order):
    system = state_space(design, order, step=STEP, horizon=HORIZON)
    assert isinstance(system, signal.StateSpace)
    got = _response(system, OMEGA)[:, 0]
    limit = 1e-4 if isinstance(design, ExponentialSum) else 0.05
    assert np.abs(got / (1j * OMEGA) ** order - 1).max() < limit
    if order > 0.0:
        zpk = zeros_poles_gain(design, order, step=STEP, horizon=HORIZON)
        assert isinstance(zpk, signal.ZerosPolesGain)
        other = signal.freqs_zpk(zpk.zeros, zpk.poles, zpk.gain, OMEGA)[1]
        assert np.abs(got / other - 1).max() < 1e-9
        assert (zpk.poles < 0).all()
        assert (zpk.zeros <= 0).all()


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
@pytest.mark.parametrize("order", [0.0, 0.4, 1.0])
def test_the_sampled_export_is_what_the_bank_does(design, rule, order):
    rng = np.random.default_rng(2)
    value, rate = rng.normal(size=(2, 80))
    # From rest: both start at zero.
    value[0] = rate[0] = 0.0
    system = state_space(design, order, step=STEP, horizon=HORIZON, sampled=True, rate=rule)
    assert system.dt == STEP
    measured = rule == "measured"
    inputs = np.stack([value, rate], axis=1) if measured else value[:, None]
    state, got = np.zeros(len(system.A)), []
    for u in inputs:
        got.append((system.C @ state + system.D @ u)[0])
        state = system.A @ state + system.B @ u
    bank = Bank(design, order, step=STEP, horizon=HORIZON, rate=rule)
    want = exact.stream(bank, value, rate if measured else None)
    assert np.abs(got - want).max() < 1e-9 * np.abs(want).max()


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
@pytest.mark.parametrize(("lam", "mu"), [(0.9, 0.9), (0.3, 0.6), (1.0, 0.0), (0.0, 0.5)])
def test_a_whole_fpid_has_the_response_of_equation_10(design, lam, mu):
    gains = {"kp": 10.0, "ki": 25.0, "kd": 20.0}
    system = fpid_state_space(
        **gains, integral_order=lam, derivative_order=mu, design=design, step=STEP, horizon=HORIZON
    )
    s = 1j * OMEGA
    want = 10.0 + 25.0 * s**-lam + 20.0 * s**mu
    limit = 1e-3 if isinstance(design, ExponentialSum) else 0.06
    assert np.abs(_response(system, OMEGA)[:, 0] / want - 1).max() < limit
    if isinstance(design, ExponentialSum) and mu > 0 and 0 < lam < 1:
        # Shared poles: one set of modes, and each term's own fast one.
        assert len(system.A) <= 26


def test_a_pure_derivative_needs_a_filter():
    arguments = {"kp": 1.0, "ki": 2.0, "kd": 3.0, "integral_order": 1.0, "derivative_order": 1.0}
    common = {"design": ExponentialSum(), "step": STEP}
    with pytest.raises(DesignError, match="derivative_order: expected a number below 1"):
        fpid_state_space(**arguments, **common)
    system = fpid_state_space(**arguments, **common, filter_time=1e-3)
    s = 1j * OMEGA
    want = 1.0 + 2.0 / s + 3.0 * s / (1.0 + 1e-3 * s)
    assert np.allclose(_response(system, OMEGA)[:, 0], want, rtol=1e-10)


def test_a_proportional_controller_alone_is_a_gain():
    system = fpid_state_space(
        kp=4.0,
        ki=0.0,
        kd=0.0,
        integral_order=0.5,
        derivative_order=0.5,
        design=ExponentialSum(),
        step=STEP,
    )
    assert np.allclose(_response(system, OMEGA), 4.0)


def test_python_control_reads_the_same_system():
    control = python_control()
    assert control is not None, "the test extra installs it"
    for sampled in (False, True):
        system = state_space(ExponentialSum(24), 0.5, step=STEP, horizon=HORIZON, sampled=sampled)
        other = to_control(system)
        assert isinstance(other, control.StateSpace)
        assert other.dt == (STEP if sampled else 0)
        assert np.array_equal(other.A, system.A)
    plant = control.tf([1.0], [1.0, 0.4, 0.0])
    controller = to_control(
        fpid_state_space(
            kp=10.0,
            ki=1.0,
            kd=5.0,
            integral_order=0.8,
            derivative_order=0.8,
            design=ExponentialSum(16),
            step=STEP,
            horizon=HORIZON,
        )
    )
    _, phase_margin, _, crossover = control.margin(plant * controller)
    s = 1j * crossover
    exact_loop = (10 + s**-0.8 + 5 * s**0.8) / (s * s + 0.4 * s)
    assert abs(abs(exact_loop) - 1) < 1e-3
    assert abs(np.degrees(np.angle(exact_loop)) + 180 - phase_margin) < 0.1


def test_without_python_control_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    system = state_space(ExponentialSum(8), 0.5, step=STEP)
    with pytest.raises(DesignError, match=r"pip install 'fpid_pin\[control\]'"):
        to_control(system)


def test_what_cannot_be_exported_is_refused():
    with pytest.raises(ArgumentError, match="order 1 is s, not proper"):
        state_space(ExponentialSum(), 1.0, step=STEP)
    with pytest.raises(ArgumentError, match="design: expected one with modes, got L1"):
        state_space(L1(), 0.5, step=STEP, horizon=1.0)


def test_a_folder_named_control_is_not_python_control(monkeypatch):
    """Such a folder imports as an empty package; the tests' own did."""
    system = state_space(ExponentialSum(24), 0.5, step=STEP, horizon=HORIZON)
    for module in (types.ModuleType("control"), None):
        monkeypatch.setitem(sys.modules, "control", module)
        assert python_control() is None
        with pytest.raises(DesignError, match="expected python-control to be installed"):
            to_control(system)
