"""Tune the orders of the paper's controller by a genetic algorithm, with two worker processes.

A small budget, so that it takes seconds; the paper's is 60 candidates, 80 generations and 20 s at
1 ms, which are the defaults of `tune` and `paper_experiment`.
"""

import fpid_pin as fp
from fpid_pin.tuning import SearchProgress, SearchSettings, Space, tune


def show(progress: SearchProgress) -> None:
    if progress.complete and progress.generation % 5 == 0:
        print(f"generation {progress.generation}: best {progress.best:.5f}")


def main() -> None:
    experiment = fp.paper_experiment(
        duration=5.0,  # [s]
        step=2e-3,  # [s]
    )
    published = fp.paper_controller(supervised=False)
    cost = fp.costs.QuadraticCost(
        w1=1.0,  # [1] / [rad^2 s]
        w2=1e-4,  # [1] / [(N m)^2 s]
    )
    result = tune(
        experiment,
        published,
        Space(integral_order=(0, 1), derivative_order=(0, 1)),  # an order for each joint
        cost,
        SearchSettings(population=20, generations=10, seeds=(0, 1), workers=2),
        progress=show,
    )
    before = fp.evaluate(experiment, [published, fp.paper_controller("integer")], cost)
    print(result)
    print(f"published orders cost {before[0]:.5f}, integer orders {before[1]:.5f}")
    print(f"lambda {result.controller.integral_order}, mu {result.controller.derivative_order}")


# Worker processes import this file: the work must not start again in each of them.
if __name__ == "__main__":
    main()
