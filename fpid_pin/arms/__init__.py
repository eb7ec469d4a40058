"""Rigid-body arms on Pinocchio; knows nothing of control."""

# Imported for its effect: it registers the kinds of arm that files may name.
from fpid_pin.arms import tables as _tables
from fpid_pin.arms.arm import Arm
from fpid_pin.arms.bodies import CompiledFleet
from fpid_pin.arms.catalogue import names
from fpid_pin.arms.fleet import Fleet
from fpid_pin.arms.friction import DryFriction

__all__ = ["Arm", "CompiledFleet", "DryFriction", "Fleet", "names"]

del _tables
