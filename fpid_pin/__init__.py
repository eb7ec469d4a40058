"""Adaptive fractional-order PID control of robot arms on Pinocchio.

>>> import fpid_pin as fp
>>> run = fp.simulate(fp.paper_experiment(duration=1.0), fp.paper_controller())
>>> str(run.outcome)
'completed at 1 s'

What most programs need is here; the rest is in rooms: `fp.references.Sinusoid`,
`fp.disturbances.Pulse`, `fp.costs.QuadraticCost`, `fp.tuning.Space`, `fp.fractional.caputo`, ...
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fpid_pin._version import __version__

if TYPE_CHECKING:
    from fpid_pin import (
        arms,
        campaign,
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

_ROOMS = (
    "arms", "campaign", "control", "costs", "descriptions", "disturbances", "exceptions",
    "export", "fractional", "progress", "references", "simulation", "tuning", "view",
)  # fmt: skip
# Where the names live. They are fetched when they are first asked for: a command that needs none
# of them starts at once.
_HOMES = {
    "arms": ("Arm",),
    "control": (
        "AdaptiveFpid", "ComputedTorque", "Controller", "GravityOnly", "PdGravity", "Pid",
        "Safeguards", "SlidingMode", "SlotineLi", "SuggestedFpid", "Supervisor",
        "stability_report", "suggest_gains",
    ),
    "descriptions": ("described",),
    "exceptions": ("FpidError", "FpidWarning"),
    "export": ("export_c",),
    "simulation": (
        "Experiment", "Plant", "Run", "Sensors", "evaluate", "paper_controller",
        "paper_experiment", "simulate",
    ),
    "tuning": ("pareto", "tune"),
}  # fmt: skip

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
    "campaign",
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


def __getattr__(name: str) -> Any:
    for room, names in _HOMES.items():
        if name in names:
            value = getattr(import_module(f"fpid_pin.{room}"), name)
            break
    else:
        if name not in _ROOMS:
            raise AttributeError(f"module 'fpid_pin' has no attribute {name!r}")
        value = import_module(f"fpid_pin.{name}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
