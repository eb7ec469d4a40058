"""Laws as users write them, in the three forms: joint by joint, whole robot, plain Python."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.control.law import Derivative, Integral
from fpid_pin.fractional import ExponentialSum
from fpid_pin.kernels.functions import winds_up
from fpid_pin.kernels.newton_euler import inverse_dynamics


@dataclass(frozen=True, eq=False)
class JointPd(fp.Controller):
    """kp e + kd e'."""

    kp: ArrayLike
    kd: ArrayLike

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.e_dot


@dataclass(frozen=True, eq=False)
class RobotPd(fp.Controller):
    """The same for all joints at once."""

    kp: ArrayLike
    kd: ArrayLike

    @staticmethod
    def torques(joints, own, model):
        for j in range(joints.size):
            c = joints[j]
            c.u_law = c.scale * (c.kp * c.e + c.kd * c.e_dot)


@dataclass(frozen=True, eq=False)
class PythonPd(fp.Controller):
    """The same for one robot in NumPy."""

    kp: ArrayLike
    kd: ArrayLike

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return np.asarray(self.kp) * (q_ref - q) + np.asarray(self.kd) * (v_ref - v)


@dataclass(frozen=True, eq=False)
class PythonFractional(PythonPd):
    """With an operator of its own beside it, of which the package does not know, and the weight."""

    def begin(self, state):
        state.memory["half"] = state.operator(0.5)
        state.shown["half"] = np.zeros(state.n)

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        half = state.memory["half"].update(q_ref - q, v_ref - v)
        state.shown["half"][:] = half
        pd = super().control(state, q, v, q_ref, v_ref, a_ref)
        return pd + half + state.arm.gravity_vector(q)


PDS = [JointPd, RobotPd, PythonPd]


@dataclass(frozen=True, eq=False)
class JointPid(JointPd):
    """A PID whose integral the engine keeps."""

    ki: ArrayLike

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.ki * c.int_e + c.kd * c.e_dot


@dataclass(frozen=True, eq=False)
class PythonPid(PythonPd):
    """The same in NumPy."""

    ki: ArrayLike

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        e, e_dot = q_ref - q, v_ref - v
        return self.kp * e + self.ki * state.int_e + self.kd * e_dot


@dataclass(frozen=True, eq=False)
class JointGravity(JointPd):
    """A PD and the nominal model's weight: w = 0 and a = 0."""

    uses_model = True


@dataclass(frozen=True, eq=False)
class RobotComputedTorque(fp.Controller):
    """Computed torque, with the model asked by the law itself."""

    k0: float = 100.0
    k1: float = 20.0

    memory = ("tau",)

    def arrays(self, arm, step, horizon):
        return np.zeros((arm.n, 4))  # q, v, a of all joints, and the torques

    @staticmethod
    def torques(joints, own, model):
        q, v, a, tau = own[:, 0], own[:, 1], own[:, 2], own[:, 3]
        for j in range(joints.size):
            c = joints[j]
            q[j], v[j], a[j] = c.q, c.v, c.a_ref + c.k1 * c.e_dot + c.k0 * c.e
        inertias = numbers_of(joints, model)
        inverse_dynamics(
            model.bodies, inertias, model.links, model.motions, model.gravity, q, v, v, a, tau
        )
        for j in range(joints.size):
            joints[j].u_law = tau[j]


def numbers_of(joints, model):
    """Return the ten inertial numbers of each body, (n, 10)."""
    found = np.zeros((joints.size, 10))
    for j in range(joints.size):
        c, row = joints[j], found[j]
        row[0], row[1], row[2], row[3] = c.m, c.h0, c.h1, c.h2
        row[4], row[5], row[6] = c.j00, c.j01, c.j02
        row[7], row[8], row[9] = c.j11, c.j12, c.j22
    return found


@dataclass(frozen=True, eq=False)
class Mit(fp.Controller):
    """A fractional PD whose gain follows a rule of its own, and whose order moves."""

    kp: ArrayLike = 40.0
    kd: ArrayLike = 10.0
    mu: ArrayLike = 0.8
    rate: float = 30.0

    operators = {"d_e": Derivative("mu", adapts=True), "i_s": Integral(0.4, of="s", sign=-1)}

    @staticmethod
    def surface(c):
        c.s = -(c.e_dot + 2.0 * c.e)

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.d_e - c.i_s

    @staticmethod
    def adapt(c):
        if not winds_up(c.cut, -c.s):
            c.kp -= c.h * c.rate * c.s * c.e / (1.0 + c.e * c.e)
            c.mu = min(max(c.mu - c.h * c.s * c.kd * c.d_e_by_order, 0.5), 0.95)


@dataclass(frozen=True, eq=False)
class Many(fp.Controller):
    """Several operators: of e, of the surface, which has one in it, of what is remembered."""

    lam: ArrayLike = 0.4
    mu: ArrayLike = (0.7, 0.9)

    design = ExponentialSum(modes=40)
    operators = {
        "i_s": Integral("lam", of="s", sign=-1),
        "d_e": Derivative("mu"),
        "half": Derivative(0.5),
        "d_slow": Derivative(0.3, of="slow"),
        "i_e": Integral(0.6),
        "d_s": Derivative(0.6, of="s"),
    }
    memory = ("slow",)
    shown = {name: name for name in ("s", "slow", *operators)}

    @staticmethod
    def surface(c):
        c.s = -(c.e_dot + 2.0 * c.half)
        c.slow += 0.05 * (c.v - c.slow)

    @staticmethod
    def torque(c):
        return c.d_e + c.half - c.i_s + c.d_slow + c.i_e + c.d_s


def own(torque=None, **body):
    """Return a law of the joint form, made here, that has these functions and declarations."""
    functions = {"torque", "surface", "adapt", "torques", "adapts"}
    body = body | ({} if torque is None else {"torque": torque})
    body = {k: staticmethod(v) if k in functions else v for k, v in body.items()}
    kind = type("Own", (fp.Controller,), {"__annotations__": {"kp": float}, "kp": 2.0, **body})
    return dataclass(frozen=True, eq=False)(kind)()
