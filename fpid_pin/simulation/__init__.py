"""The fixed-step simulation of arms under control."""

from fpid_pin.simulation.blocks import Outcome
from fpid_pin.simulation.entry import evaluate, simulate
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import Exceedance, limit_report, overloaded_joints
from fpid_pin.simulation.metrics import cost_of, metrics_of
from fpid_pin.simulation.paper import paper_controller, paper_experiment
from fpid_pin.simulation.plant import Plant
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.sensors import Sensors

__all__ = [
    "Exceedance",
    "Experiment",
    "Outcome",
    "Plant",
    "Run",
    "Sensors",
    "cost_of",
    "evaluate",
    "limit_report",
    "metrics_of",
    "overloaded_joints",
    "paper_controller",
    "paper_experiment",
    "simulate",
]
