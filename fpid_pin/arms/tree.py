"""What a robot's file says, a tree of joints (`Tree`), and the serial chain that is left of it."""

import json
import shlex
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from fpid_pin import checks, descriptions
from fpid_pin.arms import parts
from fpid_pin.arms.chain import INERTIA, Chain, Row, frame_rows, joint_row
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning
from fpid_pin.text import cut, listed, named, shown

Keep = str | Sequence[str]
_FREE = "FreeFlyer"
_WORDS = {
    _FREE: "a free joint, while an arm's base is fixed",
    "Spherical": "a ball joint",
    "Planar": "a planar joint",
    "Composite": "several joints in one (put a body between them)",
    "Mimic": "one that mimics another (lock it)",
}
#: A position limit beyond this [rad] or [m] is a way of saying that there is none.
UNREACHABLE = 1e4
#: Joints of a branch that is no finger but an arm, one of two on a torso perhaps.
_ARM = 6
#: What to hold as a script, a configuration and the command line write it: how names are quoted,
#: what keeps, what locks, what is between joints, a joint.
_FORMS: dict[str, tuple[Callable[[str], str], str, str, str, str]] = {
    "script": (repr, "keep={}", "lock={{{}}}", ", ", "{}: {:g}"),
    "toml": (json.dumps, "keep = {}", "lock = {{ {} }}", ", ", "{} = {:g}"),
    "shell": (shlex.quote, "--keep {}", "{}", " ", "--lock {}={:g}"),
}


class HoldError(ArmError):
    """Joints have to be held still before there is an arm; a hint says which.

    `lock` has the joints and where they are, `keep` the tip of what would be left or nothing.
    """

    def __init__(self, what: str, lock: Any = None, keep: str = "", form: str = "script") -> None:
        quote, keeping, locking, between, joint = _FORMS[form]
        self.what, self.lock, self.keep = what, lock or {}, keep
        held = between.join(joint.format(quote(name), at) for name, at in self.lock.items())
        ways = [keeping.format(quote(keep))] * bool(keep) + [locking.format(held)] * bool(held)
        super().__init__(what + (f" ({' or '.join(ways)})" if ways else ""))

    def written(self, form: str) -> "HoldError":
        """Return the error with its hint in one of the forms ``script``, ``toml``, ``shell``."""
        return HoldError(self.what, self.lock, self.keep, form)


class Body(NamedTuple):
    """A link: its ten numbers in the frame of the joint that carries it (-1: the base)."""

    name: str
    joint: int
    inertia: parts.Numbers


