"""What a robot's file says, a tree of joints, and the serial chain that an arm is made of."""

from __future__ import annotations

import dataclasses
import json
import shlex
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms.inertia import (
    impossible,
    moved,
    nearest_possible,
    require_physical,
    summed,
)
from fpid_pin.arms.joints import UNITS, Numbers, displacement, placement_of, rows_of
from fpid_pin.arms.spec import INERTIA, MOST_JOINTS, ArmSpec, Frame, Joint, Shape
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning
from fpid_pin.text import cut, listed, named, shown

Keep = str | Sequence[str]
_WORDS = {
    "FreeFlyer": "a free joint (an arm's base is fixed)",
    "Composite": "several joints in one (put a body between them)",
    "Mimic": "one that mimics another (lock it)",
}
#: A position limit beyond this [rad] or [m] is a way of saying that there is none.
UNREACHABLE = 1e4


class HoldError(ArmError):
    """Joints have to be held still before there is an arm; `hint` says which.

    Attributes
    ----------
    lock : dict
        The joints, and where they are.
    keep : str
        The tip of what would be left, where there is one.
    """

    what: str
    lock: Mapping[str, float]
    keep: str

    @classmethod
    def of(cls, what: str, lock: Mapping[str, float], keep: str) -> HoldError:
        """Return the error with its hint as a script has it."""
        values = ", ".join(f"{name!r}: {value:g}" for name, value in lock.items())
        error = cls(what + _hint(keep and f"keep={keep!r}", values and f"lock={{{values}}}"))
        error.what, error.lock, error.keep = what, lock, keep
        return error

    def in_toml(self) -> ArmError:
        """Return the error with its hint as a configuration has it."""
        values = ", ".join(f"{json.dumps(name)} = {x:g}" for name, x in self.lock.items())
        keeping = self.keep and f"keep = {json.dumps(self.keep)}"
        return ArmError(self.what + _hint(keeping, values and f"lock = {{ {values} }}"))

    def on_command_line(self) -> ArmError:
        """Return the error with its hint as the command line has it."""
        values = " ".join(f"--lock {shlex.quote(name)}={x:g}" for name, x in self.lock.items())
        return ArmError(self.what + _hint(self.keep and f"--keep {shlex.quote(self.keep)}", values))


def _hint(*ways: str) -> str:
    found = " or ".join(filter(None, ways))
    return found and f" ({found})"


@dataclass(frozen=True)
class Body:
    """A link: its ten numbers in the frame of the joint that carries it (-1: the base)."""

    name: str
    joint: int
    inertia: Numbers


