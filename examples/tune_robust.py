"""Tune gains and orders for the worst of several payloads that the controller does not know of."""

import fpid_pin as fp
from fpid_pin.tuning import RobustCost, SearchSettings, Space, scenarios, tune


def main() -> None:
    experiment = fp.paper_experiment(
        duration=4.0,  # [s]
        step=2e-3,  # [s]
    )
    loaded = scenarios(experiment, payloads=(0.0, 0.5, 1.0))  # [kg] at the tool
    controller = fp.paper_controller(supervised=False)
    space = Space(
        integral_order=(0, 1, "shared"),  # one for both joints
        derivative_order=(0, 1, "shared"),
        kp=(5, 50, "log"),  # [N m / rad]
        kd=(5, 50, "log"),
    )
    worst = RobustCost(fp.costs.QuadraticCost(1.0, 1e-4), "worst")
    budget = SearchSettings(population=16, generations=8)
    robust = tune(loaded, controller, space, worst, budget)
    nominal = tune(experiment, controller, space, worst.cost, budget)
    print("payload, kg      0       0.5     1.0")
    for name, result in (("for the worst", robust), ("for 0 kg", nominal)):
        costs = fp.evaluate(loaded, result.controller, worst.cost)
        print(f"{name:14s}", "  ".join(f"{cost:.4f}" for cost in costs))


if __name__ == "__main__":
    main()
