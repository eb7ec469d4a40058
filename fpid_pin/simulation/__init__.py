"""The fixed-step simulation of arms under control, one or thousands in lockstep."""

from fpid_pin.simulation.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.simulation.disturbances import Cosine, Disturbance, Pulse, Sum
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import Exceedance, limit_report, overloaded_joints
from fpid_pin.simulation.metrics import Metrics
from fpid_pin.simulation.paper import paper_controller, paper_experiment
from fpid_pin.simulation.plant import Plant
from fpid_pin.simulation.recorders import Outcome, Recorder
from fpid_pin.simulation.references import Hold, Reference, Sinusoid
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.sensors import Sensors
from fpid_pin.simulation.simulate import evaluate, simulate
from fpid_pin.simulation.tool_path import ToolCircle
from fpid_pin.simulation.trajectories import Quintic, RecordedMotion, Waypoints

__all__ = [
    "Cosine",
    "Cost",
    "Disturbance",
    "Exceedance",
    "Experiment",
    "Hold",
    "MetricCost",
    "Metrics",
    "Outcome",
    "Plant",
    "Pulse",
    "QuadraticCost",
    "Quintic",
    "RecordedMotion",
    "Recorder",
    "Reference",
    "Run",
    "Sensors",
    "Sinusoid",
    "Sum",
    "ToolCircle",
    "Waypoints",
    "evaluate",
    "limit_report",
    "overloaded_joints",
    "paper_controller",
    "paper_experiment",
    "simulate",
]
