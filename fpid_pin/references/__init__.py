"""What the joints should do: references, each a trajectory sampled at any time.

Anything with the method of `Reference` is one.
"""

from fpid_pin.references.reference import (
    Hold,
    Motion,
    Quintic,
    RecordedMotion,
    Reference,
    Sinusoid,
    Waypoints,
)
from fpid_pin.references.tool_circle import ToolCircle

__all__ = [
    "Hold", "Motion", "Quintic", "RecordedMotion", "Reference", "Sinusoid", "ToolCircle",
    "Waypoints",
]  # fmt: skip