@dataclass
class Tree:
    """What a reader found: the table of a `Chain`, but of joints of any kind, which may branch.

    Joints are counted from 0, each after its parent; -1 is the base.
    """

    label: str  # what to call it in a message, cut to fit one
    name: str
    gravity: Any  # (3,) [m/s^2]
    joints: list[Row] = field(default_factory=list)  # without inertias; of no kind, a placement
    parents: list[int] = field(default_factory=list)
    frames: list[Row] = field(default_factory=list)
    bodies: list[Body] = field(default_factory=list)
    shapes: list[Row] = field(default_factory=list)
    rest: dict[str, float] = field(default_factory=dict)  # where joints are drawn; 0 if not here
    #: Joint: (master, multiplier, offset).
    followers: dict[str, tuple[str, float, float]] = field(default_factory=dict)
    followers_move: bool = False  # whether they may move on their own
    home: dict[str, float] = field(default_factory=dict)  # of each joint, where the file has a pose
    tool: str | None = None
    credit: str = ""
    #: What a user should know of how the file was read: said of which joints or links.
    remarks: dict[str, list[str]] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the joints."""
        return [joint["name"] for joint in self.joints]

    def serial(
        self,
        lock: Mapping[str, float] | None = None,
        keep: Keep | None = None,
        inertia: str = "error",
        tool: str | None = None,
    ) -> Chain:
        """Return the serial chain that is left where joints are held; see `Arm` for the arguments.

        A `HoldError` where that is none: it names what to hold.
        """
        checks.choice("inertia", inertia, INERTIA)
        held = self._held({} if lock is None else lock, keep)
        free = [k for k in range(len(self.joints)) if k not in held]
        self._require_chain(free)
        # Of each joint: which of the chain's carries its frame, and where on it.
        at: dict[int, tuple[int, Any]] = {-1: (-1, pin.SE3.Identity())}
        joints = list[Row]()
        for k, row in enumerate(self.joints):
            carrier, place = at[self.parents[k]]
            place = place * parts.placement_of(row["placement"])
            if k in held:
                if row["kind"] in parts.UNITS:
                    place = place * parts.displacement(row["kind"], np.array(row["axis"]), held[k])
                at[k] = carrier, place
            else:
                at[k] = len(joints), pin.SE3.Identity()
                joints.append(row | {"placement": parts.rows_of(place)})
        bodies = self._bodies(at, inertia)
        for k, joint in enumerate(joints):
            joint["inertia"] = parts.summed([body.inertia for body in bodies if body.joint == k])
        # The frame called tool, if there is one; else the tip, where the arm was named by a link.
        free_frames = {frame["name"] for frame in self.frames if frame["joint"] in free}
        tip = keep if isinstance(keep, str) and keep in free_frames else None
        named_tool = any(frame["name"] == "tool" for frame in self.frames)
        table = {
            "joints": joints, "frames": _carried(self.frames, at),
            "shapes": _carried(self.shapes, at), "name": self.name or "arm",
            "gravity": self.gravity, "credit": self.credit,
            "home": [self.home[joint["name"]] for joint in joints] if self.home else None,
            "tool": tool or self.tool or ("tool" if named_tool else tip),
            "inertia": "accept" if inertia == "accept" else "error",
        }  # fmt: skip
        try:
            return descriptions.from_dict(table, Chain)
        except ArgumentError as error:
            if error.name == "tool":
                raise
            group, *key = error.name.split(".")
            if group == "joints" and key:
                which = named(joints[int(key[0])]["name"])
                said = f"joint {which}: expected {key[1]} {error.expected}, got {error.got}"
                raise ArmError(f"{self.label}: {said}") from None
            raise ArmError(f"{self.label}: {error}") from None

    def remark(self, name: str, text: str) -> None:
        """Note something of a joint or a link."""
        names = self.remarks.setdefault(text, [])
        names += [name] * (name not in names)

    def warn(self, chain: Chain) -> None:
        """Say what a user should know of how the file was read, as far as it matters to the arm."""
        held = {*self.names} - {joint.name for joint in chain.joints}
        for text, names in self.remarks.items():
            told = [name for name in names if name not in held]
            if told or not names:
                of = f"{listed(told)}: " if told else ""
                warnings.warn(f"{self.label}: {of}{text}", FpidWarning, stacklevel=4)

    # ------------------------------------------------------------------ which joints are held

    def _held(self, lock: Any, keep: Any) -> dict[int, float]:
        names = self.names
        if not isinstance(lock, Mapping):
            raise ArgumentError("lock", "a table {joint: value}", shown(lock))
        values: dict[str, float] = {}
        for name, value in lock.items():
            values[checks.choice("lock", name, names)] = checks.number(f"lock.{name}", value)
            kind = self.joints[names.index(name)]["kind"]
            if kind not in parts.UNITS:
                raise ArmError(
                    f"{self.label}: joint {named(name)}: expected a joint with one coordinate "
                    f"to lock, got {_WORDS.get(kind, kind)}"
                )
        if keep is not None:
            kept = self._kept(keep)
            drawn = {name: self.rest.get(name, 0.0) for name in names if name not in kept}
            values = drawn | values
        for _ in self.followers:
            # A mimic joint follows its master, by way of others perhaps; a lock of its own counts.
            for name, (master, factor, offset) in self.followers.items():
                if name not in lock and master in values:
                    values[name] = factor * values[master] + offset
        return {names.index(name): value for name, value in values.items()}

    def _kept(self, keep: Any) -> set[str]:
        """Return the joints of the arm, by their names or by the link at its tip."""
        if not isinstance(keep, str):
            checks.instance("keep", keep, Sequence, "joints' names, or the link at the arm's tip")
            return {checks.choice("keep", name, self.names) for name in keep}
        places = {name: k for k, name in enumerate(self.names)}
        places |= {frame["name"]: frame["joint"] for frame in self.frames}
        path = self._path(places[checks.choice("keep", keep, places)])
        kept = {self.names[k] for k in path if self.joints[k]["kind"] != _FREE}
        if len(kept) < len(path):
            self.remarks["the base, which is free, is held where it is drawn"] = []
        return kept

    def _path(self, joint: int) -> list[int]:
        """Return the joints from the base to this one."""
        return [] if joint < 0 else [*self._path(self.parents[joint]), joint]

    # ------------------------------------------------------------------ is it a chain

    def _require_chain(self, free: list[int]) -> None:
        names = self.names
        if not free:
            said = "expected at least one joint that is free to move, got none"
            raise ArmError(f"{self.label}: {said}")
        faults = {k: self._joint_fault(k) for k in free}
        able = [k for k in free if not faults[k]]
        above = {k: next((p for p in self._path(k)[-2::-1] if p in able), -1) for k in able}
        below = {k: [j for j in able if above[j] == k] for k in (-1, *able)}
        for joint, branches in below.items():
            if len(branches) > 1:
                where = "its base" if joint < 0 else f"joint {named(names[joint])}"
                into = listed(names[k] for k in branches)
                said = f"expected a serial chain, got a tree that branches at {where} into {into}"
                faults.setdefault(-1, said)
        fault = next(filter(None, faults.values()), "")
        if not fault:
            return
        # A finger that others follow is no part of the arm either.
        fingers = {*self.followers, *(master for master, _, _ in self.followers.values())}
        for k in able:
            if names[k] in fingers and not below[k]:
                below[above[k]].remove(k)
        chain = _main_chain(below)
        others = [names[k] for k in free if k not in chain]
        rest = {name: self.rest.get(name, 0.0) for name in others
                if name not in self.followers or self.followers[name][0] not in others}  # fmt: skip
        if not chain or any(self.joints[k]["kind"] not in parts.UNITS for k in free):
            rest = {}
        # What stands on a joint that no arm has is not to be had by its tip either; a free base is
        # held then.
        stands = chain and not any(
            self._joint_fault(k) for k in self._path(chain[-1]) if self.joints[k]["kind"] != _FREE
        )
        links = [body.name for body in self.bodies if stands and body.joint == chain[-1]]
        tip = [*links, names[chain[-1]]][0] if stands else ""
        raise HoldError(f"{self.label}: {fault}", rest, tip)

    def _joint_fault(self, k: int) -> str:
        name, kind, fault = self.joints[k]["name"], self.joints[k]["kind"], ""
        if name in self.followers and not self.followers_move:
            fault = f"a joint of its own, got one that mimics {named(self.followers[name][0])}"
        elif kind not in parts.UNITS:
            fault = f"revolute, continuous or prismatic, got {_WORDS.get(kind, kind)}"
        return fault and f"joint {named(name)}: expected {fault}"

    # ------------------------------------------------------------------ what it carries

    def _bodies(self, at: Mapping[int, tuple[int, Any]], inertia: str) -> list[Body]:
        """Return the bodies that move, in the frames of the chain's joints."""
        moving = [body for body in self.bodies if at[body.joint][0] >= 0]
        if moving and inertia != "accept":
            names, rows = [b.name for b in moving], np.array([b.inertia for b in moving])
            if inertia == "nearest":
                for k in np.flatnonzero(np.isfinite(rows).all(axis=1) & parts.impossible(rows)):
                    rows[k], far = parts.nearest_possible(moving[k].inertia)
                    moving[k] = moving[k]._replace(inertia=tuple(rows[k].tolist()))
                    self.remark(
                        names[k],
                        f"inertia changed by {100.0 * far:.2g} % to the closest that a body has",
                    )
            parts.require_physical(names, rows, self.label)
        places = [(body, *at[body.joint]) for body in moving]
        return [Body(b.name, joint, parts.moved(b.inertia, place)) for b, joint, place in places]


