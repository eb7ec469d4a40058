"""Joints of an arm and of a robot that lists them in another order, or has more of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import listed


class JointOrder:
    """Which number of a robot's is which joint of an arm.

    Parameters
    ----------
    arm_names
        The arm's n joints, in its order (`Arm.joint_names`).
    robot_names
        The robot's m joints in its order, all of the arm's among them; others, a gripper's say, get
        no torque.

    Raises
    ------
    ArgumentError
        A joint of the arm that the robot has not, or has twice.
    """

    def __init__(self, arm_names: Sequence[str], robot_names: Sequence[str]) -> None:
        self.arm_names, self.robot_names = tuple(arm_names), tuple(robot_names)
        for name in dict.fromkeys([*self.robot_names, *self.arm_names]):
            count = self.robot_names.count(name)
            if count != 1:
                expected = f"each of {listed(self.arm_names)} once"
                raise ArgumentError("joint_names", expected, f"{name} {count} times")
        self._places = np.array([self.robot_names.index(name) for name in self.arm_names])
        self._shape = (len(self.robot_names),)

    def to_arm(self, name: str, values: Any) -> FloatArray:
        """Return the arm's numbers, (n,), of the robot's, (m,) or a table by name.

        Raises
        ------
        ArgumentError
            Naming `name`: another length, a joint that is missing, no numbers.
        """
        # The checks of a well-made array take longer than all else; they are for the others.
        if type(values) is np.ndarray and values.shape == self._shape and values.dtype == float:
            return values.take(self._places)
        if isinstance(values, Mapping):
            names = self.arm_names
            missing = [joint for joint in names if joint not in values]
            if missing:
                raise ArgumentError(name, f"a number for {missing[0]}", listed(values))
            return checks.vector(name, [values[joint] for joint in names], len(names))
        array = checks.floats(name, values)
        if array.shape != self._shape:
            expected = f"shape {self._shape} (the robot's joints)"
            raise ArgumentError(name, expected, f"shape {array.shape}")
        return array.take(self._places)

    def to_robot(self, values: FloatArray) -> FloatArray:
        """Return the robot's numbers, (m,), of the arm's, (n,); 0 for joints that it has not."""
        found: FloatArray = np.zeros(self._shape)
        found[self._places] = values
        return found
