"""The fixed-step simulation of arms under control, one or thousands in lockstep."""

from fpid_pin.simulation.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.simulation.disturbances import Cosine, Disturbance, Pulse, Sum
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.metrics import Metrics
from fpid_pin.simulation.paper import paper_controller, paper_experiment
from fpid_pin.simulation.plant import Plant
from fpid_pin.simulation.recorders import Outcome, Recorder
from fpid_pin.simulation.references import Hold, Reference, Sinusoid
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.sensors import Sensors
from fpid_pin.simulation.simulate import evaluate, simulate

__all__ = [
    "Cosine",
    "Cost",
    "Disturbance",
    "Experiment",
    "Hold",
    "MetricCost",
    "Metrics",
    "Outcome",
    "Plant",
    "Pulse",
    "QuadraticCost",
    "Recorder",
    "Reference",
    "Run",
    "Sensors",
    "Sinusoid",
    "Sum",
    "evaluate",
    "paper_controller",
    "paper_experiment",
    "simulate",
]
