"""Costs of the path that is followed: where the tool goes, and when the joints have settled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from fpid_pin.checks import FloatArray, Number, OneOf
from fpid_pin.costs.cost import RowCost, Rows
from fpid_pin.costs.figures import SETTLING_BAND
from fpid_pin.descriptions import described


@described("tool_cost")
@dataclass(frozen=True, eq=False)
class ToolCost(RowCost):
    """How far the tool is from where the reference would have it [m], by the nominal arm.

    Parameters
    ----------
    measure
        ``"rms"`` over the rows, or their ``"peak"``.
    """

    measure: Annotated[str, OneOf("rms", "peak")] = "rms"

    def begin(self) -> tuple[int, float, float]:
        """See `RowCost.begin`: rows, sum of squares [m^2] and largest square [m^2]."""
        return 0, 0.0, 0.0

    def add(self, state: tuple[int, float, float], rows: Rows) -> tuple[int, float, float]:
        """See `RowCost.add`."""
        count, total, worst = state
        squares = tool_distance(rows.arm, rows.q, rows.q_ref) ** 2
        return count + len(squares), total + float(squares.sum()), max(worst, float(squares.max()))

    def finish(self, state: tuple[int, float, float]) -> float:
        """See `RowCost.finish`."""
        count, total, worst = state
        return float(np.sqrt(total / count if self.measure == "rms" else worst))


def tool_distance(arm: Any, q: FloatArray, q_ref: FloatArray) -> FloatArray:
    """Return how far the tool of an `Arm` at `q` is from that at `q_ref`, (K, n) both, (K,) [m]."""
    import pinocchio as pin

    # Without `Arm.tool_pose`, whose checks take longer than the kinematics of a row.
    model, data = arm.model, arm.model.createData()
    frame = model.getFrameId(arm.tool)

    def places(angles: FloatArray) -> FloatArray:
        found = np.empty((len(angles), 3))
        for row, pose in zip(found, angles, strict=True):
            pin.forwardKinematics(model, data, pose)
            row[:] = pin.updateFramePlacement(model, data, frame).translation
        return found

    return np.asarray(np.linalg.norm(places(q) - places(q_ref), axis=1))


@described("settling_cost")
@dataclass(frozen=True, eq=False)
class SettlingCost(RowCost):
    """When all joints are within a band for good [s]; the whole duration where they are not.

    Parameters
    ----------
    band
        [rad].
    """

    band: Annotated[float, Number("rad", above=0.0)] = SETTLING_BAND

    def begin(self) -> float:
        """See `RowCost.begin`."""
        return 0.0

    def add(self, state: float, rows: Rows) -> float:
        """See `RowCost.add`."""
        outside = np.flatnonzero((np.abs(rows.error) > self.band).any(axis=1))
        return (rows.first + int(outside[-1]) + 1) * rows.step if outside.size else state

    def finish(self, state: float) -> float:
        """See `RowCost.finish`."""
        return state
