"""Intervals that hold however often one looks, and the rules that stop a campaign by them."""

import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from made_campaigns import campaign

from fpid_pin.campaign import stopping
from fpid_pin.exceptions import ArgumentError

LIMIT = np.log(20.0)
RATES = (0.02, 0.5, 0.99)


def chance_of(rate, runs, looks, marked):
    """The chance that a campaign is `marked` at any of its `looks`, exactly.

    `marked`: given successes (0 ... n) and n, which of them are.
    """
    chance, caught = np.array([1.0]), 0.0
    for n in range(1, runs + 1):
        chance = np.append(chance * (1.0 - rate), 0.0) + np.append(0.0, chance * rate)
        if n in looks:
            hit = marked(np.arange(n + 1.0), n)
            caught += chance[hit].sum()
            chance[hit] = 0.0
    return caught


# ---------------------------------------------------------------------- the rate's interval


@pytest.mark.parametrize("rate", RATES)
def test_a_look_after_every_run_misses_the_rate_in_at_most_one_campaign_of_twenty(rate):
    def missed(s, n):
        return stopping.log_capital(s, n, rate, stopping.WEIGHT) >= LIMIT

    every = range(1, 1001)
    assert chance_of(rate, 1000, every, missed) <= 0.05


@pytest.mark.parametrize("weight", [1.0, 300.0])
@pytest.mark.parametrize("rate", [0.5, 0.9])
def test_capital_is_the_averaged_likelihood_ratio(rate, weight):
    s, n = 7, 9
    prior = scipy.stats.beta(weight * rate, weight * (1.0 - rate))
    mean, _ = scipy.integrate.quad(lambda x: prior.pdf(x) * x**s * (1.0 - x) ** (n - s), 0.0, 1.0)
    expected = np.log(mean / (rate**s * (1.0 - rate) ** (n - s)))
    found = stopping.log_capital(np.float64(s), n, rate, weight)
    assert float(found) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("s", "n"), [(0, 0), (1, 1), (0, 500), (250, 500)])
def test_an_interval_holds_every_rate_that_is_not_refuted(s, n):
    _, low, high = stopping.rate_interval(s, n)
    rates = np.linspace(0.001, 0.999, 999)
    held = stopping.log_capital(np.float64(s), n, rates) < LIMIT
    assert (held == ((rates > low) & (rates < high))).all()


# ---------------------------------------------------------------------- the median's interval


def test_a_medians_interval_holds_it_at_every_look():
    rng = np.random.default_rng(3)
    missed = 0
    for values in rng.lognormal(0.0, 1.0, (200, 1500)):
        found = [stopping.median_interval(values[:n]) for n in range(50, 1501, 50)]
        missed += any(not i.low <= 1.0 <= i.high for i in found)
    assert missed / 200 <= 0.05


def test_it_excludes_zero_exactly_where_the_signs_are_not_those_of_a_fair_coin():
    rng = np.random.default_rng(4)
    decided = 0
    for n in rng.integers(1, 200, 300):
        values = rng.normal(rng.uniform(-1.0, 1.0), 1.0, n)
        found = stopping.median_interval(values)
        capital = stopping.log_capital(np.float64((values > 0.0).sum()), int(n), 0.5)
        assert (found.low > 0.0 or found.high < 0.0) == (capital >= LIMIT)
        assert found.low <= found.estimate <= found.high
        decided += found.low > 0.0 or found.high < 0.0
    assert 50 < decided < 250


# ---------------------------------------------------------------------- rules


def test_a_rate_is_known_when_every_controllers_interval_is_short_enough():
    rule = stopping.parse("success +- 0.05", ("A", "B"))
    errors = np.ones((4000, 2))
    errors[::2, 1] = np.nan  # B: one half
    known = [n for n in range(50, 4001, 50) if rule(campaign(errors[:n]))]
    assert known == list(range(known[0], 4001, 50))
    alone = [n for n in range(50, 4001, 50) if rule(campaign(errors[:n, :1]))]
    assert alone[0] < 150 < 700 < known[0] < 1400
    assert "success of B: 50 % of 4000 runs" in rule.judge(campaign(errors))[1]


def test_where_it_stops_the_rate_is_within_what_was_asked_for():
    """Stopped by its own width, at a look after every run, it holds the rate in 95 of 100."""
    rate = 0.95
    rule, wrong, chance = stopping.SuccessWithin(0.1), 0.0, np.array([1.0])
    for n in range(1, 401):
        chance = np.append(chance * (1.0 - rate), 0.0) + np.append(0.0, chance * rate)
        s = np.arange(n + 1.0)
        low, high = stopping.rate_intervals(s, np.full(s.shape, n), rule.weight)
        stops = high - low <= 0.2
        wrong += chance[stops & ((low > rate) | (high < rate))].sum()
        chance[stops] = 0.0
    assert chance.sum() < 1e-9
    assert wrong <= 0.05


def test_equal_controllers_are_told_apart_in_at_most_one_campaign_of_twenty():
    rule, rng = stopping.Decided("A", "B"), np.random.default_rng(6)
    wrong = 0
    for _ in range(300):
        errors = rng.lognormal(0.0, 1.0, (1024, 2))
        errors[rng.random((1024, 2)) < 0.1] = np.nan
        wrong += any(rule(campaign(errors[:n])) for n in range(64, 1025, 64))
    assert wrong / 300 <= 0.05


def test_the_better_one_is_found():
    rule, rng = stopping.parse("B - A", ("A", "B")), np.random.default_rng(7)
    plant = rng.lognormal(0.0, 1.0, 2048)
    data = campaign(np.stack([plant, plant * rng.lognormal(-0.1, 0.3, 2048)], axis=1))
    known, line = rule.judge(data)
    assert known
    assert line.startswith("B - A: RMS error differs by -0.")
    assert "in the median of 2048 plants" in line


def test_losing_a_plant_is_worse_than_any_error_and_losing_it_together_is_nothing():
    rule = stopping.Decided("A", "B")
    both = [[np.nan, np.nan]] * 500
    assert not rule(campaign([*both, [1.0, 1.0]]))
    assert rule(campaign([*both, *[[1e6, np.nan]] * 40]))
    known, line = rule.judge(campaign([*both, *[[1e6, np.nan]] * 40]))
    assert "differs by -inf rad in the median of 40 plants" in line
    assert known


def test_names_may_have_hyphens_and_be_called_success():
    assert stopping.parse("success+/-.01", ("A",)) == stopping.SuccessWithin(0.01)
    names = ("fpid-tuned", "PD - gravity", "success", "A")
    assert stopping.parse("fpid-tuned - PD - gravity", names) == stopping.Decided(*names[:2])
    assert stopping.parse("success-A", names) == stopping.Decided("success", "A")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A - C", r'until: expected "success \+- 0.01", or "A - B" of .*, got \'A - C\''),
        ("success +- x", r"success \+- a number in \(0, 0.5\], got 'success \+- x'"),
        (3, "until: expected a text"),
    ],
)
def test_a_wrong_rule_is_one_line(text, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        stopping.parse(text, ("A", "B"))
    assert "\n" not in str(caught.value)
