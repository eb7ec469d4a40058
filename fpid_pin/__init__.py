"""Adaptive fractional-order PID control of robot arms on Pinocchio.

>>> import fpid_pin as fp
>>> run = fp.simulate(fp.paper_experiment(duration=1.0), fp.paper_controller())
>>> str(run.outcome)
'completed at 1 s'
"""

from fpid_pin import exceptions, fractional
from fpid_pin.arms import Arm
from fpid_pin.control import (
    AdaptiveFpid,
    ComputedTorque,
    Controller,
    Loop,
    Safeguards,
    State,
    Supervisor,
)
from fpid_pin.exceptions import (
    ArgumentError,
    ArmError,
    ConfigError,
    DesignError,
    FileFormatError,
    FpidError,
    FpidWarning,
    SimulationError,
    TuningError,
)
from fpid_pin.simulation import (
    Cosine,
    Cost,
    Disturbance,
    Experiment,
    Hold,
    MetricCost,
    Metrics,
    Outcome,
    Plant,
    Pulse,
    QuadraticCost,
    Recorder,
    Reference,
    Run,
    Sensors,
    Sinusoid,
    Sum,
    evaluate,
    paper_controller,
    paper_experiment,
    simulate,
)

__version__ = "0.1.0"

__all__ = [
    "AdaptiveFpid",
    "ArgumentError",
    "Arm",
    "ArmError",
    "ComputedTorque",
    "ConfigError",
    "Controller",
    "Cosine",
    "Cost",
    "DesignError",
    "Disturbance",
    "Experiment",
    "FileFormatError",
    "FpidError",
    "FpidWarning",
    "Hold",
    "Loop",
    "MetricCost",
    "Metrics",
    "Outcome",
    "Plant",
    "Pulse",
    "QuadraticCost",
    "Recorder",
    "Reference",
    "Run",
    "Safeguards",
    "Sensors",
    "SimulationError",
    "Sinusoid",
    "State",
    "Sum",
    "Supervisor",
    "TuningError",
    "evaluate",
    "exceptions",
    "fractional",
    "paper_controller",
    "paper_experiment",
    "simulate",
]
