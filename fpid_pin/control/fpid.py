"""The adaptive fractional PID, eqs. (9) and (10), for one robot or a population in lockstep."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.fpid_state import FpidState
from fpid_pin.control.parameters import check_gains, check_scale, joint_scale
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.descriptions import described
from fpid_pin.fractional import Design, ExponentialSum
from fpid_pin.fractional.modes import INITIALISATIONS

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

REGRESSORS = ("law", "integer")


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
        moves the gains, its last factor one sample old. Wants a design with shared poles.
        Safeguards' dead zone and leakage count for orders, too. `fpid_pin.control.adapt_orders`
        has rates and bounds to begin with.
    integral_order_bounds, derivative_order_bounds
        What orders that move stay within, in [0, 1], from their start. Should mu fall to 0, its
        term is Caputo's limit e - e(0).
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

    def order_bounds(self, n: int) -> FloatArray:
        """Return the least and the largest orders of D^(1 - lambda), D^mu: (bound, n, 2).

        Orders whose rate is 0 are bounded by [0, 1] alone.
        """
        low, high = self.integral_order_bounds
        bounds = np.array([[1.0 - high, self.derivative_order_bounds[0]],
                           [1.0 - low, self.derivative_order_bounds[1]]])  # fmt: skip
        moves = self.rates(n)[3:].T > 0.0
        return np.where(moves, bounds[:, np.newaxis], np.array([0.0, 1.0])[:, None, None])

    def orders(self, n: int) -> FloatArray:
        """Return the orders of the derivatives that are taken, of int e and of e, (n, 2).

        Projection of those that move counts from the start.
        """
        lam = checks.spread("integral_order", self.integral_order, n)
        mu = checks.spread("derivative_order", self.derivative_order, n)
        if self.moves_orders:
            # D^0 e is e, but the limit for mu that falls to 0 is e - e(0): the one to start from.
            mu = np.maximum(mu, np.finfo(float).tiny)
        return np.clip(np.stack([1.0 - lam, mu], axis=1), *self.order_bounds(n))
