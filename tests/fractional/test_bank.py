import warnings

import exact_derivatives as exact
import numba
import numpy as np
import pytest
from scipy.special import gamma

from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.fractional import L1, Bank, Crone, Design, ExponentialSum, caputo

STEP = 1e-3
#: Without compilation (test_line_by_line) a few go through every branch.
SAMPLES = 30 if numba.config.DISABLE_JIT else 300
MODAL = [ExponentialSum(24), Crone(1e-2, 1e3, 5)]
STARTS = ["caputo", "riemann_liouville", "grunwald_letnikov"]


def signal(samples, shape, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(samples).reshape((-1,) + (1,) * len(shape)) * STEP
    a, w, p = rng.uniform(0.5, 2, shape), rng.uniform(1, 40, shape), rng.uniform(0, 6, shape)
    return a * np.sin(w * t + p) + 0.3, a * w * np.cos(w * t + p)


def bank_of(design, order, **options):
    return Bank(design, order, **({"step": STEP, "horizon": 1.0} | options))


@pytest.mark.kernels
@pytest.mark.parametrize("design", MODAL, ids=repr)
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
def test_recorded_and_streamed_agree_and_orders_0_and_1_are_exact(design, start, rule):
    order = np.array([0.0, 0.2, 0.5, 0.93, 1.0])
    value, rate = signal(SAMPLES, (5,))
    given = rate if rule == "measured" else None
    bank = bank_of(design, order, initialisation=start, rate=rule)
    out = exact.stream(bank, value, given)
    assert np.abs(bank.recorded(value, given) - out).max() < 1e-11 * np.abs(out).max()
    assert np.array_equal(out[:, 0], value[:, 0])
    if rule == "measured":
        assert np.array_equal(out[:, 4], rate[:, 4])
    bank.reset()
    assert np.array_equal(exact.stream(bank, value, given), out)


@pytest.mark.parametrize("design", [ExponentialSum(24), ExponentialSum(7), Crone()], ids=repr)
@pytest.mark.parametrize("rule", ["measured", "differenced"])
def test_a_population_has_the_same_bits_whole_in_chunks_and_alone(design, rule):
    order = np.random.default_rng(5).uniform(0.0, 1.0, (2, 64, 2))
    order[0, 3], order[1, 4] = 0.0, 1.0
    value, rate = signal(10, order.shape)

    def run(part):
        bank = bank_of(design, order[part], horizon=20.0, rate=rule)
        at = (slice(None), *part)
        return exact.stream(bank, value[at], rate[at] if rule == "measured" else None)

    whole = run((slice(None),))
    for chunk in (1, 17, 60):
        parts = [run((slice(None), slice(i, i + chunk))) for i in range(0, 64, chunk)]
        assert np.array_equal(np.concatenate(parts, axis=2), whole)
    if isinstance(design, ExponentialSum):
        assert np.array_equal(run((1, 5, 1)), whole[:, 1, 5, 1])


def test_a_changed_order_gives_what_the_new_order_would_have_given_from_the_start():
    first, second = np.array([0.2, 0.9, 0.0, 0.5]), np.array([0.7, 0.0, 0.3, 1.0])
    value, rate = signal(400, (4,))
    bank = bank_of(ExponentialSum(24), first)
    want = exact.stream(bank_of(ExponentialSum(24), second), value, rate)
    exact.stream(bank, value[:200], rate[:200])
    bank.set_order(second)
    assert np.array_equal(exact.stream(bank, value[200:], rate[200:]), want[200:])


def test_a_rate_bias_leaves_no_drift_over_ten_minutes():
    step, bias, order = 0.01, 0.005, np.array([0.05, 0.5, 0.95])
    t = np.repeat(np.arange(60_001)[:, None] * step, 3, axis=1)
    bank = bank_of(ExponentialSum(24), order, step=step, horizon=600.0)
    biased, clean = (bank.recorded(np.sin(t), np.cos(t) + b) for b in (bias, 0.0))
    effect = np.abs(biased - clean)
    accumulated = bias * (600.0 ** (1 - order) - 1.0) / gamma(2 - order)
    assert (np.abs(effect[1000:] - effect[1000]).max(axis=0) < 1e-3 * accumulated).all()
    # What stays is the part of the operator that is the newest rate itself: all of it at order 1.
    assert (effect[-1] < bias * step ** (1 - order)).all()


def test_a_rate_that_is_not_known_gives_streamed_l1():
    t = np.arange(5001) * STEP
    order = np.round(np.arange(1, 20) / 20, 2)
    value = np.repeat((np.sin(t) + 0.2 * np.sin(31 * t))[:, None], 19, axis=1)
    streamed = bank_of(ExponentialSum(32), order, horizon=5.0, rate="differenced").recorded(value)
    assert np.abs(streamed - caputo(value, order, STEP, axis=0, design=L1())).max() < 1e-8


@pytest.mark.parametrize("design", [ExponentialSum(32), Crone(1e-2, 1e2, 3)], ids=repr)
def test_running_past_the_horizon_warns_once_and_computes_nothing_for_it(design, monkeypatch):
    bank = bank_of(design, [0.3, 0.7], step=0.1, horizon=2.0)

    def refuse(*_, **__):
        raise AssertionError("coefficients inside a tick, which has a deadline")

    monkeypatch.setattr(type(design), "coefficients", refuse)
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


def test_what_an_update_returns_is_the_caller_s_and_stays_as_it_is():
    value, rate = signal(50, (2,))
    bank = bank_of(ExponentialSum(24), [0.3, 0.7])
    kept = [bank.update(*sample) for sample in zip(value, rate, strict=True)]
    assert np.array_equal(kept, exact.stream(bank_of(ExponentialSum(24), [0.3, 0.7]), value, rate))


class Odd(Design):
    def coefficients(self, order, *, step, horizon):
        return 3


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
        ({"design": Odd()}, "design: expected one with modes, got Odd"),
        ({"design": L1()}, "design: expected one with modes, got L1"),
    ],
)
def test_bad_arguments_are_named(change, words):
    arguments = {"design": ExponentialSum(), "order": 0.5} | change
    with pytest.raises(ArgumentError, match=words):
        bank_of(arguments.pop("design"), arguments.pop("order"), **arguments)


def test_wrong_samples_are_named():
    bank, differenced = (
        bank_of(ExponentialSum(), [0.1, 0.2], rate=r) for r in ("measured", "differenced")
    )
    two, three = np.zeros(2), np.zeros(3)
    for _ in range(2):
        for words, *samples in (
            ("rate: expected the signal's rate", two),
            (r"value: expected numbers of shape \(2,\).*\(3,\)", three, two),
            (r"rate: expected numbers of shape \(2,\).*\(3,\)", two, three),
        ):
            with pytest.raises(ArgumentError, match=words):
                bank.update(*samples)
        with pytest.raises(ArgumentError, match="rate: expected none"):
            differenced.update(two, two)
        bank.update(two, two)
        differenced.update(two)
    for words, *record in (
        (r"value: expected shape \(5, 2\), got shape \(5, 3\)", np.zeros((5, 3))),
        (r"value: expected shape \(1, 2\), got shape \(0, 2\)", np.zeros((0, 2))),
        (r"rate: expected shape \(5, 2\), got shape \(4, 2\)", np.zeros((5, 2)), np.zeros((4, 2))),
    ):
        with pytest.raises(ArgumentError, match=words):
            bank.recorded(*record)
    for words, order in (
        (r"order: expected shape \(2,\)", [0.1, 0.2, 0.3]),
        ("order: expected a number in", 1.5),
    ):
        with pytest.raises(ArgumentError, match=words):
            bank.set_order(order)
