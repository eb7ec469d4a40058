"""The controllers to beat: what users have now, in the same engine as the adaptive FPID."""

from fpid_pin.control.baselines.gravity_only import GravityOnly
from fpid_pin.control.baselines.pd_gravity import PdGravity
from fpid_pin.control.baselines.pid import Pid
from fpid_pin.control.baselines.sliding_mode import SlidingMode
from fpid_pin.control.baselines.slotine_li import SlotineLi

__all__ = ["GravityOnly", "PdGravity", "Pid", "SlidingMode", "SlotineLi"]
