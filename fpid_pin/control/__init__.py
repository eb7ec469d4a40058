"""Control laws: from reference and measurement to torque."""

from fpid_pin.control.ceilings import GainCeilings, gain_ceilings
from fpid_pin.control.certificate import GainCertificate, certify_gains
from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.gains import (
    GainSuggestion,
    SuggestedFpid,
    adapt_orders,
    explain_gains,
    suggest_gains,
)
from fpid_pin.control.law import Controller, Derivative, Integral, Operator
from fpid_pin.control.loop import Loop, Record
from fpid_pin.control.pid import ComputedTorque, GravityOnly, PdGravity, Pid
from fpid_pin.control.robot_loop import EncoderRate, RobotLoop, Ticks
from fpid_pin.control.sliding_mode import SlidingMode, SlotineLi
from fpid_pin.control.stability import StabilityReport, stability_report, suggest_observer
from fpid_pin.control.supervisor import Supervisor

__all__ = [
    "AdaptiveFpid", "ComputedTorque", "Controller", "Derivative", "EncoderRate", "GainCeilings",
    "GainCertificate", "GainSuggestion", "GravityOnly", "Integral", "Loop", "Operator", "PdGravity",
    "Pid", "Record", "RobotLoop", "Safeguards", "SlidingMode", "SlotineLi", "StabilityReport",
    "SuggestedFpid", "Supervisor", "Ticks", "adapt_orders", "certify_gains", "explain_gains",
    "gain_ceilings", "stability_report", "suggest_gains", "suggest_observer",
]  # fmt: skip
