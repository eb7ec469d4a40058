"""Adaptive fractional-order PID control of robot arms on Pinocchio.

>>> import fpid_pin as fp
>>> run = fp.simulate(fp.paper_experiment(duration=1.0), fp.paper_controller())
>>> str(run.outcome)
'completed at 1 s'

What most programs need is here; the rest is in rooms: `fp.references.Sinusoid`,
`fp.disturbances.Pulse`, `fp.costs.QuadraticCost`, `fp.tuning.Space`, `fp.fractional.caputo`, ...
"""

from fpid_pin import (
    arms,
    control,
    costs,
    disturbances,
    exceptions,
    export,
    fractional,
    progress,
    references,
    simulation,
    tuning,
    view,
)
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.control import (
    AdaptiveFpid,
    ComputedTorque,
    Controller,
    GravityOnly,
    PdGravity,
    Pid,
    Safeguards,
    SlidingMode,
    SlotineLi,
    SuggestedFpid,
    Supervisor,
    stability_report,
    suggest_gains,
)
from fpid_pin.descriptions import described
from fpid_pin.exceptions import FpidError, FpidWarning
from fpid_pin.export import export_c
from fpid_pin.simulation import (
    Experiment,
    Plant,
    Run,
    Sensors,
    evaluate,
    paper_controller,
    paper_experiment,
    simulate,
)
from fpid_pin.tuning import pareto, tune

__all__ = [
    "AdaptiveFpid",
    "Arm",
    "ComputedTorque",
    "Controller",
    "Experiment",
    "FpidError",
    "FpidWarning",
    "GravityOnly",
    "PdGravity",
    "Pid",
    "Plant",
    "Run",
    "Safeguards",
    "Sensors",
    "SlidingMode",
    "SlotineLi",
    "SuggestedFpid",
    "Supervisor",
    "__version__",
    "arms",
    "control",
    "costs",
    "described",
    "disturbances",
    "evaluate",
    "exceptions",
    "export",
    "export_c",
    "fractional",
    "paper_controller",
    "paper_experiment",
    "pareto",
    "progress",
    "references",
    "simulate",
    "simulation",
    "stability_report",
    "suggest_gains",
    "tune",
    "tuning",
    "view",
]
