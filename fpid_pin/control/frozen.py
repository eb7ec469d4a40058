"""A law whose gains stand still, linearised about rest: what stability is judged by."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.control.observed import beside, observer_system
from fpid_pin.control.operators import Integral
from fpid_pin.control.parameters import joint_scale
from fpid_pin.control.pid import Pid
from fpid_pin.control.sampled import ComplexArray, LinearSystem, operators, signals_of
from fpid_pin.fractional import Design, ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@dataclass(frozen=True, eq=False)
class Terms:
    """The terms e, I^lambda e and D^mu e of all joints, before gains weigh them.

    Attributes
    ----------
    joints
        One system a joint, from its (e, e'); joints of equal orders share one.
    """

    joints: tuple[LinearSystem, ...]

    @cached_property
    def together(self) -> LinearSystem:
        """All joints' terms, (3 n), joint by joint, as one system from [e, e'], (2 n).

        It has no state that no term depends on: int e has no part in I^0 e.
        """
        from scipy.linalg import block_diag

        n = len(self.joints)
        # Joint by joint the inputs come as e_0, e'_0, e_1, ...
        order = np.arange(2 * n).reshape(n, 2).T.reshape(-1)
        a, b, c, d = (block_diag(*(getattr(s, k) for s in self.joints)) for k in "abcd")
        return LinearSystem(a, b[:, order], c, d[:, order]).observed()

    def weighed(self, gains: FloatArray) -> LinearSystem:
        """Return the law (10) with Kp, Ki and Kd, (3, n), their scale included: (2 n) to (n)."""
        n, whole = len(self.joints), self.together
        row = gains.T[:, np.newaxis]
        c, d = (np.reshape(x, (n, 3, -1)) for x in (whole.c, whole.d))
        return LinearSystem(whole.a, whole.b, (row @ c)[:, 0], (row @ d)[:, 0])

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return the terms at points z, (K,), as (K, n, 3, 2)."""
        known = {id(system): system for system in self.joints}
        found = {key: system.response(z) for key, system in known.items()}
        return np.stack([found[id(system)] for system in self.joints], axis=1)


def terms_of(
    controller: Controller, n: int, *, step: float, horizon: float, design: Design | None = None
) -> Terms:
    """Return the terms of an FPID, or of a PID, on n joints.

    Parameters
    ----------
    controller
        An `AdaptiveFpid` or a `Pid`.
    n
        Number of joints.
    step, horizon
        [s].
    design
        In place of the controller's own.
    """
    orders: FloatArray = np.ones((n, 2))
    own: Design = ExponentialSum(modes=24)
    if isinstance(controller, AdaptiveFpid):
        orders, own = controller.orders(n).T, controller.design
    known: dict[tuple[float, ...], LinearSystem] = {}
    for pair in map(tuple, orders.tolist()):
        if pair not in known:
            known[pair] = operators(pair, design or own, step=step, horizon=horizon)
    return Terms(tuple(known[pair] for pair in map(tuple, orders.tolist())))


def gain_table(
    arm: Arm, controller: AdaptiveFpid | Pid, gains: tuple[ArrayLike, ...] | None = None
) -> FloatArray:
    """Return Kp, Ki and Kd, the controller's or those given, times the scale, (3, n)."""
    chosen = (controller.kp, controller.ki, controller.kd) if gains is None else gains
    if len(chosen) != 3:
        raise checks.ArgumentError("gains", "Kp, Ki and Kd", f"{len(chosen)} of them")
    table = [checks.per_joint(f"gains.{k}", x, arm.n, low=0.0) for k, x in enumerate(chosen)]
    return np.array(table) * joint_scale(controller.scale, arm)


def linearised(arm: Arm, controller: Controller, step: float) -> LinearSystem:
    """Linearise a law about home: its torque by its signals, and these by their recursions.

    Signals are angles, rates, int e, and the outputs of operators of e. What a law keeps itself,
    such as parameters that adapt, stays.

    Raises
    ------
    ArgumentError
        The torque jumps there, as sgn without a boundary layer does: half as wide a difference
        gives another slope. An operator of something else than e.
    """
    # Imported late: it loads numba.
    from fpid_pin.control.start import start_all
    from fpid_pin.control.state import MODEL, TORQUES

    n = arm.n
    free = arm.with_limits(effort=np.zeros(n))
    home, horizon = np.asarray(arm.home), 3600.0
    alone = dataclasses.replace(controller, observer=0.0, supervisor=None)
    outputs = list(controller.operators)

    def asked(shift: FloatArray, remembered: str = "") -> tuple[FloatArray, bool]:
        """Return the torque, and whether it writes what it remembers, which is then 1e-3."""
        q, v, *others = np.split(shift, 3 + len(outputs))
        state = start_all([alone], free, step=step, horizon=horizon)[0]
        joints, inputs = state.joints, state.inputs
        inputs[:3] = home + q, v, home
        for name, value in (("q", home + q), ("v", v), ("q_ref", home), ("e", -q), ("e_dot", -v)):
            joints[name] = value
        for name, value in zip(("int_e", *outputs), others, strict=True):
            joints[name] = value
        if remembered:
            joints[remembered] = 1e-3
        if state.in_python:
            state._control()
        elif controller.surface is not None:
            for c in joints:
                controller.surface(c)
        state.make(MODEL | TORQUES)
        return state.torque.copy(), bool(remembered) and bool((joints[remembered] != 1e-3).any())

    def torque(shift: FloatArray) -> FloatArray:
        return asked(shift)[0]

    still = np.zeros((3 + len(outputs)) * n)
    foreign = [name for name, o in controller.operators.items() if o.of != "e"]
    for name in controller.memory:
        felt, written = asked(still, name)
        # What only `adapt` writes is a parameter, what the torque does not feel is a signal.
        if written and not np.array_equal(felt, torque(still)):
            foreign.append(name)
    if foreign:
        got = f"{type(controller).__name__}, whose {', '.join(foreign)} is not"
        raise checks.ArgumentError("controller", "a law of e, its rate and its integral", got)

    def slopes(width: float) -> FloatArray:
        ends = [(torque(shift), torque(-shift)) for shift in width * np.eye((3 + len(outputs)) * n)]
        return np.stack([(up - down) / (2.0 * width) for up, down in ends], axis=1)

    slope = slopes(1e-6)
    if not np.allclose(slope, slopes(5e-7), rtol=1e-3, atol=1e-3 * np.abs(slope).max()):
        got = f"a jump in {type(controller).__name__}"
        raise checks.ArgumentError("controller", "a law that is smooth about home", got)
    angle, rate, *others = np.split(slope, 3 + len(outputs), axis=1)
    state = start_all([alone], free, step=step, horizon=horizon)[0]
    design = controller.fractional_design
    systems = []
    for j in range(n):
        rules = []
        for operator, alpha in zip(controller.operators.values(), state.orders[j], strict=True):
            rules.append((isinstance(operator, Integral), float(alpha)))
        systems.append(signals_of(rules, design, step=step, horizon=horizon))
    # Outputs of each: e, int e, e', then the operators'.
    terms = Terms(tuple(systems)).together
    # e and e' fall as q and q' rise.
    weights = np.stack([-angle, others[0], -rate, *others[1:]], axis=2).reshape(n, -1)
    law = LinearSystem(terms.a, terms.b, weights @ terms.c, weights @ terms.d).observed()
    if controller.observer:
        return beside(law, observer_system(arm, home, controller.observer, step))
    return law
