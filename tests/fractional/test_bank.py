import warnings

import exact_derivatives as exact
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import gamma

from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.fractional import (
    L1,
    Bank,
    Crone,
    Design,
    ExponentialSum,
    GrunwaldLetnikov,
    RefinedOustaloup,
    response,
)
from fpid_pin.fractional.recorded import run_modes
from fpid_pin.fractional.step_integrals import integrate_step

STEP = 1e-3
MODAL = [ExponentialSum(24), Crone(1e-2, 1e3, 5), RefinedOustaloup(1e-2, 1e3, 4)]
ALL = [*MODAL, GrunwaldLetnikov(), L1(), L1(memory=0.05)]


def _signal(samples, shape, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(samples).reshape((-1,) + (1,) * len(shape)) * STEP
    a, w, p = rng.uniform(0.5, 2, shape), rng.uniform(1, 40, shape), rng.uniform(0, 6, shape)
    return a * np.sin(w * t + p) + 0.3, a * w * np.cos(w * t + p)


def _textbook(design, order, value, rate, horizon):
    """The update rule as written in the design document: m, b1, b0, b2, in mode states x."""
    c = design.coefficients(order, step=STEP, horizon=horizon)
    one = integrate_step(c.poles, STEP)
    x = np.zeros(c.poles.shape)
    out = [0.0]
    for k in range(1, len(value)):
        m = (value[k] - value[k - 1]) / STEP - (rate[k] + rate[k - 1]) / 2
        past = (c.weights * one.decay * x).sum()
        if isinstance(design, ExponentialSum):
            out.append(c.now * rate[k] + c.before * rate[k - 1] + c.mean * m + past)
        x = one.decay * x + one.now * rate[k] + one.before * rate[k - 1] + one.mean * m
        if not isinstance(design, ExponentialSum):
            out.append((c.weights * x).sum())
    return np.array(out)


@pytest.mark.parametrize("design", MODAL, ids=lambda d: type(d).__name__)
@pytest.mark.parametrize("order", [0.05, 0.5, 0.93])
def test_the_fast_recursion_equals_the_rule_as_written(design, order):
    value, rate = _signal(400, ())
    bank = Bank(design, order, step=STEP, horizon=1.0)
    want = _textbook(design, order, value, rate, 1.0)
    assert np.abs(exact.stream(bank, value, rate) - want).max() < 1e-11 * np.abs(want).max()


@pytest.mark.parametrize("design", ALL, ids=repr)
@pytest.mark.parametrize("initialisation", ["caputo", "riemann_liouville", "grunwald_letnikov"])
def test_orders_0_and_1_are_the_signal_and_its_rate_exactly(design, initialisation):
    order = np.array([0.0, 0.4, 1.0, 0.0, 1.0])
    value, rate = _signal(300, (5,))
    bank = Bank(design, order, step=STEP, horizon=1.0, initialisation=initialisation)
    out = exact.stream(bank, value, rate)
    assert np.array_equal(out[:, [0, 3]], value[:, [0, 3]])
    assert np.array_equal(out[:, [2, 4]], rate[:, [2, 4]])


def test_a_population_has_the_same_bits_whole_in_chunks_and_alone():
    rng = np.random.default_rng(5)
    runs = 64
    order = rng.uniform(0.0, 1.0, (2, runs, 2))
    order[0, 3], order[1, 4] = 0.0, 1.0
    value, rate = _signal(10, order.shape)
    for design in (ExponentialSum(24), ExponentialSum(7), Crone(1e-2, 1e3, 5)):
        for rule in ("measured", "differenced"):

            def run(part, design=design, rule=rule):
                bank = Bank(design, order[:, part], step=STEP, horizon=20.0, rate=rule)
                given = rate[:, :, part] if rule == "measured" else None
                return exact.stream(bank, value[:, :, part], given)

            whole = run(slice(None))
            for chunk in (1, 3, 17, 60) if isinstance(design, ExponentialSum) else (1, 17):
                parts = [run(slice(i, i + chunk)) for i in range(0, runs, chunk)]
                assert np.array_equal(np.concatenate(parts, axis=2), whole)


def test_one_signal_alone_has_the_bits_it_has_among_others():
    order = np.linspace(0.0, 1.0, 9)
    value, rate = _signal(80, (9,))
    together = exact.stream(Bank(ExponentialSum(), order, step=STEP), value, rate)
    for k in range(9):
        for shape in ((), (1,)):
            bank = Bank(ExponentialSum(), order[k].reshape(shape), step=STEP)
            column = (slice(None), k) if shape == () else (slice(None), slice(k, k + 1))
            alone = exact.stream(bank, value[column].copy(), rate[column].copy())
            assert np.array_equal(alone.reshape(-1), together[:, k])


def test_inputs_may_be_views_that_are_not_contiguous_and_the_own_buffer_is_returned():
    order = np.full((2, 3), 0.6)
    value, rate = _signal(20, (3, 2))
    bank, other = (Bank(ExponentialSum(), order, step=STEP) for _ in range(2))
    for k in range(20):
        mine = bank.update(value[k].T, rate[k].T)
        out = np.empty((2, 3))
        assert other.update(value[k].T.copy(), rate[k].T.copy(), out) is out
        assert np.array_equal(mine, out)


@pytest.mark.parametrize("design", [ExponentialSum(24), GrunwaldLetnikov(), L1()], ids=repr)
def test_a_changed_order_gives_what_the_new_order_would_have_given_from_the_start(design):
    first, second = np.array([0.2, 0.9, 0.0, 0.5]), np.array([0.7, 0.0, 0.3, 1.0])
    value, rate = _signal(400, (4,))
    bank = Bank(design, first, step=STEP, horizon=1.0)
    fresh = Bank(design, second, step=STEP, horizon=1.0)
    want = exact.stream(fresh, value, rate)
    exact.stream(bank, value[:200], rate[:200])
    bank.set_order(second)
    assert np.array_equal(exact.stream(bank, value[200:], rate[200:]), want[200:])


def test_an_order_that_ramps_passes_through_the_orders_between():
    value, rate = _signal(300, (2,))
    bank = Bank(ExponentialSum(), [0.2, 0.8], step=STEP, horizon=1.0)
    out = exact.stream(bank, value[:100], rate[:100])
    bank.set_order([0.6, 0.4], ramp=0.1)
    out = exact.stream(bank, value[100:], rate[100:])
    for k in (0, 37, 99, 150):
        part = min((k + 1) / 100, 1.0)
        order = np.array([0.2, 0.8]) + part * np.array([0.4, -0.4])
        fresh = Bank(ExponentialSum(), order, step=STEP, horizon=1.0)
        want = exact.stream(fresh, value[: 101 + k], rate[: 101 + k])[-1]
        assert np.abs(out[k] - want).max() < 1e-12 * np.abs(want).max()
    assert np.array_equal(bank.order, [0.6, 0.4])


@pytest.mark.parametrize("rule", ["measured", "differenced"])
def test_a_filter_keeps_its_modes_when_its_order_is_set_again(rule):
    value, rate = _signal(300, (2,))
    design = Crone(1e-2, 1e5, 5)
    bank, other = (Bank(design, [0.3, 0.7], step=STEP, rate=rule) for _ in range(2))
    rate = rate if rule == "measured" else [None] * 300
    for k in range(300):
        if k == 150:
            bank.set_order([0.3, 0.7])
        want = other.update(value[k], rate[k])
        assert np.abs(bank.update(value[k], rate[k]) - want).max() <= 1e-9 * np.abs(want).max()


@pytest.mark.parametrize("design", ALL, ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
@pytest.mark.parametrize("initialisation", ["caputo", "riemann_liouville"])
def test_a_held_channel_stands_still_and_goes_on_without_a_jump(design, rule, initialisation):
    order = np.array([0.0, 0.3, 0.8, 1.0])
    value, rate = _signal(200, (4,))
    banks = [
        Bank(design, order, step=STEP, horizon=1.0, rate=rule, initialisation=initialisation)
        for _ in range(2)
    ]

    def feed(bank, v, r, hold=None):
        return bank.update(v, r if rule == "measured" else None, hold=hold).copy()

    held = np.array([True, True, True, False])
    for k in range(100):
        before = feed(banks[0], value[k], rate[k])
        feed(banks[1], value[k], rate[k])
    # While one bank is held the signal moves by 5 and comes to the same rate.
    for j in range(30):
        during = feed(banks[0], value[99] + 5.0 * (j + 1) / 30, rate[99] + 29 - j, held)
        assert np.array_equal(during[:3], before[:3])
    for k in range(100, 200):
        got, want = feed(banks[0], value[k] + 5.0, rate[k]), feed(banks[1], value[k], rate[k])
        want[0] += 5.0  # order 0 is the signal itself
        assert np.abs(got - want)[:3].max() < 1e-10 * np.abs(want).max()


def test_a_design_without_modes_is_named():
    class Odd(Design):
        def coefficients(self, order, *, step, horizon):
            return 3

    with pytest.raises(ArgumentError, match="design: expected one with modes, got Odd"):
        Bank(Odd(), 0.5, step=STEP)


def test_holding_nothing_changes_nothing():
    value, rate = _signal(50, (3,))
    banks = [Bank(ExponentialSum(), [0.2, 0.0, 0.9], step=STEP) for _ in range(2)]
    for k in range(50):
        a = banks[0].update(value[k], rate[k], hold=np.zeros(3, dtype=bool)).copy()
        assert np.array_equal(a, banks[1].update(value[k], rate[k]))


@pytest.mark.parametrize("design", ALL, ids=repr)
def test_a_retired_run_is_exactly_zero_for_good_and_the_others_do_not_notice(design):
    order = np.random.default_rng(1).uniform(0, 1, (2, 4, 2))
    order[0, 2, 0], order[1, 2, 1] = 0.0, 1.0
    value, rate = _signal(60, order.shape)
    bank, other = (Bank(design, order, step=STEP, horizon=1.0) for _ in range(2))
    for k in range(60):
        v, r = value[k].copy(), rate[k].copy()
        if k == 30:
            bank.retire((slice(None), 2))
        if k > 30:
            v[:, 2], r[:, 2] = np.nan, np.inf
        got, want = bank.update(v, r).copy(), other.update(value[k], rate[k]).copy()
        if k >= 30:
            want[:, 2] = 0.0
        assert np.array_equal(got, want)
        if k == 45 and not isinstance(design, (Crone, RefinedOustaloup)):
            bank.set_order(order)


def test_reset_starts_again_at_zero():
    value, rate = _signal(40, (2,))
    for design in ALL:
        bank = Bank(design, [0.3, 0.9], step=STEP, initialisation="riemann_liouville")
        first = exact.stream(bank, value, rate)
        bank.reset()
        assert np.array_equal(exact.stream(bank, value, rate), first)


def test_the_three_initialisations_do_what_they_say_in_the_first_samples():
    order, start = np.array([0.3, 0.9]), 2.0
    value, rate = np.full((50, 2), start), np.zeros((50, 2))
    t = np.arange(1, 50)[:, None] * STEP
    step_response = start * t**-order / gamma(1 - order)
    for design in (ExponentialSum(40), L1()):
        out = {
            word: exact.stream(
                Bank(design, order, step=STEP, horizon=1.0, initialisation=word), value, rate
            )
            for word in ("caputo", "riemann_liouville", "grunwald_letnikov")
        }
        assert not out["caputo"].any()
        assert not out["riemann_liouville"][0].any()
        assert np.allclose(out["riemann_liouville"][1:], step_response, rtol=1e-9, atol=0)
        assert np.allclose(out["grunwald_letnikov"][0], start * STEP**-order, rtol=1e-12)
        assert np.array_equal(out["grunwald_letnikov"][1:], out["riemann_liouville"][1:])


def test_a_filter_started_at_rest_has_the_kick_of_its_high_frequency_gain():
    design = Crone(1e-2, 1e3, 5)
    bank = Bank(design, 0.9, step=STEP, initialisation="grunwald_letnikov")
    assert np.isclose(bank.update(np.array(1.5), np.array(0.0)), 1.5 * 1e3**0.9, rtol=1e-12)


@pytest.mark.parametrize("order", [0.05, 0.5, 0.95])
def test_a_rate_bias_leaves_no_drift_over_ten_minutes(order):
    bias, samples = 0.005, 600_001
    t = np.arange(samples) * STEP
    value, rate = np.sin(t)[:, None], np.cos(t)[:, None]
    common = {"step": STEP, "horizon": 600.0}
    biased, clean = (
        run_modes(ExponentialSum(24), np.array([order]), value, r, **common)
        for r in (rate + bias, rate)
    )
    effect = np.abs(biased - clean)[:, 0]
    accumulated = bias * (600.0 ** (1 - order) - 1.0) / gamma(2 - order)
    assert np.abs(effect[1000:] - effect[1000]).max() < 1e-3 * accumulated
    # What stays is the part of the operator that is the newest rate itself: all of it at order 1.
    assert effect[-1] < bias * STEP ** (1 - order)


def test_a_rate_that_is_not_known_gives_streamed_l1():
    t = np.arange(20001) * STEP
    order = np.round(np.arange(1, 20) / 20, 2)
    value = np.repeat((np.sin(t) + 0.2 * np.sin(31 * t))[:, None], 19, axis=1)
    streamed = exact.stream(
        Bank(ExponentialSum(32), order, step=STEP, horizon=20.0, rate="differenced"), value
    )
    j = np.arange(t.size)[:, None]
    weights = ((j + 1.0) ** (1 - order) - j ** (1 - order)) * STEP**-order / gamma(2 - order)
    for k in (1, 10, 999, 7000, 20000):
        full = (weights[:k] * np.diff(value[: k + 1], axis=0)[::-1]).sum(axis=0)
        assert np.abs(streamed[k] - full).max() < 1e-8


@settings(max_examples=30)
@given(
    st.floats(0.0, 1.0),
    st.floats(-10, 10),
    st.floats(-10, 10),
    st.sampled_from(MODAL),
    st.integers(0, 1000),
)
def test_the_operator_is_linear(order, a, b, design, seed):
    (f, fr), (g, gr) = _signal(30, (), seed), _signal(30, (), seed + 1)
    banks = [Bank(design, order, step=STEP, horizon=1.0) for _ in range(3)]
    got = exact.stream(banks[0], a * f + b * g, a * fr + b * gr)
    want = a * exact.stream(banks[1], f, fr) + b * exact.stream(banks[2], g, gr)
    scale = 1 + abs(a) * np.abs(fr).max() + abs(b) * np.abs(gr).max()
    assert np.abs(got - want).max() < 1e-9 * scale


@pytest.mark.parametrize("order", [0.1, 0.5, 0.9])
def test_the_fractional_integral_of_one_is_a_power(order):
    """I^lambda 1 = t^lambda/Gamma(1 + lambda), by D^(1-lambda) of the integral t."""
    t = np.arange(3000) * STEP
    bank = Bank(ExponentialSum(32), 1 - order, step=STEP, horizon=3.0)
    got = exact.stream(bank, t, np.ones_like(t))
    assert np.abs(got - t**order / gamma(1 + order)).max() < 1e-8


@pytest.mark.parametrize("design", [ExponentialSum(32), Crone(1e-2, 1e2, 3)], ids=repr)
def test_running_past_the_horizon_warns_once_and_computes_nothing_for_it(design, monkeypatch):
    bank = Bank(design, [0.3, 0.7], step=0.1, horizon=2.0)

    def diagnose(*_, **__):
        raise AssertionError("diagnostics inside a tick")

    # A tick at its deadline: neither errors nor coefficients may be worked out in it.
    for name in ("kernel", "kernel_error", "frequency_response", "modes_of"):
        monkeypatch.setattr(response, name, diagnose)
    monkeypatch.setattr(type(design), "coefficients", diagnose)
    value = np.ones(2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(21):
            bank.update(value, value)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        for _ in range(50):
            bank.update(value, value)
    assert [w.category for w in seen] == [FpidWarning]
    assert "horizon of 2 s" in str(seen[0].message)
    assert "fractional.report" in str(seen[0].message)
    assert seen[0].filename == __file__


def test_recorded_and_streamed_agree_to_rounding():
    order = np.array([0.0, 0.2, 0.5, 0.93, 1.0])
    value, rate = _signal(500, (5,))
    for design in MODAL:
        for word in ("caputo", "riemann_liouville", "grunwald_letnikov"):
            for slope in (rate, None):
                bank = Bank(
                    design,
                    order,
                    step=STEP,
                    horizon=0.6,
                    initialisation=word,
                    rate="differenced" if slope is None else "measured",
                )
                got = run_modes(
                    design, order, value, slope, step=STEP, horizon=0.6, initialisation=word
                )
                want = exact.stream(bank, value, slope)
                assert np.abs(got - want).max() < 1e-11 * np.abs(want).max()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"order": 1.2}, r"order: expected a number in \[0, 1\], got 1.2"),
        ({"order": [0.5, -0.1]}, r"order\.1: expected a number in \[0, 1\], got -0.1"),
        ({"order": [0.5, np.nan]}, r"order\.1: expected a number"),
        ({"step": 0.0}, "step: expected a number > 0, got 0"),
        ({"horizon": 1e-3}, r"horizon: expected more than one step \(0.001 s\), got 0.001 s"),
        ({"initialisation": "caputto"}, "did you mean caputo"),
        ({"rate": "known"}, "rate: expected one of measured, differenced"),
        ({"design": "crone"}, "design: expected a fractional design, got str"),
    ],
)
def test_bad_arguments_are_named(change, words):
    arguments = {"design": ExponentialSum(), "order": 0.5, "step": STEP, "horizon": 1.0} | change
    design, order = arguments.pop("design"), arguments.pop("order")
    with pytest.raises(ArgumentError, match=words):
        Bank(design, order, **arguments)


