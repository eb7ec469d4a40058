"""What figures of runs are put together from: names and units of joints, looks, panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.view.style import DASHES, INK, PLAIN, colour, legend, lettering, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Beside a curve in a cycle colour the reference must be told apart in grey, too: dashed.
REFERENCE: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 2)), "linewidth": 1.0}
# Part of a panel's height within which two curves are taken for one.
_CLOSE = 0.02


class Joints(NamedTuple):
    """What figures say of a run's joints: names, units of coordinate and effort, effort limits."""

    names: Sequence[str]
    units: Sequence[str]
    efforts: Sequence[str]
    limits: FloatArray

    def label(self, quantity: str, j: int | None = None) -> str:
        """Return the label of an axis of one joint's ``q``, ``error`` or ``torque``, or of all."""
        units = self.efforts if quantity == "torque" else self.units
        unit = ", ".join(dict.fromkeys(units)) if j is None else units[j]
        names = {"q": "angle" if unit == "rad" else "position", "error": "$q_d - q$",
                 "torque": "force" if unit == "N" else "torque"}  # fmt: skip
        return f"{names[quantity]}, {unit}"

    def lettered(self) -> list[str]:
        """Return the names as figures show them."""
        return [lettering(name) for name in self.names]


def joints_of(run: Run) -> Joints:
    """Return the joints of a run; where its arm cannot be rebuilt they have numbers."""
    try:
        arm = run.arm
    except (KeyError, FpidError):
        n = run.q.shape[1]
        names = [f"joint {j + 1}" for j in range(n)]
        return Joints(names, ["rad"] * n, ["N m"] * n, np.full(n, np.inf))
    return Joints(list(arm.joint_names), arm.units, arm.effort_units, arm.effort_limit)


def looks_of(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return how each of several runs is drawn, in the palette's order.

    One that follows an earlier one closely is dashed, so that both are seen; so are those whose
    colours alone might be mistaken.
    """
    looks = []
    for k, run in enumerate(runs):
        dash = max(k // PLAIN, sum(_hides(run, earlier) for earlier in runs[:k]))
        looks.append({"color": colour(k), "linestyle": DASHES[min(dash, len(DASHES) - 1)]})
    return looks


def _hides(run: Run, earlier: Run) -> bool:
    """Return whether the errors of a run would cover those of another for most of the time."""
    rows = min(len(run.t), len(earlier.t))
    if not rows:
        return False
    apart = np.median(np.abs(run.error[:rows] - earlier.error[:rows]), axis=0)
    return bool((apart <= _CLOSE * np.ptp(earlier.error[:rows], axis=0)).all())


def overview(run: Run, panels: Sequence[Axes]) -> None:
    """Draw all joints into three panels: angles and references, torques, errors in some order."""
    joints = joints_of(run)
    names = joints.lettered()
    for panel, quantity in zip(panels, ("q", "error", "torque"), strict=True):
        for j, name in enumerate(names):
            look: dict[str, Any] = {"color": colour(j)}
            line(panel, run.t, getattr(run, quantity)[:, j], name, **look)
            limit = joints.limits[j]
            if quantity == "q":
                last = j == len(names) - 1
                line(panel, run.t, run.q_ref[:, j], "desired" if last else "", **REFERENCE)
            elif quantity == "torque" and np.abs(run.torque[:, j]).max(initial=0.0) > 0.5 * limit:
                for height in (limit, -limit):
                    panel.axhline(height, linewidth=1.0, linestyle=":", **look)
        panel.set_ylabel(joints.label(quantity))
    legend(panels[0], min(len(names) + 1, 4))
