"""Statistics of campaigns against closed forms, other sources, and their own promises."""

import numpy as np
import pytest
import scipy.stats
from studies import campaign

from fpid_pin.campaign import statistics

CAMPAIGNS = 2000


def missed(covered):
    """How far a coverage is from 95 %, in points."""
    return abs(100.0 * np.mean(covered) - 95.0)


@pytest.mark.parametrize(("successes", "runs"), [(0, 1), (50, 50), (37, 50)])
def test_wilsons_interval_has_its_closed_form(successes, runs):
    """Its ends solve (p - s/n)^2 = z^2 p (1 - p)/n; E. B. Wilson, 1927."""
    ours = statistics.wilson(successes, runs)
    z2 = scipy.stats.norm.ppf(0.975) ** 2 / runs
    ends = np.roots([1.0 + z2, -2.0 * ours.estimate - z2, ours.estimate**2])
    assert ours.estimate == successes / runs
    assert ours[1:] == pytest.approx(sorted(ends), abs=1e-12)


def test_saturated_has_come_to_its_end_and_what_is_not_finite_is_as_bad_as_lost():
    outcome = np.array([["completed"], ["saturated"], ["diverged"], ["failed"], ["completed"]])
    data = campaign([[1.0], [1.0], [1.0], [1.0], [np.inf]], outcome=outcome)
    assert statistics.success_rates(data)[0].estimate == 0.4
    assert np.isinf(statistics.scored(data)[2:]).all()
    # Also a metric that is not a number, of a run that succeeded.
    data = campaign([[1.0], [2.0]])
    data.metrics["energy"][0] = np.nan
    assert statistics.scored(data, "energy")[:, 0].tolist() == [np.inf, 6.0]
    assert statistics.scored(data)[:, 0].tolist() == [1.0, 2.0]


def test_a_median_counts_the_plants_that_were_lost_and_no_runs_say_nothing():
    nothing = statistics.wilson(0, 0)
    assert np.isnan(nothing.estimate)
    assert nothing[1:] == (0.0, 1.0)
    assert statistics.quantile(np.array([1.0, 2.0, np.inf]), 0.5) == 2.0
    assert statistics.quantile(np.array([1.0, np.inf, np.inf]), 0.5) == np.inf
    assert np.isnan(statistics.quantile(np.array([]), 0.5))


def test_the_bootstraps_interval_covers_in_95_of_100_campaigns():
    """Of skewed differences, where a normal interval of the mean would not."""
    rng = np.random.default_rng(1)
    covered = []
    for k in range(500):
        plant = rng.lognormal(0.0, 1.0, 80)
        gain = rng.lognormal(0.0, 1.0, 80)  # median 1
        data = campaign(np.stack([plant + gain, plant], axis=1), seed=k)
        found = statistics.paired_difference(data, 0, 1).median
        covered.append(found.low <= 1.0 <= found.high)
    assert missed(covered) <= 1.5


def test_a_plant_that_is_lost_counts_against_who_lost_it_and_in_no_median():
    errors = [[1.0, 2.0]] * 30 + [[np.nan, 2.0]] * 10 + [[np.nan, np.nan]] * 5 + [[3.0, 3.0]] * 5
    found = statistics.paired_difference(campaign(errors), 0, 1)
    assert (found.runs, found.differing) == (35, 40)
    assert found.median == (-1.0, -1.0, -1.0)
    assert found.better == statistics.wilson(30, 40)


def test_two_that_are_equal_or_never_meet_have_no_difference():
    tied = statistics.paired_difference(campaign([[1.0, 1.0]] * 30), 0, 1)
    assert tied.median == (0.0, 0.0, 0.0)
    assert tied.differing == 0
    apart = statistics.paired_difference(campaign([[1.0, np.nan], [np.nan, 1.0]]), 0, 1)
    assert apart.runs == 0
    assert np.isnan(apart.median.estimate)
    assert apart.better.estimate == 0.5


def test_spearmans_rho_is_scipys_with_ties_and_lost_runs_on_the_last_rank():
    rng = np.random.default_rng(4)
    x = rng.integers(0, 5, (60, 2)).astype(float)
    errors = np.round(rng.random((60, 3)) + 0.1 * x[:, :1], 1)
    errors[errors > 1.0] = np.nan
    found = statistics.spearman(campaign(errors, x))[..., 0]
    for k in range(3):
        for j in range(2):
            ranked = np.where(np.isnan(errors[:, k]), 1e6, errors[:, k])
            assert found[k, j] == pytest.approx(scipy.stats.spearmanr(x[:, j], ranked).statistic)


def test_its_interval_covers_in_95_of_100_campaigns():
    rng = np.random.default_rng(5)
    covered, truth = [], 6.0 / np.pi * np.arcsin(0.25)
    for _ in range(CAMPAIGNS):
        x, y = rng.normal(size=(2, 100))
        error = np.exp(0.5 * x + np.sqrt(0.75) * y)
        _, low, high = statistics.spearman(campaign(error[:, np.newaxis], x[:, np.newaxis]))[0, 0]
        covered.append(low <= truth <= high)
    assert missed(covered) <= 1.5


def test_a_tornado_of_a_straight_line_has_its_medians_at_a_tenth_and_nine():
    x = np.stack([np.linspace(0.0, 1.0, 10_001), np.tile([0.0, 1.0], 5001)[:-1]], axis=1)
    found = statistics.tornado(campaign(3.0 + 2.0 * x[:, :1], x))
    assert found[0, 0] == pytest.approx((3.2, 4.8), abs=1e-3)
    assert found[0, 1] == pytest.approx((4.0, 4.0), abs=1e-3)


@pytest.mark.parametrize("runs", [1, 50])
def test_a_parameter_that_is_constant_has_no_sensitivity(runs):
    data = campaign(np.random.default_rng(6).random((runs, 2)), np.full((runs, 1), 0.1))
    assert np.isnan(statistics.spearman(data)).all()
    assert np.isnan(statistics.tornado(data)).all()


def test_equals_divide_a_plant_and_nobody_has_one_that_all_lost():
    data = campaign([[1.0, 2.0], [1.0, 1.0], [np.nan, 3.0], [np.nan, np.nan]])
    assert statistics.best_shares(data).tolist() == [0.375, 0.375]


def test_the_leader_has_most_successes_then_the_least_median():
    assert statistics.leader(campaign([[1.0, 9.0], [np.nan, 9.0]])) == 1
    assert statistics.leader(campaign([[3.0, 2.0], [3.0, 2.0]])) == 1
    assert statistics.leader(campaign([[np.nan, np.nan]])) == 0


def test_the_worst_runs_are_the_lost_ones_then_the_largest_errors():
    data = campaign([[5.0], [np.nan], [9.0], [1.0], [np.nan]])
    assert statistics.worst_runs(data, 0) == [1, 4, 2, 0, 3]
