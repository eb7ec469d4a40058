import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import RobustCost, SearchSettings, Space, scenarios, tune
from fpid_pin.tuning.problem import over_scenarios

EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)


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
    space = Space(integral_order=(0, 1), derivative_order=(0, 1))
    cost = RobustCost(QuadraticCost(1, 0), reduce)
    result = tune(varied, CONTROLLER, space, cost, SearchSettings(population=6, generations=3))
    each = [fp.evaluate(e, [result.controller], cost)[0] for e in varied]
    assert result.cost == pytest.approx(by_hand(each), rel=1e-15)
    plain = fp.evaluate(varied[0], [result.controller], QuadraticCost(1, 0))[0]
    assert each[0] == plain


def test_one_divergence_is_enough():
    table = np.array([[1.0, 2.0], [3.0, np.inf], [np.nan, 1.0]])
    assert np.array_equal(over_scenarios(RobustCost(), table[:2]), [3.0, np.inf])
    assert np.array_equal(over_scenarios(QuadraticCost(), table[:2]), [2.0, np.inf])
    assert np.array_equal(over_scenarios(RobustCost(), table), [np.inf, np.inf])


def test_it_has_a_table():
    cost = RobustCost(MetricCost("itae", joint_weights=(1, 2)), "mean")
    again = descriptions.from_dict(descriptions.to_dict(cost), Cost)
    assert descriptions.to_dict(again) == descriptions.to_dict(cost)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"cost": 1}, "robust_cost.cost: expected a Cost"),
        ({"cost": RobustCost()}, "robust_cost.cost: expected the cost of one run"),
    ],
)
def test_bad_input(arguments, said):
    with pytest.raises(ArgumentError) as error:
        RobustCost(**arguments)
    assert said in str(error.value)
