"""Reading MJCF: MuJoCo's own compiler resolves it, and the compiled model becomes a tree."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin import checks
from fpid_pin.arms import parts
from fpid_pin.arms.chain import Row, own_name
from fpid_pin.arms.robot_file import one_line, parse_xml, read_robot
from fpid_pin.arms.tree import Body, Keep, Tree
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.resources import needed
from fpid_pin.text import cut, listed, named

#: By MuJoCo's enumerations mjtJoint and mjtGeom.
_KINDS = ("FreeFlyer", "Spherical", parts.PRISMATIC, parts.REVOLUTE)
_SOLIDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}
#: Groups of geoms that MuJoCo's viewers show at first; the others are for contacts.
_SHOWN = 2
#: Transmissions (mjtTrn) to a joint and to a tendon; an activation (mjtDyn) that stays within the
#: control's range.
_TO_JOINT, _TENDON, _BOUNDED = (0, 1), 3, (0, 2, 3)
_ANY = (-np.inf, np.inf)
#: An equality constraint (mjtEq) that couples two joints.
_COUPLED = 2


def mjcf_tree(path: str | Path, arm: str | None = None, keep: Keep | None = None) -> Tree:
    """Read an MJCF file as MuJoCo does.

    `arm` is the body at the arm's base; None: the one that holds the link `keep`, else the only one
    that stands in the world and has joints.
    """
    label = cut(str(path))
    parse_xml(read_robot(path, "MJCF"), label, "mujoco")
    mujoco, said = needed("mujoco", "mujoco"), list[str]()
    with one_line(f"{label}: MuJoCo cannot compile it"), _warnings_of(mujoco, said):
        model = mujoco.MjModel.from_xml_path(str(path))
    off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = (0.0,) * 3 if off else _floats(model.opt.gravity)
    tree = _Reader(model, label, gravity).tree(arm, keep)
    tree.remarks |= {f"MuJoCo warns: {cut(' '.join(text.split()))}": [] for text in said}
    return tree


@contextmanager
def _warnings_of(mujoco: Any, said: list[str]) -> Iterator[None]:
    """Collect the warnings that MuJoCo would write to the terminal and to a log file here."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


