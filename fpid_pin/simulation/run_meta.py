"""What a run's record says of where it came from."""

from __future__ import annotations

import platform
from typing import Any

import numpy as np
import pinocchio
import scipy

from fpid_pin import descriptions
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.simulation.experiment import Experiment


def describe_run(
    experiment: Experiment, controller: Controller, name: str, dynamics: str
) -> dict[str, Any]:
    """Return the `Run.meta` of a run about to be recorded, with the dynamics that made it."""
    table = descriptions.to_dict(experiment) | {"dynamics": dynamics}
    about = {"seed": experiment.seed, "experiment": table}
    return meta_of(name, experiment.arm, controller, experiment.torque_limit) | about


def meta_of(
    name: str, arm: Arm, controller: Controller | None, effort_limit: FloatArray
) -> dict[str, Any]:
    """Return the `Run.meta` of a run that no experiment of ours has made."""
    elsewhere = {"kind": "custom", "repr": "recorded elsewhere"}
    return {
        "name": name,
        "versions": {
            "fpid_pin": __version__,
            "pin": pinocchio.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "platform": platform.platform(),
        "effort_limit": effort_limit.tolist(),
        "experiment": elsewhere,
        "controller": elsewhere if controller is None else descriptions.to_dict(controller),
        "arm": descriptions.to_dict(arm),
    }
