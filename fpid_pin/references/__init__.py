"""What the joints should do: references, each a trajectory sampled at any time.

Anything with the method of `Reference` is one.
"""

from fpid_pin.references.hold import Hold
from fpid_pin.references.quintic import Quintic
from fpid_pin.references.recorded_motion import RecordedMotion
from fpid_pin.references.reference import Motion, Reference
from fpid_pin.references.sinusoid import Sinusoid
from fpid_pin.references.tool_circle import ToolCircle
from fpid_pin.references.waypoints import Waypoints

__all__ = [
    "Hold",
    "Motion",
    "Quintic",
    "RecordedMotion",
    "Reference",
    "Sinusoid",
    "ToolCircle",
    "Waypoints",
]
