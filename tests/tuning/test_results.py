"""The start takes part, the result says what it is worth, a profile what mattered; many plants."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import RobustCost, SearchSettings, Space, problem, profile, scenarios, tune
from fpid_pin.tuning.problem import over_scenarios
from fpid_pin.view import plots

EXPERIMENT = fp.paper_experiment(duration=0.4, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)
TRACKING = QuadraticCost(1.0, 0.0)
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))
SHORT = SearchSettings(population=4, generations=1)


def searched(controller, space, **changes):
    return tune(EXPERIMENT, controller, space, TRACKING, dataclasses.replace(SHORT, **changes))


def test_a_start_that_cannot_be_beaten_is_the_result():
    good = searched(CONTROLLER, ORDERS, population=16, generations=8).controller
    # Every other point of this space is worse: kp is lower than it should be.
    start = dataclasses.replace(good, kp=(40.0, 40.0))
    result = searched(start, Space(kp=(0.1, 0.2)))
    assert result.cost == result.start_cost == fp.evaluate(EXPERIMENT, [start], TRACKING)[0]
    assert np.array_equal(result.parameters["kp"], (40.0, 40.0))
    assert result.controller.name == "tuned"
    assert result.gain == 0.0
    assert "was not improved on" in result.advice[0]


def test_a_start_that_diverges_is_no_rival():
    wild = dataclasses.replace(CONTROLLER, kd=(5000.0, 5000.0))
    result = searched(wild, Space(kd=(1, 30)), population=8)
    assert result.start_cost == np.inf
    assert np.isfinite(result.cost)
    assert result.gain == 1.0
    assert "a run that diverges" in result.advice[0]


def test_a_start_whose_rates_are_a_row_for_each_gain_takes_part():
    suggested = fp.suggest_gains(fp.Arm.two_link(), 8.0)
    assert np.shape(suggested.learning_rate) == (3, 2)
    space = Space(learning_rate=(1e-3, 30, "log", "shared"), kp=(20, 200, "log"))
    result = searched(suggested, space, generations=2)
    assert result.cost <= result.start_cost
    bound = space.bind(suggested, 2)
    assert bound.numbers(suggested)[0] == pytest.approx(np.mean(suggested.learning_rate))
    left = fp.SuggestedFpid()
    half = Space(derivative_order=(0.6, 1.0, "shared")).bind(left, 2)
    assert np.isnan(half.numbers(left)).all()
    assert half.nearest(left) == pytest.approx([0.5])


def test_what_lies_at_a_bound_is_named():
    # More is better here, up to where the space ends.
    result = searched(CONTROLLER, Space(kp=(1, 12, "shared"), kd=(1, 200)), population=24,
                      generations=12)  # fmt: skip
    assert "kp" in result.at_bounds
    assert type(result.parameters["kp"]) is float
    assert any(line.startswith("At a bound: kp") for line in result.advice)


def history_of(result, best):
    best = np.asarray(best, dtype=float)[:, np.newaxis]
    return dataclasses.replace(
        result, history=dataclasses.replace(result.history, best=best, mean=best)
    )


def test_advice_follows_the_last_quarter():
    result = searched(CONTROLLER, ORDERS)
    assert np.isnan(result.late_gain)
    assert "Only 1 generations: go on" in result.advice[-1]
    flat = history_of(result, np.r_[np.linspace(2.0, 1.0, 30), np.full(10, 1.0)])
    assert flat.late_gain == 0.0
    assert flat.advice[-1].startswith("The search has settled")
    falling = history_of(result, np.linspace(2.0, 1.0, 41))
    assert falling.late_gain == pytest.approx(1.0 - 1.0 / 1.25)
    assert "saved 20 %: go on" in falling.advice[-1]
    apart = dataclasses.replace(flat, costs=np.array([1.0, 1.2]))
    assert apart.advice[-1].startswith("The seeds differ by 13 %")


class Bowl(Cost):
    """Stands in for a run: a cost whose curvature along each parameter is known."""

    def of(self, metrics):
        raise NotImplementedError


def test_a_profile_is_the_cost_along_each_parameter(monkeypatch):
    weights = np.array([4.0, 0.0])

    def costs(experiments, controllers, costs, **others):
        kp = np.array([c.kp for c in controllers])
        return (1.0 + (weights * (kp - 2.0) ** 2).sum(axis=1))[:, np.newaxis]

    monkeypatch.setattr(problem, "evaluate", costs)
    law = dataclasses.replace(CONTROLLER, kp=(2.0, 2.0))
    found = profile(EXPERIMENT, law, Space(kp=(1, 5)), Bowl(), points=5)
    assert found.labels == ("kp.0", "kp.1")
    assert found.cost == 1.0
    assert found.values == pytest.approx(np.tile([1.0, 2.0, 3.0, 4.0, 5.0], (2, 1)))
    assert found.costs[0] == pytest.approx([5.0, 1.0, 5.0, 17.0, 37.0])
    assert found.costs[1] == pytest.approx(np.ones(5))
    # A tenth of the range is 0.4: 4 x 0.16.
    assert found.rises == pytest.approx([0.64, 0.0])
    # Of a cost that is 0 whatever is moved, as that of settling may be, nothing costs anything.
    free = dataclasses.replace(found, costs=0.0 * found.costs, nudged=np.zeros((2, 2)), cost=0.0)
    assert free.advice[0].startswith("Hardly matters")
    assert plots.profile(free.labels, free.values, free.costs, free.cost).axes[0].get_ylim()[1] > 0
    assert found.advice == [
        "What a tenth of its range costs: kp.0 (64 %).", "Hardly matters: kp.1."
    ]  # fmt: skip
    with pytest.raises(ArgumentError, match="kp: expected within"):
        profile(EXPERIMENT, law, Space(kp=(3, 5)), Bowl())
    with pytest.raises(ArgumentError, match="points"):
        profile(EXPERIMENT, law, Space(kp=(1, 5)), Bowl(), points=1)


def test_every_plant_with_every_payload():
    plants = [None, fp.Plant(viscous_friction=2.0)]
    varied = scenarios(EXPERIMENT, plants=plants, payloads=(0.0, 0.5, 1.0))
    assert len(varied) == 6
    assert varied[0].plant is None
    assert varied[3].plant is plants[1]
    q = np.zeros(2)
    nominal = EXPERIMENT.arm.gravity_vector(q)
    loaded = varied[5].plant.arm.gravity_vector(q)
    # 1 kg at the tool of an arm stretched out to 1.8 m, 0.8 m beyond the second joint.
    np.testing.assert_allclose(loaded - nominal, 9.8 * np.array([1.8, 0.8]), rtol=1e-12)
    assert (np.asarray(varied[5].plant.viscous_friction) == 2.0).all()
    assert varied[5].arm is EXPERIMENT.arm


@pytest.mark.parametrize(("reduce", "by_hand"), [("worst", np.max), ("mean", np.mean)])
def test_the_robust_cost_of_the_best_is_that_of_its_runs(reduce, by_hand):
    varied = scenarios(EXPERIMENT, payloads=(0.0, 0.4, 0.8))
    cost = RobustCost(TRACKING, reduce)
    result = tune(varied, CONTROLLER, ORDERS, cost, SearchSettings(population=6, generations=3))
    each = [fp.evaluate(e, [result.controller], cost)[0] for e in varied]
    assert result.cost == pytest.approx(by_hand(each), rel=1e-15)
    plain = fp.evaluate(varied[0], [result.controller], TRACKING)[0]
    assert each[0] == plain


def test_one_divergence_is_enough():
    table = np.array([[1.0, 2.0], [3.0, np.inf], [np.nan, 1.0]])
    assert np.array_equal(over_scenarios(RobustCost(), table[:2]), [3.0, np.inf])
    assert np.array_equal(over_scenarios(QuadraticCost(), table[:2]), [2.0, np.inf])
    assert np.array_equal(over_scenarios(RobustCost(), table), [np.inf, np.inf])


def test_a_robust_cost_is_of_the_cost_of_one_run_and_has_a_table():
    cost = RobustCost(MetricCost("itae", joint_weights=(1, 2)), "mean")
    again = descriptions.from_dict(descriptions.to_dict(cost), Cost)
    assert descriptions.to_dict(again) == descriptions.to_dict(cost)
    for wrong, said in ((1, "a Cost"), (RobustCost(), "the cost of one run")):
        with pytest.raises(ArgumentError, match=f"robust_cost.cost: expected {said}"):
            RobustCost(wrong)
