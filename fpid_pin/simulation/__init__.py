"""The fixed-step simulation of arms under control."""

from fpid_pin.costs.cost import cost_of
from fpid_pin.costs.metrics import metrics_of
from fpid_pin.simulation.comparison import Comparison, compare
from fpid_pin.simulation.entry import evaluate, simulate
from fpid_pin.simulation.experiment import Experiment, Outcome, Plant, Sensors
from fpid_pin.simulation.limits import Exceedance, limit_report
from fpid_pin.simulation.paper import paper_controller, paper_experiment
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.toml import to_toml

__all__ = [
    "Comparison", "Exceedance", "Experiment", "Outcome", "Plant", "Run", "Sensors", "compare",
    "cost_of", "evaluate", "limit_report", "metrics_of", "paper_controller", "paper_experiment",
    "simulate", "to_toml",
]  # fmt: skip
