"""The arms of example-robot-data that work, by name, with a home pose and their origin."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fpid_pin import checks
from fpid_pin.arms.robot_file import read_robot
from fpid_pin.arms.tree import Tree
from fpid_pin.arms.urdf import urdf_tree
from fpid_pin.exceptions import ArgumentError, ArmError

_UR = "github.com/ros-industrial/universal_robot, BSD"
_FINGERS = {"panda_finger_joint1": 0.001, "panda_finger_joint2": 0.001}
_BRAVO_FINGERS = {"bravo_finger1_joint": 0.2, "bravo_finger2_joint": 0.2}


@dataclass(frozen=True)
class Entry:
    """One arm of the catalogue.

    Parameters
    ----------
    file
        Below example-robot-data's folder of robots.
    credit
        Where the description comes from and its licence, as the data package states them.
    home
        The data package's reference posture as angles, moved into the limits by whole turns;
        empty: the middle of the limits.
    lock
        Joints that are no part of the arm (fingers), and where they are held.
    armature
        Rotor inertia that the file does not carry [kg m^2].
    tool
        The tool's frame, where the last link of the file is not it.
    note
        What a user should know.
    """

    file: str
    credit: str
    home: tuple[float, ...] = ()
    lock: Mapping[str, float] = field(default_factory=dict)
    armature: tuple[float, ...] = ()
    tool: str | None = None
    note: str = ""


_BRAVO_HOME = (0.0, 2.305, 1.059, 1.566, 1.57, 1.532)

ENTRIES: dict[str, Entry] = {
    "asr_twodof": Entry(
        "asr_twodof_description/urdf/TwoDofs.urdf", "qbrobotics qbmove-ros, BSD-3-Clause"
    ),
    "bravo7_gripper": Entry(
        "bravo7_description/urdf/bravo7_gripper.urdf",
        "github.com/Reach-Robotics/reach_robotics_sdk, licence not stated",
        home=_BRAVO_HOME,
        lock=_BRAVO_FINGERS,
        note="gripper locked; gravity at home exceeds the effort limit of joint2",
    ),
    "bravo7_no_ee": Entry(
        "bravo7_description/urdf/bravo7_no_ee.urdf",
        "github.com/Reach-Robotics/reach_robotics_sdk, licence not stated",
        home=_BRAVO_HOME,
        note="gravity at home exceeds the effort limit of joint2",
    ),
    "double_pendulum": Entry(
        "double_pendulum_description/urdf/double_pendulum.urdf",
        "example-robot-data (PepMS), BSD",
        note="no limits given",
    ),
    "finger_edu": Entry(
        "finger_edu_description/robots/finger_edu.urdf",
        "github.com/open-dynamic-robot-initiative/open_robot_actuator_hardware, BSD-3-Clause",
        note="a three-joint finger",
    ),
    "kinova": Entry(
        "kinova_description/robots/kinova.urdf",
        "github.com/Kinovarobotics/kinova-ros, BSD",
        home=(1.5707, 2.618, 4.7125, 3.1415, 2.618, 0.0),
        tool="j2s6s200_end_effector",
        note="continuous joints as unbounded revolute",
    ),
    "panda": Entry(
        "panda_description/urdf/panda.urdf",
        "github.com/frankaemika/franka_ros, Apache-2.0",
        home=(0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5707, 0.7854),
        lock=_FINGERS,
        tool="panda_hand",
        note="fingers locked",
    ),
    "so100": Entry(
        "so_arm_description/urdf/so100.urdf",
        "github.com/TheRobotStudio/SO-ARM100, Apache-2.0",
        lock={"gripper": 0.0},
        note="jaw locked",
    ),
    "so101": Entry(
        "so_arm_description/urdf/so101.urdf",
        "github.com/TheRobotStudio/SO-ARM100, Apache-2.0",
        lock={"gripper": 0.0},
        note="jaw locked",
    ),
    "talos_arm": Entry(
        "talos_data/robots/talos_left_arm.urdf",
        "github.com/stack-of-tasks/talos-data, LGPL-3.0",
        home=(0.173, -0.0002, -0.5254, 0.0, 0.0, 0.1, 0.0),
        armature=(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0),
        note="dry friction of the last joint equals its effort limit",
    ),
    "ur10": Entry("ur_description/urdf/ur10_robot.urdf", _UR, home=(0.0,) * 6),
    "ur10_limited": Entry(
        "ur_description/urdf/ur10_joint_limited_robot.urdf", _UR, home=(0.0,) * 6
    ),
    # The data package's own loader returns a UR5 for "ur3"; this is the UR3's file.
    "ur3": Entry(
        "ur_description/urdf/ur3_robot.urdf",
        _UR,
        home=(0.0,) * 6,
        note="the file gives it the UR10's effort limits",
    ),
    "ur3_limited": Entry(
        "ur_description/urdf/ur3_joint_limited_robot.urdf",
        _UR,
        home=(0.0,) * 6,
        note="the file gives it the UR10's effort limits",
    ),
    "ur5": Entry("ur_description/urdf/ur5_robot.urdf", _UR, home=(0.0,) * 6),
    "ur5_limited": Entry("ur_description/urdf/ur5_joint_limited_robot.urdf", _UR, home=(0.0,) * 6),
    "xarm7": Entry(
        "xarm_description/urdf/xarm7.urdf",
        "github.com/xArm-Developer/xarm_ros2, BSD-3-Clause",
        home=(0.0,) * 7,
        note="wrist inertia 1e-4 kg m^2",
    ),
    "z1": Entry(
        "z1_description/urdf/z1.urdf",
        "github.com/unitreerobotics/unitree_ros, MPL-2.0",
        home=(0.0, 0.2618, -0.2618, 0.0, 0.0, 0.0, 0.0),
        note="the gripper's jaw is the seventh joint",
    ),
}


def names() -> tuple[str, ...]:
    """Return the names that `Arm.from_example` knows, sorted."""
    return tuple(sorted(ENTRIES))


def note(name: str) -> str:
    """Return what a user of this arm should know; empty if nothing."""
    return ENTRIES[checks.choice("arm", name, names())].note


def example_tree(name: str) -> tuple[Tree, Mapping[str, float]]:
    """Return an arm of the catalogue before its joints are held, and those that the entry holds."""
    if isinstance(name, str) and name not in ENTRIES and name.lower() in ENTRIES:
        known = ", ".join(names())
        raise ArgumentError("arm", f"one of {known}", f"{name!r} (did you mean {name.lower()}?)")
    entry = ENTRIES[checks.choice("arm", name, names())]
    # Heavy (it loads half a dozen packages' worth of paths), hence not at import.
    from example_robot_data.robots_loader import getModelPath

    try:
        folder = Path(getModelPath(entry.file)).resolve()
    except OSError:
        raise ArmError(
            f"{name}: expected example-robot-data to hold {entry.file}, got none "
            "(pip install example-robot-data)"
        ) from None
    path = folder / entry.file
    # Meshes are addressed as package://example-robot-data/robots/..., two folders up.
    tree = urdf_tree(read_robot(path), str(path), path.parent, (folder.parent.parent,))
    tree.name = name
    tree.credit = f"{name}: {entry.credit} (by way of example-robot-data)"
    tree.tool = entry.tool or tree.tool
    # The catalogue's arrays are for the arm with the catalogue's own locks.
    own = [k for k, joint in enumerate(tree.joints) if joint.name not in entry.lock]
    tree.home = {tree.joints[k].name: q for k, q in zip(own, entry.home, strict=False)}
    for k, armature in zip(own, entry.armature, strict=False):
        tree.joints[k] = dataclasses.replace(tree.joints[k], armature=armature)
    return tree, entry.lock