@pytest.mark.parametrize("design", [ExponentialSum(), L1()], ids=repr)
def test_wrong_samples_are_named(design):
    bank = Bank(design, [0.1, 0.2], step=STEP)
    for _ in range(2):
        with pytest.raises(ArgumentError, match="rate: expected the signal's rate"):
            bank.update(np.zeros(2))
        with pytest.raises(ArgumentError, match=r"value: expected numbers of shape \(2,\).*\(3,\)"):
            bank.update(np.zeros(3), np.zeros(2))
        with pytest.raises(ArgumentError, match=r"rate: expected numbers of shape \(2,\).*\(3,\)"):
            bank.update(np.zeros(2), np.zeros(3))
        bank.update(np.zeros(2), np.zeros(2))
    differenced = Bank(design, [0.1, 0.2], step=STEP, rate="differenced")
    for _ in range(2):
        with pytest.raises(ArgumentError, match="rate: expected none"):
            differenced.update(np.zeros(2), np.zeros(2))
        differenced.update(np.zeros(2))
    with pytest.raises(ArgumentError, match=r"hold: expected booleans of shape \(2,\).*\(3,\)"):
        bank.update(np.zeros(2), np.zeros(2), hold=np.zeros(3, dtype=bool))
    with pytest.raises(ArgumentError, match=r"order: expected shape \(2,\)"):
        bank.set_order([0.1, 0.2, 0.3])
    with pytest.raises(ArgumentError, match="order: expected a number in"):
        bank.set_order(1.5)
    with pytest.raises(ArgumentError, match="ramp: expected a number >= 0"):
        bank.set_order(0.5, ramp=-1.0)
