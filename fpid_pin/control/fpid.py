"""The adaptive fractional PID, eqs. (9) and (10), for one robot or a population in lockstep."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.disturbance import observer_gains
from fpid_pin.control.model_terms import ModelTerms
from fpid_pin.control.parameters import check_gains, check_scale, joint_scale
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.state import State
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.descriptions import described
from fpid_pin.exceptions import DesignError
from fpid_pin.fractional import Design, ExponentialSum
from fpid_pin.fractional.design import modes_of
from fpid_pin.fractional.modes import INITIALISATIONS

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

REGRESSORS = ("law", "integer")
#: Orders at which the table is laid out that orders which move are interpolated in: a cubic on
#: this grid is within 1e-7 of the operator, as the operator of 24 modes is of the exact one.
NODES = 201


@described("adaptive_fpid")
@dataclass(frozen=True, eq=False)
class AdaptiveFpid(Controller):
    """Adaptive fractional PID with an optional supervisor, U = u_FPID + u_s (9).

    Per joint (10), with gains that follow (30)-(32),

        u_FPID = s (Kp e + Ki I^lambda e + Kd D^mu e)

    With orders 1 it is the integer adaptive PID, exactly; with `learning_rate` 0 a fixed-gain
    FPID. Every argument is a scalar, for all joints, or an (n,) array.

    Parameters
    ----------
    kp, ki, kd
        Initial gains [N m/rad], [N m/(rad s^lambda)], [N m s^mu/rad], over the scale's unit if any.
    integral_order, derivative_order
        lambda and mu, in [0, 1].
    learning_rate
        gamma; also (3, n), a row each for Kp, Ki, Kd.
    k0, k1
        Sliding surface ``S = -(e' + k1 e + k0 int e)`` [1/s^2], [1/s].
    supervisor
        None: no supervisory torque.
    regressors
        ``"law"``: the gradient of (10) itself; ``"integer"``: e, int e, e' as printed.
    design
        How the fractional operators are realised: one with modes.
    initialisation
        What the operators take the error to have been before t = 0: ``"caputo"``,
        ``"riemann_liouville"`` or ``"grunwald_letnikov"``; see `fpid_pin.fractional.Bank`.
    scale
        Factor s: ``"none"`` (1, as in the paper), ``"inertia"`` (M_jj at the arm's home), or (n,).
    safeguards
        Bounds and leakage for the adapted gains; None: none, as in the paper.
    order_learning_rate
        Of the orders, gamma_o; 0: they stay. Scalar, (n,), or (2, n), a row each for lambda and
        mu: ``lambda' = -gamma_o S s Ki dI^lambda e/dlambda`` and likewise mu, the gradient that
        moves the gains. Wants a design with shared poles.
    integral_order_bounds, derivative_order_bounds
        What orders that move stay within, in [0, 1].
    feedforward
        Whether the nominal model's torque for the reference, M q''_d + C q'_d + G + F_v q'_d, is
        added.
    observer
        Bandwidth [rad/s] of an observer of what the nominal model lacks, whose estimate is
        cancelled; 0: none.
    name
        What tables and figures call it; ``adaptive_fpid`` if empty.
    """

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    integral_order: ArrayLike = 1.0
    derivative_order: ArrayLike = 1.0
    learning_rate: ArrayLike = 25.0
    k0: ArrayLike = 1.0
    k1: ArrayLike = 2.0
    supervisor: Supervisor | None = None
    regressors: str = "law"
    design: Design = field(default_factory=lambda: ExponentialSum(modes=24))
    initialisation: str = "caputo"
    scale: str | ArrayLike = "none"
    safeguards: Safeguards | None = None
    order_learning_rate: ArrayLike = 0.0
    integral_order_bounds: Sequence[float] = (0.02, 1.0)
    derivative_order_bounds: Sequence[float] = (0.3, 1.0)
    feedforward: bool = False
    observer: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        check_scale(self)
        for name, rows in (("learning_rate", 3), ("order_learning_rate", 2)):
            rate = checks.floats(name, getattr(self, name), low=0.0, max_ndim=2)
            if rate.ndim == 2 and rate.shape[0] != rows:
                expected = f"shape (n,) or ({rows}, n)"
                raise checks.ArgumentError(name, expected, f"shape {rate.shape}")
            object.__setattr__(self, name, rate)
        for name in ("integral_order_bounds", "derivative_order_bounds"):
            bounds = checks.floats(name, getattr(self, name), low=0.0, high=1.0, max_ndim=1)
            if bounds.shape != (2,) or bounds[0] > bounds[1]:
                raise checks.ArgumentError(name, "a lower and an upper bound", bounds.tolist())
            object.__setattr__(self, name, tuple(bounds.tolist()))
        checks.instance("feedforward", self.feedforward, bool, "true or false")
        object.__setattr__(self, "observer", checks.number("observer", self.observer, low=0.0))
        check_gains(self, "kp", "ki", "kd", "k0", "k1", what="gains and orders")
        orders = ("integral_order", "derivative_order")
        check_gains(self, *orders, high=1.0, what="gains and orders")
        checks.choice("regressors", self.regressors, REGRESSORS)
        checks.choice("initialisation", self.initialisation, INITIALISATIONS)
        checks.instance("design", self.design, Design, "a fractional design")
        if self.supervisor is not None:
            checks.instance("supervisor", self.supervisor, Supervisor, "a Supervisor or None")
        if self.safeguards is not None:
            checks.instance("safeguards", self.safeguards, Safeguards, "Safeguards or None")
        _ = self.bandwidth

    @property
    def bandwidth(self) -> float:
        """Of the one observer of law and supervisor [rad/s]; 0: none.

        Raises
        ------
        ArgumentError
            The two ask for different ones.
        """
        other = 0.0 if self.supervisor is None else self.supervisor.observer
        if self.observer and other and self.observer != other:
            raise checks.ArgumentError(
                "observer", f"the supervisor's bandwidth ({other:g} rad/s)", self.observer
            )
        return self.observer or other

    @property
    def moves_orders(self) -> bool:
        """Whether orders adapt."""
        return bool(np.any(self.order_learning_rate))

    def lockstep_key(self) -> Hashable:
        """Return what all runs of a batch must share: design, start, and what the model does."""
        kind = None if self.supervisor is None else self.supervisor.kind
        model = (kind, self.feedforward, self.observer > 0.0, self.bandwidth > 0.0)
        return (type(self), self.design, self.initialisation, self.moves_orders, *model)

    @classmethod
    def start_many(
        cls, controllers: Sequence[AdaptiveFpid], arm: Arm, *, step: float, horizon: float
    ) -> FpidState:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return FpidState(controllers, arm, step, horizon)

    def scale_on(self, arm: Arm) -> FloatArray:
        """Return s of (10) on an arm, (n,)."""
        return joint_scale(self.scale, arm)

    def rates(self, n: int) -> FloatArray:
        """Return gamma of Kp, Ki, Kd, lambda and mu on an arm with n joints, (5, n)."""
        found = []
        for name, rows in (("learning_rate", 3), ("order_learning_rate", 2)):
            rate = np.asarray(getattr(self, name))
            if rate.ndim == 2 and rate.shape != (rows, n):
                raise checks.ArgumentError(name, f"shape ({rows}, {n})", f"{rate.shape}")
            one = rate if rate.ndim == 2 else checks.spread(name, rate, n)
            found.append(np.broadcast_to(one, (rows, n)))
        return np.concatenate(found)

    def orders(self, n: int) -> FloatArray:
        """Return the orders of the derivatives that are taken, of int e and of e, (n, 2)."""
        lam = checks.spread("integral_order", self.integral_order, n)
        return np.stack([1.0 - lam, checks.spread("derivative_order", self.derivative_order, n)],
                        axis=1)  # fmt: skip


class FpidState(State):
    """The records of `kernels.law` for all runs; Pinocchio helps where a supervisor acts."""

    def __init__(
        self, controllers: Sequence[AdaptiveFpid], arm: Arm, step: float, horizon: float
    ) -> None:
        super().__init__(len(controllers), arm, step)
        # Imported late: it loads numba.
        from fpid_pin.kernels import law

        self._fpids = cast("Callable[..., bool]", law.fpids)
        self.robots = np.zeros(self.runs, law.ROBOT)
        self.joints = np.zeros(self.torque.shape, law.JOINT)
        self.robots["h"], self.robots["threshold"] = self.step, np.inf
        self.joints["limit"] = arm.effort_limit
        for robot, joints, controller in zip(self.robots, self.joints, controllers, strict=True):
            _fill(robot, joints, controller, arm)
        self._design, self._horizon = controllers[0].design, horizon
        self.orders = np.array([c.orders(self.n) for c in controllers])
        modes = modes_of(self._design, self.orders, step=self.step, horizon=horizon)
        self._ops, self._poles, self._modes = modes.records(controllers[0].initialisation)
        self._ramp: tuple[FloatArray, FloatArray, int, int] | None = None
        first = controllers[0]
        self._moves = first.moves_orders
        table = np.zeros((4, 3 + self._modes.shape[-1]))
        if self._moves:
            self._need_shared_poles()
            nodes = np.linspace(0.0, 1.0, NODES)
            table = modes_of(self._design, nodes, step=self.step, horizon=horizon).table()
        self._model = None
        if first.supervisor or first.feedforward or any(c.bandwidth for c in controllers):
            self._model = ModelTerms(controllers, arm, self.robots, self.joints)
        self._records = (self.robots, self.joints, self._ops, self._poles, self._modes, table)
        # A tick of nobody: what is yet to be compiled is so now, not in a robot's first period.
        nobody, inputs = np.zeros_like(self.alive), np.zeros((5, *self.torque.shape))
        self._fpids(nobody, *self._records, inputs, self.torque)
        if self._model is not None:
            self._model.add(nobody, inputs, True, self.torque)

    def tick(self, inputs: FloatArray) -> None:
        """See `State.tick`."""
        if self._ramp is not None:
            self._climb()
        acts = self._fpids(self.alive, *self._records, inputs, self.torque)
        if self._model is not None:
            self._model.add(self.alive, inputs, acts, self.torque)

    def signals(self) -> Mapping[str, FloatArray]:
        """Return views of kp, ki, kd, u_fpid, u_s and s, (runs, n), and of lyapunov, (runs,).

        Where orders move, also of them; where the model adds to the torque, of what it adds.
        """
        views = {name: self.joints[name] for name in ("kp", "ki", "kd", "u_fpid", "u_s", "s")}
        if self._model is not None and self._model.compensates:
            views["u_model"] = self.joints["u_m"]
        if self._moves:
            views |= {"integral_order": self.joints["lam"], "derivative_order": self.joints["mu"]}
        return views | {"lyapunov": self.robots["value"]}

    def set_orders(
        self,
        integral_order: ArrayLike | None = None,
        derivative_order: ArrayLike | None = None,
        *,
        ramp: float = 0.0,
    ) -> None:
        """Change lambda and mu while running, (n,) or (runs, n); None leaves as it is.

        From now on (or, with a `ramp` [s], from its end) the terms are those of a law that had the
        new orders from the start.

        Raises
        ------
        DesignError
            A design whose poles depend on the order: its modes mean nothing to another one.
        """
        new = self.orders.copy()
        if integral_order is not None:
            order = checks.floats("integral_order", integral_order, low=0.0, high=1.0)
            new[..., 0] = 1.0 - order
        if derivative_order is not None:
            new[..., 1] = checks.floats("derivative_order", derivative_order, low=0.0, high=1.0)
        self._need_shared_poles()
        steps = round(checks.number("ramp", ramp, low=0.0) / self.step)
        if steps:
            self._ramp = (self.orders, new, 0, steps)
        else:
            self._ramp = None
            self._use(new)

    def _need_shared_poles(self) -> None:
        if len(self._poles) > 1:
            raise DesignError(
                f"orders: expected a design with shared poles, got {type(self._design).__name__}"
            )

    def _climb(self) -> None:
        """Move the orders by one step of their ramp."""
        assert self._ramp is not None
        first, last, done, steps = self._ramp
        part = (done + 1) / steps
        self._use(last if part >= 1.0 else first + part * (last - first))
        self._ramp = None if part >= 1.0 else (first, last, done + 1, steps)

    def _use(self, orders: FloatArray) -> None:
        self.orders = orders
        modes = modes_of(self._design, orders, step=self.step, horizon=self._horizon)
        for name, value in modes.operator().items():
            self._ops[name] = value
        self._modes["weight"] = np.moveaxis(modes.weights, 0, -1)

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        super().retire(run)
        self.joints[run] = 0.0
        self.robots[run] = 0.0
        self._modes["x"][run] = 0.0


def _fill(robot: Any, joints: Any, controller: AdaptiveFpid, arm: Arm) -> None:
    """Write a description into the records of one run."""
    n = arm.n
    joints["scale"] = controller.scale_on(arm)
    for name in ("k0", "k1"):
        joints[name] = checks.spread(name, getattr(controller, name), n)
    guard = controller.safeguards
    bounds = np.full((2, 3, n), [[[-np.inf]], [[np.inf]]]) if guard is None else guard.bounds(n)
    rates = controller.rates(n)
    for name, rate, low, high in zip(("kp", "ki", "kd"), rates, *bounds, strict=False):
        # Projection counts from the start.
        gain = np.clip(checks.spread(name, getattr(controller, name), n), low, high)
        joints[name] = joints[f"{name}_0"] = gain
        joints[f"{name}_min"], joints[f"{name}_max"] = low, high
        joints[f"gamma_{name[1]}"] = rate
    robot["printed"], robot["moves"] = controller.regressors == "integer", controller.moves_orders
    joints["gamma_io"], joints["gamma_do"] = rates[3:]
    joints["i_order_0"], joints["d_order_0"] = controller.orders(n).T
    joints["lam"], joints["mu"] = 1.0 - joints["i_order_0"], joints["d_order_0"]
    low, high = controller.integral_order_bounds
    joints["i_order_min"], joints["i_order_max"] = 1.0 - high, 1.0 - low
    joints["d_order_min"], joints["d_order_max"] = controller.derivative_order_bounds
    joints["viscous"] = arm.viscous_friction
    if controller.bandwidth:
        robot["l1"], robot["l2"] = observer_gains(controller.bandwidth, float(robot["h"]))
    if guard is not None:
        robot["guarded"] = True
        joints["sigma"], joints["nu"] = guard.sigma, guard.e_modification
        joints["dead_zone"] = guard.dead_zone
    if controller.supervisor is not None:
        joints["bound"] = controller.supervisor.bound(n)
        for name, value in controller.supervisor.record(float(robot["h"])).items():
            robot[name] = value
