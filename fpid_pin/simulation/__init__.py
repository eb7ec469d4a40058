"""The fixed-step simulation of arms under control."""

from fpid_pin.simulation.comparison import Comparison, compare
from fpid_pin.simulation.entry import cost_of, evaluate, simulate
from fpid_pin.simulation.experiment import (
    Experiment,
    Outcome,
    Plant,
    Sensors,
    paper_controller,
    paper_experiment,
)
from fpid_pin.simulation.recorded import Exceedance, limit_report, metrics_of
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.toml import to_toml

__all__ = [
    "Comparison", "Exceedance", "Experiment", "Outcome", "Plant", "Run", "Sensors", "compare",
    "cost_of", "evaluate", "limit_report", "metrics_of", "paper_controller", "paper_experiment",
    "simulate", "to_toml",
]  # fmt: skip