@dataclass
class Tree:
    """Joints of any kind in an order in which a joint's parent comes before it.

    Attributes
    ----------
    label : str
        What to call it in a message.
    joints : list of Joint
        Their own inertias are not looked at.
    parents : list of int
        Of each joint; -1 the base.
    rest : list of float
        Where each joint is drawn [rad] or [m].
    bodies, frames, shapes : list
    mimics : dict
        Joint: (master, multiplier, offset).
    home : dict
        Joint: value, where the file gives a pose.
    remarks : dict
        What a user should know of how the file was read: said of which joints or links; of those
        joints that are held it does not matter.
    """

    label: str
    name: str = "arm"
    gravity: Numbers = (0.0, 0.0, -9.81)
    joints: list[Joint] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    rest: list[float] = field(default_factory=list)
    bodies: list[Body] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    shapes: list[Shape] = field(default_factory=list)
    mimics: dict[str, tuple[str, float, float]] = field(default_factory=dict)
    home: dict[str, float] = field(default_factory=dict)
    tool: str | None = None
    credit: str = ""
    remarks: dict[str, list[str]] = field(default_factory=dict)

    def serial(
        self,
        lock: Mapping[str, float] | None = None,
        keep: Keep | None = None,
        inertia: str = "error",
        tool: str | None = None,
    ) -> ArmSpec:
        """Return the serial chain that is left where joints are held.

        Parameters
        ----------
        lock
            Joints to hold still, and where [rad] or [m].
        keep
            The arm's joints, or its tip's link: all others are held where they are.
        inertia
            What to do with an inertia that no body has: see `Arm.from_urdf`.
        tool
            The tool's frame.

        Raises
        ------
        HoldError
            What is left is no chain of revolute and prismatic joints; it names what to hold.
        ArgumentError, ArmError
            Unknown names; an inertia that no body has; numbers that no arm has.
        """
        checks.choice("inertia", inertia, INERTIA)
        held = self._held({} if lock is None else lock, keep)
        free = [k for k in range(len(self.joints)) if k not in held]
        self._require_chain(free)
        # Of each joint: which of the chain's carries its frame, and where on it.
        at: dict[int, tuple[int, Any]] = {-1: (-1, placement_of(np.eye(4)[:3].tolist()))}
        chain = list[Joint]()
        for k, joint in enumerate(self.joints):
            carrier, place = at[self.parents[k]]
            place = place * placement_of(joint.placement)
            if k in held:
                if joint.kind in UNITS:
                    place = place * displacement(joint.kind, np.array(joint.axis), held[k])
                at[k] = carrier, place
            else:
                at[k] = len(chain), placement_of(np.eye(4)[:3].tolist())
                chain.append(dataclasses.replace(joint, placement=rows_of(place)))
        bodies = self._bodies(at, inertia)
        for k, joint in enumerate(chain):
            total = summed([body.inertia for body in bodies if body.joint == k])
            chain[k] = dataclasses.replace(joint, inertia=total)
        home = tuple(self.home[joint.name] for joint in chain) if self.home else None
        tip = [frame.name for frame in self.frames if frame.name == keep and frame.joint in free]
        tool = tool or self.tool or next(iter(tip), None)
        spec = ArmSpec(
            tuple(chain),
            tuple(_carried(self.frames, at)),
            tuple(_carried(self.shapes, at)),
            self.name, self.gravity, home, tool, "accept" if inertia == "accept" else "error",
            self.credit,
        )  # fmt: skip
        try:
            spec.require_sound()
        except ArgumentError as error:
            if error.name == "tool":
                raise
            raise ArmError(f"{cut(self.label)}: {error}") from None
        return spec

    def remark(self, name: str, text: str) -> None:
        """Note something of a joint or a link."""
        self.remarks.setdefault(text, []).append(name)

    def warn(self, spec: ArmSpec) -> None:
        """Say what a user should know of how the file was read, as far as it matters to the arm."""
        held = {joint.name for joint in self.joints} - {joint.name for joint in spec.joints}
        for text, names in self.remarks.items():
            told = [name for name in names if name not in held]
            if told or not names:
                of = f"{listed(told)}: " if told else ""
                warnings.warn(f"{cut(self.label)}: {of}{text}", FpidWarning, stacklevel=4)

    # ------------------------------------------------------------------ which joints are held

    def _held(self, lock: Any, keep: Any) -> dict[int, float]:
        names = [joint.name for joint in self.joints]
        if not isinstance(lock, Mapping):
            raise ArgumentError("lock", "a table {joint: value}", shown(lock))
        values: dict[str, float] = {}
        for name, value in lock.items():
            values[checks.choice("lock", name, names)] = checks.number(f"lock.{name}", value)
            kind = self.joints[names.index(name)].kind
            if kind not in UNITS:
                raise ArmError(
                    f"{cut(self.label)}: joint {named(name)}: expected a joint with one coordinate "
                    f"to lock, got {_WORDS.get(kind, kind)}"
                )
        if keep is not None:
            kept = self._kept(keep, names)
            rest = dict(zip(names, self.rest, strict=True))
            values = {name: rest[name] for name in names if name not in kept} | values
        for _ in self.mimics:
            # A mimic joint follows its master, by way of others perhaps; a lock of its own counts.
            for name, (master, factor, offset) in self.mimics.items():
                if name not in lock and master in values:
                    values[name] = factor * values[master] + offset
        return {names.index(name): value for name, value in values.items()}

    def _kept(self, keep: Any, names: list[str]) -> set[str]:
        """Return the joints of the arm, by their names or by the link at its tip."""
        if not isinstance(keep, str):
            checks.instance("keep", keep, Sequence, "joints' names, or the link at the arm's tip")
            return {checks.choice("keep", name, names) for name in keep}
        places = {name: k for k, name in enumerate(names)}
        places |= {frame.name: frame.joint for frame in self.frames}
        return {names[k] for k in self._path(places[checks.choice("keep", keep, places)])}

    def _path(self, joint: int) -> list[int]:
        """Return the joints from the base to this one."""
        path = list[int]()
        while joint >= 0:
            path.append(joint)
            joint = self.parents[joint]
        return path[::-1]

    # ------------------------------------------------------------------ is it a chain

    def _require_chain(self, free: list[int]) -> None:
        label = cut(self.label)
        if not free:
            raise ArmError(f"{label}: expected at least one joint that is free to move, got none")
        if len(free) > MOST_JOINTS:
            raise ArmError(f"{label}: expected at most {MOST_JOINTS} joints, got {len(free)}")
        fault = next(filter(None, map(self._joint_fault, free)), "")
        able = [k for k in free if not self._joint_fault(k)]
        above = {k: next((p for p in reversed(self._path(k)[:-1]) if p in able), -1) for k in able}
        below = {k: [j for j in able if above[j] == k] for k in (-1, *able)}
        branch = next((k for k in below if len(below[k]) > 1), None)
        if branch is not None:
            where = "its base" if branch < 0 else f"joint {named(self.joints[branch].name)}"
            into = listed(self.joints[k].name for k in below[branch])
            fault = fault or (
                f"expected a serial chain, got a tree that branches at {where} into {into}"
            )
        if fault:
            # A finger that others follow is no part of the arm either.
            masters = {master for master, _, _ in self.mimics.values()}
            for k in able:
                if self.joints[k].name in masters and not below[k]:
                    below[above[k]].remove(k)
            chain = _main_chain(below)
            rest = {self.joints[k].name: self.rest[k] for k in free if k not in chain}
            rest = {name: x for name, x in rest.items()
                    if name not in self.mimics or self.mimics[name][0] not in rest}  # fmt: skip
            if any(self.joints[k].kind not in UNITS for k in free):
                rest = {}
            tip = self._link_of(chain[-1]) if chain else ""
            raise HoldError.of(f"{label}: {fault}", rest, tip)

    def _joint_fault(self, k: int) -> str:
        joint, fault = self.joints[k], ""
        if joint.name in self.mimics:
            fault = f"a joint of its own, got one that mimics {named(self.mimics[joint.name][0])}"
        elif joint.kind not in UNITS:
            got = _WORDS.get(joint.kind, joint.kind)
            fault = f"revolute, continuous or prismatic, got {got}"
        return fault and f"joint {named(joint.name)}: expected {fault}"

    def _link_of(self, joint: int) -> str:
        links = [body.name for body in self.bodies if body.joint == joint]
        return (links or [self.joints[joint].name])[0]

    # ------------------------------------------------------------------ what it carries

    def _bodies(self, at: Mapping[int, tuple[int, Any]], inertia: str) -> list[Body]:
        """Return the bodies that move, in the frames of the chain's joints."""
        moving = [body for body in self.bodies if at[body.joint][0] >= 0]
        if moving and inertia != "accept":
            names, rows = [b.name for b in moving], np.array([b.inertia for b in moving])
            if inertia == "nearest":
                for k in np.flatnonzero(np.isfinite(rows).all(axis=1) & impossible(rows)):
                    rows[k], far = nearest_possible(moving[k].inertia)
                    moving[k] = dataclasses.replace(moving[k], inertia=tuple(rows[k].tolist()))
                    self.remark(
                        names[k],
                        f"inertia changed by {100.0 * far:.2g} % to the closest that a body has",
                    )
            require_physical(names, rows, cut(self.label))
        carried = []
        for body in moving:
            joint, place = at[body.joint]
            carried.append(Body(body.name, joint, moved(body.inertia, place)))
        return carried


def _main_chain(below: Mapping[int, list[int]]) -> list[int]:
    """Return the joints to suggest: down the deepest branch, up to where two are as deep."""
    depth: dict[int, int] = {}
    for k in sorted(below, reverse=True):
        depth[k] = 1 + max((depth[j] for j in below[k]), default=0)
    chain, k = list[int](), -1
    while below[k]:
        deepest = max(depth[j] for j in below[k])
        ahead = [j for j in below[k] if depth[j] == deepest]
        if len(ahead) > 1 and chain:
            break
        k = ahead[0]
        chain.append(k)
    return chain


def _carried(items: Sequence[Any], at: Mapping[int, tuple[int, Any]]) -> list[Any]:
    """Return frames or shapes on the joints of the chain."""
    moved = []
    for item in items:
        joint, place = at[item.joint]
        if not place.isIdentity(0.0):
            place = rows_of(place * placement_of(item.placement))
            item = dataclasses.replace(item, placement=place)
        moved.append(dataclasses.replace(item, joint=joint))
    return moved
