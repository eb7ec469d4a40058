"""Limits of the arm watched: which joint went beyond what, and when first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fpid_pin.arms import Arm
from fpid_pin.simulation.run import Run


@dataclass(frozen=True)
class Exceedance:
    """A joint's first step beyond one of its limits.

    Attributes
    ----------
    joint
        Its name.
    quantity
        ``"position"``, ``"velocity"`` or ``"effort"`` (the controller asked for all of it).
    limit
        [rad], [rad/s] or [N m] (of a prismatic joint [m], [m/s] or [N]); for positions the one
        that was passed.
    time
        When first [s].
    value
        The worst that followed.
    part
        Part of the run's samples beyond the limit.
    unit
        Of `limit` and `value`.
    """

    joint: str
    quantity: str
    limit: float
    time: float
    value: float
    part: float
    unit: str

    @property
    def passed(self) -> str:
        """Which limit in words: of positions the upper or the lower one."""
        if self.quantity != "position":
            return self.quantity
        return f"{'upper' if self.value > self.limit else 'lower'} position"

    def __str__(self) -> str:
        unit, share = self.unit, f"{100.0 * self.part:.3g} % of the time"
        if self.quantity == "effort":
            return (
                f"{self.joint}: at its effort limit of {self.limit:.3g} {unit} from "
                f"{self.time:.3g} s on, {share}"
            )
        return (
            f"{self.joint}: beyond its {self.passed} limit of {self.limit:.3g} {unit} at "
            f"{self.time:.3g} s (worst {self.value:.3g} {unit}, {share})"
        )


def asks_degrees(arm: Arm, run: Run) -> str:
    """Return a line where a start or a reference of a joint that turns is too far for radians.

    That is beyond a whole turn, or five times as far as the joint's limits. Empty: nowhere.
    """
    farthest = np.abs(np.vstack([run.q[:1], run.q_ref])).max(axis=0, initial=0.0)
    limit = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    plausible = np.minimum(2.0 * np.pi, 5.0 * limit)
    excess = np.where(np.array(arm.units) == "rad", farthest / plausible, 0.0)
    j = int(np.argmax(excess))
    if not excess[j] > 1.0 + 1e-9:
        return ""
    known = f"limits {arm.lower[j]:.3g} and {arm.upper[j]:.3g} rad" if limit[j] < np.inf else ""
    return (
        f"{arm.name}: joint {arm.joint_names[j]} is to go to {farthest[j]:.3g} rad"
        f"{f' ({known})' if known else ''}: degrees? Angles are in rad"
    )


def limit_report(run: Run) -> list[Exceedance]:
    """Return every limit of the nominal arm that `run` passed, the earliest first.

    Position and velocity limits do not stop a simulated joint; they are watched. A torque cannot
    pass its limit: listed is where it sat at it.
    """
    arm = run.arm
    speeds = [f"{unit}/s" for unit in arm.units]
    watched = (
        ("position", run.q, arm.lower - run.q, arm.lower, arm.units),
        ("position", run.q, run.q - arm.upper, arm.upper, arm.units),
        ("velocity", run.v, np.abs(run.v) - arm.velocity_limit, arm.velocity_limit, speeds),
        ("effort", run.torque, np.abs(run.torque) - arm.effort_limit, arm.effort_limit,
         arm.effort_units),
    )  # fmt: skip
    found = []
    for j, joint in enumerate(arm.joint_names):
        for quantity, values, excess, limits, units in watched:
            beyond = excess[:, j] >= 0.0 if quantity == "effort" else excess[:, j] > 0.0
            if np.isfinite(limits[j]) and beyond.any():
                first, worst = int(np.argmax(beyond)), int(np.argmax(excess[:, j]))
                time, value = float(run.t[first]), float(values[worst, j])
                about = (float(limits[j]), time, value, float(np.mean(beyond)), units[j])
                found.append(Exceedance(joint, quantity, *about))
    return sorted(found, key=lambda item: item.time)
