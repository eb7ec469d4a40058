"""What an adaptive FPID is while it runs: the records of `kernels.law`, for all runs."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.disturbance import observer_gains
from fpid_pin.control.model_terms import ModelTerms
from fpid_pin.control.state import State
from fpid_pin.exceptions import DesignError, FpidWarning
from fpid_pin.fractional.design import modes_of

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.fpid import AdaptiveFpid

#: Orders at which the table is laid out that orders which move are interpolated in: a cubic on
#: this grid is within 1e-7 of the operator, as the operator of 24 modes is of the exact one.
NODES = 201


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
        # One controller on many plants is written once.
        places = {id(c): run for run, c in reversed(list(enumerate(controllers)))}
        like = [places[id(c)] for c in controllers]
        for run in places.values():
            _fill(self.robots[run], self.joints[run], controllers[run], arm)
        self.robots, self.joints = self.robots[like], self.joints[like]
        self._design, self._horizon = controllers[0].design, horizon
        orders = {run: controllers[run].orders(self.n) for run in places.values()}
        self.orders = np.array([orders[run] for run in like])
        modes = modes_of(self._design, self.orders, step=self.step, horizon=horizon)
        self._ops, self._poles, self._modes = modes.records(controllers[0].initialisation)
        self._left = round(horizon / self.step) + 2
        self._ramp: tuple[FloatArray, FloatArray, int, int] | None = None
        first = controllers[0]
        self._moves = first.moves_orders
        table = np.zeros((3 + self._modes.shape[-1], 4))
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
        self._left -= 1
        if self._left == 0:
            warnings.warn(
                f"the law runs past its horizon of {self._horizon:g} s, for which its fractional "
                "memories are fitted: give start() the time that it will run",
                FpidWarning,
                stacklevel=3,
            )
        if self._ramp is not None:
            self._climb()
        acts = self._fpids(self.alive, *self._records, inputs, self.torque)
        if self._model is not None:
            self._model.add(self.alive, inputs, acts, self.torque)

    @property
    def flight(self) -> tuple[Any, ...] | None:
        """The records that a tick runs on, or None where the model adds to them."""
        return self._records if self._model is None else None

    @property
    def records(self) -> tuple[Any, ...]:
        """The records that a tick of the law runs on: robots, joints, ops, poles, modes, table."""
        return self._records

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
        new orders from the start. Orders that adapt go on from there.

        Raises
        ------
        DesignError
            A design whose poles depend on the order: its modes mean nothing to another one.
        """
        if self._moves:
            self.orders = self._ops["order"].copy()
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
        self.joints["lam"], self.joints["mu"] = 1.0 - orders[..., 0], orders[..., 1]

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
    for name, bound in zip(("min", "max"), controller.order_bounds(n), strict=True):
        joints[f"i_order_{name}"], joints[f"d_order_{name}"] = bound.T
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
