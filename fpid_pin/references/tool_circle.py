"""A circle for the tool, turned into joint angles by inverse kinematics."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.arms import Arm
from fpid_pin.checks import Array, Flag, FloatArray, Number
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references.reference import Motion
from fpid_pin.text import unit_for

#: Points of the circle whose joint angles are solved for; a periodic spline joins them.
POINTS = 180
#: How close the tool must come, m and rad.
TOLERANCE = 1e-9
_MOST_STEPS = 300


@described("tool_circle", "Reference")
@dataclass(frozen=True, eq=False)
class ToolCircle(Description):
    """The tool moves on a circle, once in `period`; it starts where the tool is at home.

    Solved in advance, by Newton steps with Pinocchio's Jacobian, at 180 points joined by a
    periodic spline. Where the arm has joints to spare they stay as near home as they can, which
    also makes the joints' motion periodic.

    Parameters
    ----------
    arm
        The arm whose tool moves.
    radius
        Radius of the circle [m].
    period
        Time of one turn [s].
    normal
        Normal of the circle's plane, (3,), world axes; the turn is right-handed about it. By
        default the plane is x-z, in which planar arms move.
    centre
        Centre [m], (3,), world axes; None: chosen so that the tool at home is on the circle.
    orientation
        Whether the tool keeps its orientation at home.
    ramp
        Time in which the speed rises smoothly from 0 [s]; 0: full speed from the start.

    Raises
    ------
    ArgumentError
        A point out of reach or beyond a joint's limits; the message says which.
    """

    arm: Arm
    radius: Annotated[float, Number("m", above=0.0)]
    period: Annotated[float, Number("s", above=0.0)]
    normal: Annotated[ArrayLike, Array(shape=(3,))] = (0.0, 1.0, 0.0)
    centre: Annotated[ArrayLike | None, Array("m", shape=(3,))] = None
    orientation: Annotated[bool, Flag] = False
    ramp: Annotated[float, Number("s", low=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.any(self.normal):
            raise ArgumentError("reference.normal", "a direction", "a zero vector")
        # Solved at once, so that what is out of reach is refused here.
        _ = self._splines

    @cached_property
    def _splines(self) -> tuple[Any, Any, Any]:
        angles = np.linspace(0.0, 2.0 * np.pi, POINTS + 1)
        path = _solve(self.arm, self._points(angles), angles, self.orientation)
        # Imported here: scipy.interpolate would be a third of the package's import time.
        from scipy.interpolate import CubicSpline

        path[-1] = path[0]
        spline = CubicSpline(angles, path, axis=0, bc_type="periodic")
        return spline, spline.derivative(1), spline.derivative(2)

    def _points(self, angles: FloatArray) -> FloatArray:
        """Return points of the circle [m], (K, 3)."""
        home = self.arm.tool_pose(self.arm.home)[:3, 3]
        normal = np.asarray(self.normal) / np.linalg.norm(np.asarray(self.normal))
        # Towards the tool at home if the centre is given, else away from the base.
        towards = home - (np.zeros(3) if self.centre is None else np.asarray(self.centre))
        first = towards - normal * (towards @ normal)
        if np.linalg.norm(first) < 1e-9:
            first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        centre = home - self.radius * first if self.centre is None else np.asarray(self.centre)
        turn = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
        return np.asarray(centre + self.radius * turn)

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        speed = 2.0 * np.pi / self.period
        if self.ramp > 0.0:
            # The speed follows 10 x^3 - 15 x^4 + 6 x^5 over the ramp.
            x = np.clip(t / self.ramp, 0.0, 1.0)
            rate = speed * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
            acceleration = speed * 30.0 * x**2 * (1.0 - x) ** 2 / self.ramp
            risen = self.ramp * x**4 * (2.5 - 3.0 * x + x**2)
            angle = speed * (risen + np.maximum(t - self.ramp, 0.0))
        else:
            angle, rate, acceleration = speed * t, np.full_like(t, speed), np.zeros_like(t)
        around = np.mod(angle, 2.0 * np.pi)
        q, slope, curve = (np.asarray(spline(around)) for spline in self._splines)
        rate, acceleration = rate[:, np.newaxis], acceleration[:, np.newaxis]
        return q, slope * rate, curve * rate**2 + slope * acceleration


def _solve(arm: Arm, points: FloatArray, angles: FloatArray, orientation: bool) -> FloatArray:
    """Return joint angles, (K, n), that bring the tool to `points`, each from the one before."""
    turn = arm.tool_pose(arm.home)[:3, :3]
    q = np.array(arm.home)
    path = np.empty((len(points), arm.n))
    for k, point in enumerate(points):
        q = _reach(arm, q, point, turn if orientation else None, float(np.degrees(angles[k])))
        path[k] = q
    drift = np.abs(path[-1] - path[0]).max()
    if drift > 1e-5:
        raise ArgumentError(
            "reference", "a circle on which the joints return to where they began",
            f"a turn that ends {drift:.3g} {unit_for('rad', arm.units)} away "
            "(through a singular pose?)",
        )  # fmt: skip
    for k, j in np.argwhere((path < arm.lower) | (path > arm.upper))[:1]:
        unit = arm.units[j]
        raise ArgumentError(
            "reference",
            f"joint {arm.joint_names[j]} within [{arm.lower[j]:.3g}, {arm.upper[j]:.3g}] {unit}",
            f"{path[k, j]:.3g} {unit} at {np.degrees(angles[k]):.0f} degrees of the circle",
        )
    return path


def _reach(
    arm: Arm, start: FloatArray, point: FloatArray, turn: FloatArray | None, degrees: float
) -> FloatArray:
    """Bring the tool to `point` (and orientation `turn`) by damped Newton steps."""
    import pinocchio as pin

    q = start.copy()
    rows = 3 if turn is None else 6
    gap = np.inf
    for _ in range(_MOST_STEPS):
        pose = arm.tool_pose(q)
        error = point - pose[:3, 3]
        if turn is not None:
            error = np.concatenate([error, pin.log3(turn @ pose[:3, :3].T)])
        gap = float(np.linalg.norm(error))
        jacobian = arm.tool_jacobian(q)[:rows]
        # Damped only while far: near the goal the steps are Newton's own.
        damping = 1e-12 + 1e-2 * min(gap, 0.1) ** 2
        inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + damping * np.eye(rows))
        homewards = arm.home - q
        spare = homewards - np.linalg.pinv(jacobian, rcond=1e-6) @ (jacobian @ homewards)
        if gap < TOLERANCE and np.linalg.norm(spare) < 1e-7:
            return q
        step = inverse @ error + 0.5 * spare
        q = q + step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12))
    if gap < TOLERANCE * 1e3:
        return q
    at = ", ".join(f"{x:.3g}" for x in point)
    raise ArgumentError(
        "reference", "a circle within reach of the tool",
        f"({at}) m at {degrees:.0f} degrees, which it misses by {gap:.2g} m",
    )  # fmt: skip
