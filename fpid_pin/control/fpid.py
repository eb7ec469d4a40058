"""The adaptive fractional PID, eqs. (9) and (10), for one robot or a population in lockstep."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.control.adaptation import Adaptation, Safeguards
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import SCALES, joint_scale, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.control.supervisor import Supervision, Supervisor
from fpid_pin.descriptions import described
from fpid_pin.fractional import Bank, Design, ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

INITIALISATIONS = ("caputo", "riemann_liouville", "grunwald_letnikov")
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
        Initial gains; N m/rad, N m/(rad s^lambda), N m s^mu/rad, or those over the scale's unit.
    integral_order, derivative_order
        lambda and mu, in [0, 1].
    learning_rate
        gamma; also (3, n), a row each for Kp, Ki, Kd.
    k0, k1
        Sliding surface ``S = -(e' + k1 e + k0 int e)``, 1/s^2 and 1/s.
    supervisor
        None: no supervisory torque.
    regressors
        ``"law"``: the gradient of (10) itself; ``"integer"``: e, int e, e' as printed.
    design
        How the fractional operators are realised.
    initialisation
        What the operators take the error to have been before t = 0: ``"caputo"``,
        ``"riemann_liouville"`` or ``"grunwald_letnikov"``; see `fpid_pin.fractional.Bank`.
    scale
        s: ``"none"`` (1, as in the paper), ``"inertia"`` (M_jj at the arm's home), or (n,).
    safeguards
        Bounds and leakage for the adapted gains; None: none, as in the paper.
    name
        What tables and figures call it; made from the orders if empty.
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
    name: str = ""

    def __post_init__(self) -> None:
        lengths: dict[str, int] = {}
        for name in ("kp", "ki", "kd", "learning_rate", "k0", "k1"):
            most = 2 if name == "learning_rate" else 1
            array = checks.floats(name, getattr(self, name), low=0.0, max_ndim=most)
            object.__setattr__(self, name, array)
            if array.ndim:
                lengths[name] = array.shape[-1]
        for name in ("integral_order", "derivative_order"):
            array = checks.floats(name, getattr(self, name), low=0.0, high=1.0, max_ndim=1)
            object.__setattr__(self, name, array)
            if array.ndim:
                lengths[name] = array.shape[-1]
        rate = cast("FloatArray", self.learning_rate)
        if rate.ndim == 2 and rate.shape[0] != 3:
            raise checks.ArgumentError(
                "learning_rate", "shape (n,) or (3, n)", f"shape {rate.shape}"
            )
        if isinstance(self.scale, str):
            checks.choice("scale", self.scale, SCALES)
        else:
            scale = checks.floats("scale", self.scale, above=0.0, max_ndim=1)
            object.__setattr__(self, "scale", scale)
            if scale.ndim:
                lengths["scale"] = scale.shape[-1]
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} ({length},)" for name, length in lengths.items())
            raise checks.ArgumentError("gains and orders", "one length for all joints", listed)
        checks.choice("regressors", self.regressors, REGRESSORS)
        checks.choice("initialisation", self.initialisation, INITIALISATIONS)
        checks.instance("design", self.design, Design, "a fractional design")
        if self.supervisor is not None:
            checks.instance("supervisor", self.supervisor, Supervisor, "a Supervisor or None")
        if self.safeguards is not None:
            checks.instance("safeguards", self.safeguards, Safeguards, "Safeguards or None")

    def lockstep_key(self) -> Hashable:
        """Return design, start and readings: what one batch of runs must share."""
        options = (self.initialisation, self.regressors, self.supervisor is None)
        return (type(self), repr(self.design), *options)

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> FpidState:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return FpidState(cast("Sequence[AdaptiveFpid]", controllers), arm, step, horizon)

    def scale_on(self, arm: Arm) -> FloatArray:
        """Return s of (10) on an arm, (n,)."""
        return joint_scale(self.scale, arm)


class FpidState(State):
    """Adaptive FPIDs of all runs: error, int e, fractional bank, gains, supervisor, saturation.

    One array holds [int e, e, e'], (3, runs, n): its first two rows are the signals of which the
    bank takes the derivatives of orders 1 - lambda and mu, its last two are their rates.
    """

    def __init__(
        self, controllers: Sequence[AdaptiveFpid], arm: Arm, step: float, horizon: float
    ) -> None:
        runs, n = len(controllers), arm.n
        first = controllers[0]
        step = checks.number("step", step, above=0.0)

        def each(name: str) -> FloatArray:
            return stacked(controllers, name, arm)

        orders = np.stack([1.0 - each("integral_order"), each("derivative_order")])
        self._bank: Bank = first.design.bank(
            orders, step=step, horizon=horizon, initialisation=first.initialisation
        )
        rates = np.empty((3, runs, n))
        for run, controller in enumerate(controllers):
            rate = np.asarray(controller.learning_rate)
            if rate.ndim == 2 and rate.shape != (3, n):
                raise checks.ArgumentError("learning_rate", f"shape (3, {n})", f"{rate.shape}")
            rates[:, run] = rate if rate.ndim == 2 else checks.per_joint("learning_rate", rate, n)
        self._adaptation = Adaptation(
            np.stack([each("kp"), each("ki"), each("kd")]),
            rates,
            each("k0"),
            each("k1"),
            step=step,
            safeguards=[c.safeguards for c in controllers],
        )
        scale = np.array([c.scale_on(arm) for c in controllers])
        self._scale = None if (scale == 1.0).all() else scale
        self._supervision: Supervision | None = None
        if first.supervisor is not None:
            self._supervision = Supervision(
                [cast("Supervisor", c.supervisor) for c in controllers], arm
            )
        self._saturation = Saturation(arm.effort_limit, runs)

        shape = (runs, n)
        self._signals = np.zeros((3, *shape))
        self._int_e, self._e, self._e_dot = self._signals
        self._values, self._rates = self._signals[:2], self._signals[1:]
        self._phi = np.zeros((3, *shape))
        self._fractional = self._phi[1:]
        self._printed = first.regressors == "integer"
        self._regressors = np.zeros((3, *shape)) if self._printed else self._phi
        # int e += h (e + e_)/2 + h^2 (e'_ - e')/12 splits into a part of the new sample,
        # c e - d e', and one kept from the old, c e_ + d e'_.
        self._parts = np.zeros((2, *shape))
        self._part_weights = np.empty((2, *shape))
        self._part_weights[0], self._part_weights[1] = step / 2.0, step * step / 12.0
        self._kept = np.zeros(shape)
        self._increment = np.zeros(shape)
        self._started = False
        self._terms = np.empty((3, *shape))
        self._u = np.zeros(shape)
        self._torque = np.zeros(shape)
        self._no_u_s = np.zeros(shape)
        self._no_value = np.zeros(runs)

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """Advance by one tick: see `State.torque`."""
        # The gains move at the start of a tick, by the signals of the last one, so that after the
        # tick `signals` shows the gains that made its torque.
        adaptation = self._adaptation
        if adaptation.active:
            adaptation.advance(self._regressors, self._adaptation_hold())
        np.subtract(q_ref, q, out=self._e)
        np.subtract(v_ref, v, out=self._e_dot)

        supervision = self._supervision
        acts = supervision is not None and supervision.measure(self._e, self._e_dot)
        hold = self._saturation.winds_up(self._e)
        if acts and supervision is not None:
            acting = np.broadcast_to(supervision.acting[:, np.newaxis], self._e.shape)
            hold = acting if hold is None else hold | acting
        self._integrate(hold)
        # Only the integral's row of the bank is held: the derivative must follow the error.
        rows = None if hold is None else np.stack([hold, np.zeros_like(hold)])
        self._bank.update(self._values, self._rates, out=self._fractional, hold=rows)
        np.copyto(self._phi[0], self._e)
        if self._printed:
            self._regressors[:] = self._signals[[1, 0, 2]]
        adaptation.measure(self._signals)

        np.multiply(adaptation.gains, self._phi, out=self._terms)
        np.add.reduce(self._terms, axis=0, out=self._u)
        if self._scale is not None:
            self._u *= self._scale
        if not acts and not self._saturation.limited:
            return self._u
        np.copyto(self._torque, self._u)
        if acts and supervision is not None:
            supervision.act(q, v, a_ref, self._e, self._e_dot, self._u)
            self._torque += supervision.torque
        return self._saturation.apply(self._torque)

    def _integrate(self, hold: BoolArray | None) -> None:
        np.multiply(self._part_weights, self._signals[1:], out=self._parts)
        new, old = self._parts
        if self._started:
            np.subtract(new, old, out=self._increment)
            self._increment += self._kept
            if hold is not None:
                np.copyto(self._increment, 0.0, where=hold)
            self._int_e += self._increment
        self._started = True
        np.add(new, old, out=self._kept)

    def _adaptation_hold(self) -> BoolArray | None:
        # dK.phi has the sign of -S: that is where the adaptation pushes the torque.
        saturation = self._saturation
        hold = saturation.winds_up(-self._adaptation.surface) if saturation.active else None
        supervision = self._supervision
        if supervision is not None and supervision.any_acting:
            acting = np.broadcast_to(supervision.acting[:, np.newaxis], self._e.shape)
            hold = acting if hold is None else hold | acting
        return hold

    def signals(self) -> Mapping[str, FloatArray]:
        """Return views of kp, ki, kd, u_fpid, u_s, s, (runs, n), and lyapunov, (runs,)."""
        gains, supervision = self._adaptation.gains, self._supervision
        return {
            "kp": gains[0],
            "ki": gains[1],
            "kd": gains[2],
            "u_fpid": self._u,
            "u_s": self._no_u_s if supervision is None else supervision.torque,
            "s": self._adaptation.surface,
            "lyapunov": self._no_value if supervision is None else supervision.value,
        }

    def set_orders(
        self,
        integral_order: ArrayLike | None = None,
        derivative_order: ArrayLike | None = None,
        *,
        ramp: float = 0.0,
    ) -> None:
        """Change lambda and mu while running, (n,) or (runs, n); None leaves as it is.

        From now on (or, with a `ramp` in s, from its end) the terms are those of a law that had
        the new orders from the start. Designs whose poles depend on the order refuse.
        """
        orders = np.array(self._bank.order)
        if integral_order is not None:
            array = checks.floats("integral_order", integral_order, low=0.0, high=1.0)
            orders[0] = 1.0 - array
        if derivative_order is not None:
            orders[1] = checks.floats("derivative_order", derivative_order, low=0.0, high=1.0)
        self._bank.set_order(orders, ramp=ramp)

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        for rows in (self._signals, self._phi, self._terms):
            rows[:, run] = 0.0
        for row in (self._kept, self._u, self._torque):
            row[run] = 0.0
        self._bank.retire((slice(None), run))
        self._adaptation.retire(run)
        if self._supervision is not None:
            self._supervision.retire(run)
