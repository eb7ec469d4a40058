"""Rigid-body arms on Pinocchio; knows nothing of control."""

# Imported for its effect: it registers the kinds of arm that files may name.
from fpid_pin.arms import tables as _tables
from fpid_pin.arms.arm import Arm
from fpid_pin.arms.catalogue import names

__all__ = ["Arm", "names"]

del _tables
