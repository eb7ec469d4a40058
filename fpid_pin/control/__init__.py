"""Control laws: from reference and measurement to torque."""

from fpid_pin.control.adaptation import Safeguards
from fpid_pin.control.computed_torque import ComputedTorque
from fpid_pin.control.controller import Controller, Loop, State
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.supervisor import Supervisor, lyapunov_matrix

__all__ = [
    "AdaptiveFpid",
    "ComputedTorque",
    "Controller",
    "Loop",
    "Safeguards",
    "State",
    "Supervisor",
    "lyapunov_matrix",
]