def _main_chain(below: Mapping[int, list[int]]) -> list[int]:
    """Return the joints to suggest: down the deepest branch, up to where fingers are as deep."""
    depth: dict[int, int] = {}
    for k in sorted(below, reverse=True):
        depth[k] = 1 + max((depth[j] for j in below[k]), default=0)
    chain, k = list[int](), -1
    while below[k]:
        deepest = max(depth[j] for j in below[k])
        ahead = [j for j in below[k] if depth[j] == deepest]
        if len(ahead) > 1 and chain and deepest < _ARM:
            break
        k = ahead[0]
        chain.append(k)
    return chain


def _carried(rows: Sequence[Row], at: Mapping[int, tuple[int, Any]]) -> list[Row]:
    """Return tables of frames or shapes on the joints of the chain."""
    carried = []
    for row in rows:
        joint, place = at[row["joint"]]
        if not place.isIdentity(0.0):
            row = row | {"placement": parts.rows_of(place * parts.placement_of(row["placement"]))}
        carried.append(row | {"joint": joint})
    return carried


def tree_of(model: Any, geometry: Any = None) -> Tree:
    """Return the tree of a ``pinocchio.Model``, with its visual geometry.

    An effort or velocity limit of 0, and position limits that are empty or beyond reach, are none.
    """
    checks.instance("model", model, pin.Model, "a pinocchio.Model")
    if geometry is not None:
        checks.instance("geometry", geometry, pin.GeometryModel, "a pinocchio.GeometryModel")
    name, gravity = str(model.name), np.array(model.gravity.linear)
    tree = Tree(cut(name) or "model", name, gravity, frames=frame_rows(model))
    tree.shapes = [] if geometry is None else parts.shape_rows(geometry)
    poses = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    home = np.array(poses.get("home", ()), dtype=np.float64)
    for k, joint in enumerate(list(model.joints)[1:], start=1):
        row = joint_row(model, k)
        for key in {"effort", "velocity"} & {*row}:
            row[key] = np.inf if row[key] == 0.0 or row[key] > 1e300 else row[key]
        if row["kind"] in parts.UNITS:
            none = row["lower"] >= row["upper"]
            row["lower"] = -np.inf if none or row["lower"] < -UNREACHABLE else row["lower"]
            row["upper"] = np.inf if none or row["upper"] > UNREACHABLE else row["upper"]
        tree.joints.append(row)
        tree.parents.append(int(model.parents[k]) - 1)
        tree.bodies.append(Body(parts.link_of(model, k), k - 1, parts.row_of(model.inertias[k])))
        if home.shape == (model.nq,) and np.isfinite(home).all() and joint.nv == 1:
            at = home[joint.idx_q : joint.idx_q + joint.nq]
            tree.home[row["name"]] = float(at[0] if joint.nq == 1 else np.arctan2(at[1], at[0]))
    return tree
