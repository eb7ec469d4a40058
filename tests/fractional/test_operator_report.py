import re

import exact_derivatives as exact
import numpy as np
import pytest
from scipy import signal
from scipy.special import gamma

from fpid_pin.cli.commands import operators
from fpid_pin.exceptions import ArgumentError, DesignError, FileFormatError
from fpid_pin.fractional import L1, Bank, Crone, ExponentialSum, report, state_space
from fpid_pin.fractional.design import modes_of

STEP = 1e-3
MODAL = [ExponentialSum(24), Crone(0.1, 1e3, 4)]
ENDS = np.array([0.0, 0.3, 0.9, 1.0])
GRID = {"step": STEP, "horizon": 20.0}
LINEAR = [ExponentialSum(24), Crone(1e-2, 1e3, 5, 1.0)]
OMEGA = np.geomspace(1.0, 200.0, 15)


@pytest.mark.parametrize("design", MODAL, ids=repr)
def test_the_frequency_response_is_what_a_sinusoid_settles_to(design):
    omega, t = 2 * np.pi * 20.0, np.repeat(np.arange(3001)[:, None] * STEP, 4, axis=1)
    bank = Bank(design, ENDS, step=STEP, horizon=3.0)
    out = bank.recorded(np.sin(omega * t), omega * np.cos(omega * t))
    tail = slice(2000, 3000)  # twenty whole periods
    got = 2j * (out[tail] * np.exp(-1j * omega * t[tail])).mean(axis=0)
    want = modes_of(design, ENDS, step=STEP, horizon=3.0).response(np.array([omega]))[0]
    # What is left of the start at order 0.3 decays like t^-1.3.
    assert np.abs(got / want - 1).max() < 2e-4


