"""Rigid-body arms on Pinocchio; knows nothing of control.

From a robot's file to what the kernels move: `urdf.urdf_tree` (or `mjcf.mjcf_tree`) reads a `Tree`
of joints of any kind; `Tree.serial` holds some still, which leaves a `Chain`; `Chain.model` makes
the Pinocchio model that an `Arm` is; `rigid_body.bodies_of` turns that into the kernels' records.
"""

from fpid_pin.arms.arm import Arm
from fpid_pin.arms.catalogue import names

__all__ = ["Arm", "names"]
