"""Find the trade-off between tracking error and the variation of the torque, by NSGA-II."""

import fpid_pin as fp
from fpid_pin.tuning import SearchSettings, Space, pareto


def main() -> None:
    front = pareto(
        fp.paper_experiment(duration=4.0, step=2e-3),  # [s]
        fp.paper_controller(supervised=False),
        Space(integral_order=(0, 1), derivative_order=(0, 1), kd=(2, 60, "log")),
        (fp.costs.MetricCost("ise"), fp.costs.MetricCost("total_variation")),
        SearchSettings(population=24, generations=10),
    )
    print(f"{len(front)} controllers, none better than another in both")
    print("int e^2, rad^2 s   variation, N m   lambda            mu")
    for controller, (error, variation) in zip(front.controllers, front.costs, strict=True):
        orders = (controller.integral_order, controller.derivative_order)
        texts = "   ".join(f"{order[0]:.3f} {order[1]:.3f}" for order in orders)
        print(f"{error:16.4f} {variation:16.1f}   {texts}")


if __name__ == "__main__":
    main()
