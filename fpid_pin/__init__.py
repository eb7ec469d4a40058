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

# isort: off
if TYPE_CHECKING:
    from fpid_pin import (
        arms, campaign, control, costs, disturbances, exceptions, export, fractional, progress,
        references, simulation, tuning, view,
    )  # fmt: skip
    from fpid_pin.arms import Arm
    from fpid_pin.control import (
        AdaptiveFpid, ComputedTorque, Controller, GravityOnly, PdGravity, Pid, Safeguards,
        SlidingMode, SlotineLi, SuggestedFpid, Supervisor, stability_report, suggest_gains,
    )  # fmt: skip
    from fpid_pin.descriptions import described
    from fpid_pin.exceptions import FpidError, FpidWarning
    from fpid_pin.export import export_c
    from fpid_pin.simulation import (
        Experiment, Plant, Run, Sensors, compare, evaluate, paper_controller, paper_experiment,
        simulate, to_toml,
    )  # fmt: skip
    from fpid_pin.tuning import pareto, tune
# isort: on

#: Where names are looked for, what takes long to import last.
_ROOMS = ("exceptions", "descriptions", "arms", "control", "simulation", "tuning", "export")
__all__ = [
    "AdaptiveFpid", "Arm", "ComputedTorque", "Controller", "Experiment", "FpidError", "FpidWarning",
    "GravityOnly", "PdGravity", "Pid", "Plant", "Run", "Safeguards", "Sensors", "SlidingMode",
    "SlotineLi", "SuggestedFpid", "Supervisor", "__version__", "arms", "campaign", "compare",
    "control", "costs", "described", "disturbances", "evaluate", "exceptions", "export", "export_c",
    "fractional", "paper_controller", "paper_experiment", "pareto", "progress", "references",
    "simulate", "simulation", "stability_report", "suggest_gains", "to_toml", "tune", "tuning",
    "view",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    # Fetched when first asked for: a command that needs none of them starts at once.
    if name not in __all__ and name != "descriptions":
        raise AttributeError(f"module 'fpid_pin' has no attribute {name!r}")
    try:
        return import_module(f"fpid_pin.{name}")
    except ModuleNotFoundError as error:
        if error.name != f"fpid_pin.{name}":
            raise  # a room is there, and something else is not
    rooms = (import_module(f"fpid_pin.{room}") for room in _ROOMS)
    value = globals()[name] = next(getattr(room, name) for room in rooms if hasattr(room, name))
    return value


def __dir__() -> list[str]:
    return __all__