class _Reader:
    """Reads a compiled model, an ``MjModel``."""

    def __init__(self, model: Any, label: str, gravity: parts.Numbers) -> None:
        self.model = model
        self.bodies = [model.body(k).name or f"body{k}" for k in range(model.nbody)]
        self.joints = [model.joint(k).name or f"joint{k}" for k in range(model.njnt)]
        # The names of a compiled model begin with its own.
        name = bytes(model.names).partition(b"\0")[0].decode()
        name = Path(label).stem if name in ("", "MuJoCo Model") else name
        self.result = Tree(label, name, gravity, followers_move=True)
        #: Of each body of the arm: which joint carries it, and where on it.
        self.at: dict[int, tuple[int, Any]] = {}
        #: Pose of the key frame called home.
        keys = [k for k in range(model.nkey) if model.key(k).name == "home"]
        self.home = model.key_qpos[keys[0]] if keys else None

    def tree(self, arm: str | None, keep: Keep | None) -> Tree:
        model, tree, taken = self.model, self.result, {*self.joints}
        base = self._base(arm, keep)
        # Those below a body come after it.
        for body in range(base, model.nbody):
            above = int(model.body_parentid[body])
            if body == base or above in self.at:
                self._add_body(body, taken, *self.at.get(above, (-1, self._standing(above))))
        for site in range(model.nsite):
            if int(model.site_bodyid[site]) in self.at:
                name = own_name(model.site(site).name, "site", taken)
                self._add_frame(name, "frame", *self._carried("site", site))
        for geom in range(model.ngeom):
            if int(model.geom_bodyid[geom]) in self.at:
                tree.shapes += self._shapes(geom)
        # What pulls at joints in MuJoCo and is no part of an arm here.
        self._couple()
        # Tendons have their own line.
        elsewhere = int(np.isin(model.actuator_trntype, (*_TO_JOINT, _TENDON), invert=True).sum())
        counts = {"equality constraint": model.neq - len(tree.followers), "tendon": model.ntendon,
                  "non-joint actuator": elsewhere, "flexible body": model.nflex,
                  "plugin": model.nplugin}  # fmt: skip
        left_out = [f"{count} {what}(s)" for what, count in counts.items() if count]
        if model.opt.density or model.opt.viscosity or any(model.opt.wind):
            left_out.append("the fluid around it")
        tree.remarks |= {f"left out: {what}": [] for what in left_out}
        return tree

    def _place(self, kind: str, k: int, of: str = "") -> Any:
        """Return where a body, a site, a geom or a mesh is on what it belongs to."""
        position, quaternion = (
            getattr(self.model, f"{kind}_{of}{part}")[k] for part in ("pos", "quat")
        )
        w, x, y, z = (float(part) for part in quaternion)
        return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position))

    def _standing(self, body: int) -> Any:
        """Return where a body is in the world, drawn as it is."""
        if body == 0:
            return pin.SE3.Identity()
        return self._standing(int(self.model.body_parentid[body])) * self._place("body", body)

    def _carried(self, kind: str, k: int) -> tuple[int, Any]:
        """Return the joint that carries a site or a geom, and where on it."""
        joint, place = self.at[int(getattr(self.model, f"{kind}_bodyid")[k])]
        return joint, place * self._place(kind, k)

    def _couple(self) -> None:
        """Note which joints another one leads: q = q(0) + c_0 + c_1 (q of the other - its q(0))."""
        model, tree = self.model, self.result
        for k in np.flatnonzero(model.eq_type == _COUPLED):
            j, master = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            offset, factor, *higher = (float(x) for x in model.eq_data[k][:5])
            names = [self.joints[i] for i in (j, master)]
            if master >= 0 and not any(higher) and {*names} <= {*tree.names}:
                rest, its_rest = (tree.rest[name] for name in names)
                tree.followers[names[0]] = (names[1], factor, rest + offset - factor * its_rest)
                tree.remark(names[0], f"left out: an equality constraint to {named(names[1])}")

    def _base(self, arm: str | None, keep: Keep | None) -> int:
        """Return the body at the arm's base; note what else moves in the world."""
        model, names, label = self.model, self.bodies, self.result.label
        roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
        below = model.body_rootid[model.jnt_bodyid]
        moving = {root: model.jnt_type[below == root].tolist() for root in roots}
        if arm is not None:
            base = names.index(checks.choice("arm", arm, names[1:]))
        elif isinstance(keep, str) and keep in names:
            base = int(model.body_rootid[names.index(keep)])
        else:
            fixed = [root for root in roots if moving[root] and 0 not in moving[root]]
            found = fixed or [root for root in roots if moving[root]]
            # Beside an arm stand doors, boxes and targets, which have fewer joints.
            most = max((len(moving[root]) for root in found), default=0)
            found = [root for root in found if len(moving[root]) == most]
            if len(found) != 1:
                some = f"{len(found)}: {listed(names[b] for b in found)}" if found else "none"
                which = " (say which by the last link of its arm: keep, or --keep)"
                raise ArmError(
                    f"{label}: expected one body in the world with joints, got {some}"
                    + which * bool(found)
                )
            base = found[0]
        root = int(model.body_rootid[base])
        out = [b for b in roots if b != root and (moving[b] or model.body_mocapid[b] >= 0)]
        if out:
            said = f"left out: other bodies that move: {listed(names[b] for b in out)}"
            self.result.remarks[said] = []
        return base

    # ------------------------------------------------------------------ bodies and joints

    def _add_body(self, body: int, taken: set[str], carrier: int, place: Any) -> None:
        """Add a body, on a joint and where on it, and the joints that it has itself."""
        model, tree, name = self.model, self.result, self.bodies[body]
        place = place * self._place("body", body)
        first = int(model.body_jntadr[body])
        for j in range(first, first + int(model.body_jntnum[body])):
            # The joint's frame is the body's, moved to where the joint is.
            to_joint = pin.SE3(np.eye(3), np.array(model.jnt_pos[j]))
            back = self._add_joint(j, carrier, place * to_joint)
            carrier, place = len(tree.joints) - 1, back * to_joint.inverse()
        self.at[body] = carrier, place
        xx, yy, zz = (float(x) for x in model.body_inertia[body])
        principal = (float(model.body_mass[body]), 0.0, 0.0, 0.0, xx, 0.0, yy, 0.0, 0.0, zz)
        inertia = parts.moved(principal, place * self._place("body", body, "i"))
        tree.bodies.append(Body(name, carrier, inertia))
        self._add_frame(own_name(name, "link", taken), "link", carrier, place)
        if model.body_gravcomp[body] and carrier >= 0:
            tree.remark(name, "left out: gravity compensation")

    def _add_frame(self, name: str, kind: str, joint: int, place: Any) -> None:
        frame = {"name": name, "joint": joint, "type": kind, "placement": parts.rows_of(place)}
        self.result.frames.append(frame)

    def _add_joint(self, j: int, carrier: int, place: Any) -> Any:
        """Add a joint; return its body's frame in the joint's, but for the joint's own place."""
        model, name, tree = self.model, self.joints[j], self.result
        kind, at = _KINDS[int(model.jnt_type[j])], int(model.jnt_qposadr[j])
        row: Row = {"name": name, "kind": kind, "placement": parts.rows_of(place)}
        tree.joints.append(row)
        tree.parents.append(carrier)
        if kind not in parts.UNITS:
            return pin.SE3.Identity()
        row |= {"axis": np.array(model.jnt_axis[j])} | self._numbers(j)
        # A coordinate is measured from qpos0, where the file draws the body.
        tree.rest[name] = float(model.qpos0[at])
        if self.home is not None:
            tree.home[name] = float(self.home[at])
        return parts.displacement(kind, row["axis"], -tree.rest[name])

    def _numbers(self, j: int) -> dict[str, float]:
        """Return a joint's limits, friction and rotor inertia; note what they leave out."""
        model, name, tree = self.model, self.joints[j], self.result
        dof = int(model.jnt_dofadr[j])
        drives = np.isin(model.actuator_trntype, _TO_JOINT) & (model.actuator_trnid[:, 0] == j)
        actuators = np.flatnonzero(drives)
        lower, upper = _span(model.jnt_limited, model.jnt_range, j)
        least, most = self._effort(j, actuators)
        if abs(least) != abs(most):
            tree.remark(name, f"effort from {least:g} to {most:g} is taken as the larger to both "
                              "sides (with_limits sets another)")  # fmt: skip
        if model.nu and not len(actuators):
            tree.remark(name, "no actuator of its own, taken as driven without a limit")
        if model.jnt_stiffness[j] or _any(model, "jnt_stiffnesspoly", j):
            tree.remark(name, "left out: a spring")
        if _any(model, "dof_dampingpoly", dof):
            tree.remark(name, "left out: damping that is not linear")
        numbers = {
            "lower": lower, "upper": upper, "effort": max(abs(least), abs(most)) or np.inf,
            "friction": float(model.dof_frictionloss[dof]),
        }  # fmt: skip
        for key in ("damping", "armature"):
            # Those of actuators count through the gear; older compilers do not have them.
            theirs = getattr(model, f"actuator_{key}", np.zeros(model.nu))
            extra = sum(float(model.actuator_gear[i][0]) ** 2 * float(theirs[i]) for i in actuators)
            numbers[key] = float(getattr(model, f"dof_{key}")[dof]) + extra
        return numbers

    def _effort(self, j: int, actuators: Any) -> tuple[float, float]:
        """Return the least and the most that a joint's actuators give together [N m] or [N]."""
        model, forces = self.model, []
        for i in actuators:
            low, high = _span(model.actuator_forcelimited, model.actuator_forcerange, i)
            motor = model.actuator_gaintype[i] == 0 and model.actuator_biastype[i] == 0
            if motor and model.actuator_dyntype[i] in _BOUNDED and model.actuator_ctrllimited[i]:
                least, most = np.sort(model.actuator_gainprm[i][0] * model.actuator_ctrlrange[i])
                low, high = max(low, least), min(high, most)
            gear = model.actuator_gear[i][0]
            forces.append(np.sort(gear * np.array([low, high])) if gear else np.zeros(2))
        least, most = np.sum(forces, axis=0) if forces else _ANY
        low, high = _span(model.jnt_actfrclimited, model.jnt_actfrcrange, j)
        return max(least, low), min(most, high)

    # ------------------------------------------------------------------ what is drawn

    def _shapes(self, geom: int) -> Iterator[Row]:
        model, kind = self.model, _SOLIDS.get(int(self.model.geom_type[geom]))
        material = int(model.geom_matid[geom])
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        if kind is None or model.geom_group[geom] > _SHOWN or not colour[3] > 0.0:
            return
        joint, place = self._carried("geom", geom)
        size, path = _floats(model.geom_size[geom]), ""
        if kind == "mesh":
            mesh = int(model.geom_dataid[geom])
            # The compiler moves a mesh to its centre of mass and principal axes.
            place = place * self._place("mesh", mesh).inverse()
            size = _floats(model.mesh_scale[mesh])
            paths, at = bytes(model.paths), int(model.mesh_pathadr[mesh])
            if at < 0:
                return
            path = str(Path(paths[at : paths.index(b"\0", at)].decode()).resolve())
        elif kind == "box":
            size = _floats(2.0 * x for x in size)
        elif kind in ("capsule", "cylinder"):
            size = (size[0], 2.0 * size[1])
        elif kind == "sphere":
            size = size[:1]
        yield {"joint": joint, "placement": parts.rows_of(place), "kind": kind, "size": size,
               "colour": _floats(colour), "path": path}  # fmt: skip


def _any(model: Any, name: str, k: int) -> bool:
    """Return whether an array has something but zeros there; older compilers do not have all."""
    return bool(np.any(getattr(model, name, np.zeros((k + 1, 1)))[k]))


def _span(limited: Any, ranges: Any, k: int) -> FloatArray:
    return np.array(ranges[k] if limited[k] else _ANY)


def _floats(values: Any) -> parts.Numbers:
    return tuple(float(x) for x in values)
