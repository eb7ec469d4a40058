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
    from fpid_pin import arms as arms
    from fpid_pin import campaign as campaign
    from fpid_pin import control as control
    from fpid_pin import costs as costs
    from fpid_pin import disturbances as disturbances
    from fpid_pin import exceptions as exceptions
    from fpid_pin import export as export
    from fpid_pin import fractional as fractional
    from fpid_pin import progress as progress
    from fpid_pin import references as references
    from fpid_pin import simulation as simulation
    from fpid_pin import tuning as tuning
    from fpid_pin import view as view
    from fpid_pin.arms import Arm as Arm
    from fpid_pin.control import AdaptiveFpid as AdaptiveFpid
    from fpid_pin.control import ComputedTorque as ComputedTorque
    from fpid_pin.control import Controller as Controller
    from fpid_pin.control import GravityOnly as GravityOnly
    from fpid_pin.control import PdGravity as PdGravity
    from fpid_pin.control import Pid as Pid
    from fpid_pin.control import Safeguards as Safeguards
    from fpid_pin.control import SlidingMode as SlidingMode
    from fpid_pin.control import SlotineLi as SlotineLi
    from fpid_pin.control import SuggestedFpid as SuggestedFpid
    from fpid_pin.control import Supervisor as Supervisor
    from fpid_pin.control import stability_report as stability_report
    from fpid_pin.control import suggest_gains as suggest_gains
    from fpid_pin.descriptions import described as described
    from fpid_pin.exceptions import FpidError as FpidError
    from fpid_pin.exceptions import FpidWarning as FpidWarning
    from fpid_pin.export import export_c as export_c
    from fpid_pin.simulation import Experiment as Experiment
    from fpid_pin.simulation import Plant as Plant
    from fpid_pin.simulation import Run as Run
    from fpid_pin.simulation import Sensors as Sensors
    from fpid_pin.simulation import evaluate as evaluate
    from fpid_pin.simulation import paper_controller as paper_controller
    from fpid_pin.simulation import paper_experiment as paper_experiment
    from fpid_pin.simulation import simulate as simulate
    from fpid_pin.tuning import pareto as pareto
    from fpid_pin.tuning import tune as tune

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

__all__ = ["__version__", *(room for room in _ROOMS if room != "descriptions")]
__all__ += [name for names in _HOMES.values() for name in names]


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
