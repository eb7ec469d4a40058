"""Reading MJCF: MuJoCo's own compiler resolves it, and the compiled model becomes a tree."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin import checks
from fpid_pin.arms.chain import Row, own_name
from fpid_pin.arms.parts import (
    PRISMATIC,
    REVOLUTE,
    UNITS,
    Numbers,
    displacement,
    moved,
    rows_of,
)
from fpid_pin.arms.robot_file import one_line, parse_xml, read_robot, require_root
from fpid_pin.arms.tree import Body, Keep, Tree
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.resources import needed
from fpid_pin.text import cut, listed, named

#: By MuJoCo's enumerations mjtJoint and mjtGeom.
_KINDS = ("FreeFlyer", "Spherical", PRISMATIC, REVOLUTE)
_SOLIDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}
#: Groups of geoms that MuJoCo's viewers show at first; the others are for contacts.
_SHOWN = 2
#: Transmissions (mjtTrn) to a joint; an activation (mjtDyn) that stays within the control's range.
_TO_JOINT, _BOUNDED = (0, 1), (0, 2, 3)
_ANY = (-np.inf, np.inf)
#: An equality constraint (mjtEq) that couples two joints.
_COUPLED = 2


def mjcf_tree(path: str | Path, arm: str | None = None, keep: Keep | None = None) -> Tree:
    """Read an MJCF file as MuJoCo does.

    `arm` is the body at the arm's base; None: the one that holds the link `keep`, else the only one
    that stands in the world and has joints.
    """
    label = cut(str(path))
    require_root(parse_xml(read_robot(path, "MJCF"), label), "mujoco", label)
    mujoco = needed("mujoco", "mujoco")
    with one_line(f"{label}: MuJoCo cannot compile it"):
        model = mujoco.MjModel.from_xml_path(str(path))
    off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = (0.0,) * 3 if off else _floats(model.opt.gravity)
    return _Reader(model, label, gravity).tree(arm, keep)


class _Reader:
    """Reads a compiled model, an ``MjModel``."""

    def __init__(self, model: Any, label: str, gravity: Numbers) -> None:
        self.model = model
        self.bodies = [model.body(k).name or f"body{k}" for k in range(model.nbody)]
        self.joints = [model.joint(k).name or f"joint{k}" for k in range(model.njnt)]
        # The names of a compiled model begin with its own.
        name = bytes(model.names).partition(b"\0")[0].decode()
        name = Path(label).stem if name in ("", "MuJoCo Model") else name
        self.result = Tree(label, name, gravity, followers_move=True)
        #: Of each body: which joint carries it, and where on it.
        self.at: dict[int, tuple[int, Any]] = {0: (-1, pin.SE3.Identity())}
        #: Pose of the key frame called home.
        keys = [k for k in range(model.nkey) if model.key(k).name == "home"]
        self.home = model.key_qpos[keys[0]] if keys else None

    def tree(self, arm: str | None, keep: Keep | None) -> Tree:
        model, tree = self.model, self.result
        base = self._base(arm, keep)
        for body in self._above(base):
            carrier, place = self.at[model.body_parentid[body]]
            self.at[body] = carrier, place * _pose(model.body_pos[body], model.body_quat[body])
        taken = {*self.joints}
        for body in range(base, model.nbody):
            if base in self._above(body):
                self._add_body(body, taken)
        for site in range(model.nsite):
            if (body := int(model.site_bodyid[site])) in self.at and body >= base:
                joint, place = self.at[body]
                name = own_name(model.site(site).name, "site", taken)
                place = place * _pose(model.site_pos[site], model.site_quat[site])
                tree.frames.append(_frame(name, joint, "frame", place))
        for geom in range(model.ngeom):
            if int(model.geom_bodyid[geom]) in self.at and int(model.geom_bodyid[geom]) >= base:
                tree.shapes += self._shapes(geom)
        # What pulls at joints in MuJoCo and is no part of an arm here.
        self._couple()
        counts = {"equality constraint": model.neq - len(tree.followers), "tendon": model.ntendon,
                  "flexible body": model.nflex, "plugin": model.nplugin}  # fmt: skip
        left_out = [f"{count} {what}(s)" for what, count in counts.items() if count]
        if model.opt.density or model.opt.viscosity or any(model.opt.wind):
            left_out.append("the fluid around it")
        tree.remarks |= {f"left out: {what}": [] for what in left_out}
        return tree

    def _above(self, body: int) -> list[int]:
        """Return the bodies from the world, which is not among them, to this one."""
        path = list[int]()
        while body:
            path.append(body)
            body = int(self.model.body_parentid[body])
        return path[::-1]

    def _couple(self) -> None:
        """Note which joints another one leads: q = q(0) + c_0 + c_1 (q of the other - its q(0))."""
        model, tree = self.model, self.result
        for k in np.flatnonzero(model.eq_type == _COUPLED):
            j, master = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            offset, factor, *higher = (float(x) for x in model.eq_data[k][:5])
            names = [self.joints[i] for i in (j, master)]
            if master >= 0 and not any(higher) and {*names} <= {*tree.names}:
                rest, its_rest = (float(model.qpos0[model.jnt_qposadr[i]]) for i in (j, master))
                tree.followers[names[0]] = (names[1], factor, rest + offset - factor * its_rest)
                tree.remark(names[0], f"left out: an equality constraint to {named(names[1])}")

    # ------------------------------------------------------------------ the arm in a scene

    def _base(self, arm: str | None, keep: Keep | None) -> int:
        model, names, label = self.model, self.bodies, self.result.label
        roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
        moving = {
            root: [int(model.jnt_type[j]) for j in range(model.njnt)
                   if model.body_rootid[model.jnt_bodyid[j]] == root]
            for root in roots
        }  # fmt: skip
        if arm is not None:
            base = names.index(checks.choice("arm", arm, names[1:]))
        elif isinstance(keep, str) and keep in names:
            base = int(model.body_rootid[names.index(keep)])
        else:
            fixed = [root for root in roots if moving[root] and 0 not in moving[root]]
            found = fixed or [root for root in roots if moving[root]]
            if len(found) != 1:
                some = f"{len(found)}: {listed(names[b] for b in found)}" if found else "none"
                raise ArmError(
                    f"{label}: expected one body in the world with joints, got {some}"
                    + (" (arm names the base of one, or keep its tip)" if found else "")
                )
            base = found[0]
        root = int(model.body_rootid[base])
        out = [b for b in roots if b != root and (moving[b] or model.body_mocapid[b] >= 0)]
        if out:
            said = f"left out: other bodies that move: {listed(names[b] for b in out)}"
            self.result.remarks[said] = []
        return base

    # ------------------------------------------------------------------ bodies and joints

    def _add_body(self, body: int, taken: set[str]) -> None:
        model, tree = self.model, self.result
        carrier, place = self.at[int(model.body_parentid[body])]
        place = place * _pose(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for j in range(first, first + int(model.body_jntnum[body])):
            # The joint's frame is the body's, moved to where the joint is.
            to_joint = pin.SE3(np.eye(3), np.array(model.jnt_pos[j]))
            back = self._add_joint(j, carrier, place * to_joint)
            carrier, place = len(tree.joints) - 1, back * to_joint.inverse()
        self.at[body] = carrier, place
        xx, yy, zz = (float(x) for x in model.body_inertia[body])
        principal = (float(model.body_mass[body]), 0.0, 0.0, 0.0, xx, 0.0, yy, 0.0, 0.0, zz)
        inertia = moved(principal, place * _pose(model.body_ipos[body], model.body_iquat[body]))
        name = self.bodies[body]
        tree.bodies.append(Body(name, carrier, inertia))
        tree.frames.append(_frame(own_name(name, "link", taken), carrier, "link", place))
        if model.body_gravcomp[body] and carrier >= 0:
            tree.remark(name, "left out: gravity compensation")

    def _add_joint(self, j: int, carrier: int, place: Any) -> Any:
        """Add a joint; return its body's frame in the joint's, but for the joint's own place."""
        model, name, tree = self.model, self.joints[j], self.result
        kind, dof = _KINDS[int(model.jnt_type[j])], int(model.jnt_dofadr[j])
        row: Row = {"name": name, "kind": kind, "placement": rows_of(place)}
        tree.joints.append(row)
        tree.parents.append(carrier)
        if kind not in UNITS:
            return pin.SE3.Identity()
        axis, at = np.array(model.jnt_axis[j]), int(model.jnt_qposadr[j])
        row |= {"axis": axis} | self._numbers(j, dof)
        # A coordinate is measured from qpos0, where the file draws the body.
        tree.rest[name] = float(model.qpos0[at])
        if self.home is not None:
            tree.home[name] = float(self.home[at])
        return displacement(kind, axis, -tree.rest[name])

    def _numbers(self, j: int, dof: int) -> dict[str, float]:
        """Return a joint's numbers, by their names in `VECTORS`; note what they leave out."""
        model, name, tree = self.model, self.joints[j], self.result
        lower, upper = _span(model.jnt_limited, model.jnt_range, j)
        least, most = self._effort(j)
        if abs(least) != abs(most):
            tree.remark(name, f"effort from {least:g} to {most:g} is taken as the larger to both "
                              "sides (with_limits sets another)")  # fmt: skip
        gears = [(float(model.actuator_gear[i][0]), i) for i in self._actuators(j)]
        if model.nu and not gears:
            tree.remark(name, "no actuator, taken as driven without a limit")
        if model.jnt_stiffness[j] or _any(model, "jnt_stiffnesspoly", j):
            tree.remark(name, "left out: a spring")
        if _any(model, "dof_dampingpoly", dof):
            tree.remark(name, "left out: damping that is not linear")
        extra = {
            key: sum(gear**2 * float(getattr(model, f"actuator_{key}", np.zeros(model.nu))[i])
                     for gear, i in gears)
            for key in ("armature", "damping")
        }  # fmt: skip
        return {
            "lower": lower, "upper": upper, "effort": max(abs(least), abs(most)) or np.inf,
            "velocity": np.inf, "friction": float(model.dof_frictionloss[dof]),
            "damping": float(model.dof_damping[dof]) + extra["damping"],
            "armature": float(model.dof_armature[dof]) + extra["armature"],
        }  # fmt: skip

    # ------------------------------------------------------------------ actuators

    def _actuators(self, j: int) -> list[int]:
        model = self.model
        driven = np.isin(model.actuator_trntype, _TO_JOINT) & (model.actuator_trnid[:, 0] == j)
        return [int(i) for i in np.flatnonzero(driven)]

    def _effort(self, j: int) -> FloatArray:
        """Return the least and the most that a joint's actuators give together [N m] or [N]."""
        forces = [self._force(i) for i in self._actuators(j)]
        least, most = np.sum(forces, axis=0) if forces else _ANY
        low, high = _span(self.model.jnt_actfrclimited, self.model.jnt_actfrcrange, j)
        return np.array([max(least, low), min(most, high)])

    def _force(self, i: int) -> FloatArray:
        model = self.model
        low, high = _span(model.actuator_forcelimited, model.actuator_forcerange, i)
        motor = model.actuator_gaintype[i] == 0 and model.actuator_biastype[i] == 0
        if motor and model.actuator_dyntype[i] in _BOUNDED and model.actuator_ctrllimited[i]:
            least, most = np.sort(model.actuator_gainprm[i][0] * model.actuator_ctrlrange[i])
            low, high = max(low, least), min(high, most)
        gear = model.actuator_gear[i][0]
        return np.sort(gear * np.array([low, high])) if gear else np.zeros(2)

    # ------------------------------------------------------------------ what is drawn

    def _shapes(self, geom: int) -> Iterator[Row]:
        model, kind = self.model, _SOLIDS.get(int(self.model.geom_type[geom]))
        material = int(model.geom_matid[geom])
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        if kind is None or model.geom_group[geom] > _SHOWN or not colour[3] > 0.0:
            return
        joint, place = self.at[int(model.geom_bodyid[geom])]
        place = place * _pose(model.geom_pos[geom], model.geom_quat[geom])
        size, path = _floats(model.geom_size[geom]), ""
        if kind == "mesh":
            mesh = int(model.geom_dataid[geom])
            # The compiler moves a mesh to its centre of mass and principal axes.
            place = place * _pose(model.mesh_pos[mesh], model.mesh_quat[mesh]).inverse()
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
        yield {"joint": joint, "placement": rows_of(place), "kind": kind, "size": size,
               "colour": _floats(colour), "path": path}  # fmt: skip


def _frame(name: str, joint: int, kind: str, place: Any) -> Row:
    return {"name": name, "joint": joint, "type": kind, "placement": rows_of(place)}


def _pose(position: Any, quaternion: Any) -> Any:
    w, x, y, z = (float(part) for part in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position))


def _any(model: Any, name: str, k: int) -> bool:
    """Return whether an array has something but zeros there; older compilers do not have all."""
    return bool(np.any(getattr(model, name, np.zeros((k + 1, 1)))[k]))


def _span(limited: Any, ranges: Any, k: int) -> FloatArray:
    return np.array(ranges[k] if limited[k] else _ANY)


def _floats(values: Any) -> Numbers:
    return tuple(float(x) for x in values)