@pytest.mark.parametrize("design", MODAL, ids=repr)
def test_the_stated_output_noise_is_the_length_of_the_answer_to_one_sample(design):
    """From that sample to one horizon after it: white noise has that for its deviation."""
    order, samples = np.array([0.0, 0.3, 0.95, 1.0]), 40
    impulse = np.zeros((samples + 2, 4))
    impulse[1] = 1.0
    grid = {"step": STEP, "horizon": samples * STEP}
    bank = Bank(design, order, **grid)
    stated = modes_of(design, order, **grid).noise_gains(samples * STEP)
    for gain, inputs in zip(stated, ((impulse, 0 * impulse), (0 * impulse, impulse)), strict=True):
        answer = bank.recorded(*inputs)
        assert gain == pytest.approx(np.linalg.norm(answer, axis=0), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("design", MODAL, ids=repr)
def test_the_nyquist_gain_is_the_output_for_an_alternating_rate(design):
    stated = report(design, ENDS, step=STEP, horizon=5.0).nyquist_gain
    rate = np.repeat((-1.0) ** np.arange(5000)[:, None], 4, axis=1)
    out = Bank(design, ENDS, step=STEP, horizon=5.0).recorded(0 * rate, rate)[-1]
    assert np.allclose(np.abs(out), stated, rtol=1e-3, atol=1e-9)
    assert stated[-1] == 1.0
    assert stated[0] == 0.0


@pytest.mark.parametrize("design", MODAL, ids=repr)
def test_the_kernel_is_the_response_to_a_step(design):
    order, lags = np.array([0.3, 0.8]), np.arange(1, 300) * STEP
    start = {"initialisation": "grunwald_letnikov", "rate": "differenced"}
    got = Bank(design, order, step=STEP, horizon=1.0, **start).recorded(np.ones((300, 2)))[1:]
    want = lags[:, None] ** -order / gamma(1 - order)
    error = modes_of(design, order, step=STEP, horizon=1.0).kernel_error(lags)
    assert np.abs(got / want - 1 - error).max() < 1e-9


@pytest.mark.parametrize("design", [ExponentialSum(12), Crone(0.1, 1e3, 3)], ids=repr)
def test_no_output_is_further_off_than_the_stated_bound(design):
    """The worst signal for a kernel error is the one whose rate follows the error's sign."""
    order, horizon = np.array([0.6]), 2.0
    bound = report(design, order, step=STEP, horizon=horizon).error_bound[0]
    t = np.arange(round(horizon / STEP) + 1) * STEP
    lag = np.maximum(t[-1] - t, 1e-9)
    sign = np.sign(modes_of(design, 0.6, step=STEP, horizon=horizon).kernel_error(lag))
    rate = np.where(sign == 0.0, 1.0, sign)
    # Piecewise constant rates: the rule between samples adds nothing with the value alone.
    value = np.concatenate([[0.0], np.cumsum(rate[1:] * STEP)])[:, None]
    best, rough = (
        Bank(d, order, step=STEP, horizon=horizon, rate="differenced").recorded(value)[-1, 0]
        for d in (ExponentialSum(40), design)
    )
    assert 0.3 * bound < abs(rough - best) < bound * 1.01


@pytest.mark.parametrize("design", MODAL, ids=repr)
def test_a_report_prints_a_row_for_each_order(design):
    found = report(design, [0.0, 0.1, 1.0], step=STEP, horizon=3.0)
    text = str(found)
    lines = text.splitlines()
    assert len(lines) == 8
    assert len({len(line) for line in lines[3:]}) == 1
    assert lines[0].startswith("Fractional derivatives by a ")
    assert lines[0].endswith(f"up to 3 s; {found.states} numbers are kept for each signal.")
    assert found.order.tolist() == [0.0, 0.1, 1.0]
    # Orders 0 and 1 are exact.
    assert found.magnitude_error[[0, 2]].max() < 1e-12
    assert found.kernel_error[[0, 2]].max() == 0.0
    assert found.error_bound[[0, 2]].max() == 0.0 < found.error_bound[1]
    assert all(seconds > 0 for seconds in found.cost)
    panels = found.plot().axes
    assert [panel.get_ylabel().split()[0] for panel in panels] == ["magnitude", "phase", "relative"]
    assert [len(panel.lines) for panel in panels] == [3, 3, 3]


def test_a_report_says_where_the_design_can_be_trusted():
    trusted = report(ExponentialSum(24), [0.2, 0.8], step=STEP, horizon=20.0)
    assert (trusted.longest_horizon > 20.0).all()
    for k, order in enumerate(trusted.order):
        inside = np.geomspace(trusted.lowest_frequency[k], trusted.highest_frequency[k], 50)[1:-1]
        found = modes_of(trusted.design, order, **GRID).response(inside)
        assert np.abs(found / (1j * inside) ** order - 1).max() < 0.011
    with pytest.raises(ArgumentError, match="design: expected one with modes, got L1"):
        report(L1(), 0.5, step=STEP)
    narrow = report(Crone(1.0, 10.0, 1), 0.5, step=STEP, horizon=20.0)
    for nowhere in (narrow.longest_horizon, narrow.lowest_frequency, narrow.highest_frequency):
        assert np.isnan(nowhere).all()


def test_of_a_band_between_two_frequencies_the_nearest_counts():
    found = report(Crone(10.0, 10.01, 1), 0.5, step=STEP, horizon=1.0)
    nearest = np.abs(np.log(found.frequency / 10.005)).argmin()
    gain = np.abs(found.response[nearest] / found.frequency[nearest] ** 0.5)
    assert found.magnitude_error == pytest.approx(np.abs(20.0 * np.log10(gain)), rel=1e-12)


def test_the_command_s_table_has_a_row_for_each_order_and_a_figure_where_asked(tmp_path, capsys):
    figure = tmp_path / "operators.png"
    operators([0.3, 0.9], horizon=2.0, modes=16, plot=figure)
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[-2:]] == ["0.3", "0.9"]
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert figure.stat().st_size > 10_000
    operators([0.5], horizon=2.0, design="crone", band=(0.1, 100.0), n=3, widening=1.0)
    words = "a CRONE filter of order 7 from 0.1 to 100 rad/s, widened by 1 decades, for steps of"
    assert words in capsys.readouterr().out
    operators([0.5], horizon=2.0, tolerance=1e-3)
    assert re.search(r"a sum of \d+ exponentials, enough for .* 0.001,", capsys.readouterr().out)


def test_the_command_names_bad_arguments(tmp_path):
    (tmp_path / "file").touch()
    for error, words, changes in (
        (ArgumentError, r"order\.1: expected a number in \[0, 1\], got 1.7", {"order": [0.5, 1.7]}),
        (ArgumentError, "horizon: expected more than one step", {"horizon": 1e-3}),
        (ArgumentError, "did you mean crone", {"design": "cron"}),
        (DesignError, "is met, with", {"horizon": 0.01, "tolerance": 1e-18}),
        (ArgumentError, "plot: expected a file that can be", {"plot": tmp_path / "x.no-picture"}),
        (FileFormatError, "file", {"plot": tmp_path / "file" / "x.png"}),
    ):
        with pytest.raises(error, match=words):
            operators(**({"order": [0.5], "horizon": 2.0} | changes))


@pytest.mark.parametrize("design", LINEAR, ids=repr)
@pytest.mark.parametrize("order", [0.0, 0.1, 0.5, 0.95])
def test_the_continuous_system_is_close_to_the_operator(design, order):
    found = signal.freqresp(state_space(design, order, **GRID), OMEGA)[1]
    limit = 0.05 if isinstance(design, Crone) else 1e-4
    assert np.abs(found / (1j * OMEGA) ** order - 1.0).max() < limit


@pytest.mark.parametrize("design", LINEAR, ids=repr)
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
