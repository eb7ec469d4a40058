"""The adaptive fractional PID: eqs. (9), (10), (22) and (30)-(32)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import Check, FloatArray, Number, OneOf, PerJoint
from fpid_pin.control.law import INITIALISATIONS, Controller, Derivative, Integral, Operator
from fpid_pin.descriptions import Description, described
from fpid_pin.fractional import Design, ExponentialSum
from fpid_pin.kernels.functions import clip, winds_up


def rows_on(name: str, value: ArrayLike, rows: int, n: int) -> FloatArray:
    """Return numbers that a description has checked, a scalar, (n,) or (rows, n), as (rows, n)."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and array.shape not in ((n,), (rows, n)):
        raise checks.ArgumentError(name, f"shape ({n},) or ({rows}, {n})", f"shape {array.shape}")
    return np.broadcast_to(array, (rows, n))


def check_bounds(name: str, value: Any) -> tuple[float, ...]:
    """Check the least and the largest order."""
    bounds = checks.floats(name, value, low=0.0, high=1.0, max_ndim=1)
    if bounds.shape != (2,) or bounds[0] > bounds[1]:
        raise checks.ArgumentError(name, "a lower and an upper bound", bounds.tolist())
    return tuple(bounds.tolist())


@described("safeguards")
@dataclass(frozen=True, eq=False)
class Safeguards(Description):
    """Ways of keeping adapted gains bounded; none is on in the paper's experiment.

    The gradient law alone drifts: under a constant load ``Ki' = gamma k0 (int e)^2 >= 0``, so
    gains grow slowly for ever, and with noise faster.

    Parameters
    ----------
    minimum, maximum
        Projection: bounds of Kp, Ki, Kd, which limit the initial gains too; scalars, (n,) or
        (3, n).
    sigma
        Leakage towards the initial gains [1/s]: ``K' = ... - sigma (K - K(0))``
        (Ioannou and Kokotovic 1984).
    e_modification
        Leakage in proportion to the surface: ``K' = ... - gamma nu |S| (K - K(0))``
        (Narendra and Annaswamy 1987).
    dead_zone
        No adaptation while ``|S|`` is below it; beyond, only the excess counts.
    """

    _path = "safeguards"

    minimum: Annotated[ArrayLike, PerJoint(rows=3)] = 0.0
    maximum: Annotated[ArrayLike, PerJoint(low=0.0, finite=False, rows=3)] = np.inf
    sigma: Annotated[float, Number("1/s", low=0.0)] = 0.0
    e_modification: Annotated[float, Number(low=0.0)] = 0.0
    dead_zone: Annotated[float, Number(low=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        low = np.asarray(self.minimum)
        if np.any(low > np.asarray(self.maximum)):
            raise checks.ArgumentError(
                "safeguards.minimum", "at most safeguards.maximum", f"{low.max():g}"
            )

    @staticmethod
    def bounds_of(guard: "Safeguards | None", n: int) -> tuple[FloatArray, FloatArray]:
        """Return the least and the largest Kp, Ki, Kd of an arm with n joints, (3, n) each."""
        if guard is None:
            return np.full((3, n), -np.inf), np.full((3, n), np.inf)
        low = rows_on("safeguards.minimum", guard.minimum, 3, n)
        return low, rows_on("safeguards.maximum", guard.maximum, 3, n)


@described("adaptive_fpid")
@dataclass(frozen=True, eq=False)
class AdaptiveFpid(Controller):
    """Adaptive fractional PID, eqs. (9) and (10), with an optional supervisor.

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
    derivative_on
        ``"error"``: D^mu e, as in (10); ``"measurement"``: -D^mu q in its place, for references
        that jump. Where q_d jumps by d and q'_d stays, D^mu e jumps by
        6 d h^-mu/(Gamma(1 - mu) (2 - mu) (3 - mu)), and with it the torque; D^mu q has no such
        kick, but tracks a moving reference less closely (Åström and Hägglund, *Advanced PID
        Control*, 2006, section 3.3, on the integer PID). Not with ``"grunwald_letnikov"``, whose
        start would kick by the pose itself.
    regressors
        ``"law"``: the gradient of (10) itself; ``"integer"``: e, int e, e' as printed.
    design
        How the fractional operators are realised; a design with modes.
    initialisation
        The error before t = 0: ``"caputo"``, always e(0), or ``"grunwald_letnikov"``, 0; see
        `fpid_pin.fractional.Bank`.
    safeguards
        Bounds and leakage for the adapted gains; None: none, as in the paper.
    order_learning_rate
        gamma_o of the orders; 0: fixed orders. Scalar, (n,), or (2, n), a row each for lambda and
        mu: ``lambda' = -gamma_o S s Ki dI^lambda e/dlambda`` and likewise mu, the gradient that
        moves the gains, its last factor one sample old. Needs a design with shared
        poles. Safeguards' dead zone and leakage apply to orders, too.
        `fpid_pin.control.adapt_orders` gives rates and bounds to start with.
    integral_order_bounds, derivative_order_bounds
        Bounds of adapting orders, in [0, 1]; they limit the initial orders too. If mu falls to 0,
        its term is Caputo's limit e - e(0).
    scale, feedforward, observer, supervisor, name
        See `Controller`.
    """

    kp: Annotated[ArrayLike, PerJoint("N m/rad", low=0.0)]
    ki: Annotated[ArrayLike, PerJoint("N m/(rad s^lambda)", low=0.0)]
    kd: Annotated[ArrayLike, PerJoint("N m s^mu/rad", low=0.0)]
    integral_order: Annotated[ArrayLike, PerJoint(low=0.0, high=1.0)] = 1.0
    derivative_order: Annotated[ArrayLike, PerJoint(low=0.0, high=1.0)] = 1.0
    learning_rate: Annotated[ArrayLike, PerJoint(low=0.0, rows=3)] = 25.0
    k0: Annotated[ArrayLike, PerJoint("1/s^2", low=0.0)] = 1.0
    k1: Annotated[ArrayLike, PerJoint("1/s", low=0.0)] = 2.0
    derivative_on: Annotated[str, OneOf("error", "measurement")] = "error"
    regressors: Annotated[str, OneOf("law", "integer")] = "law"
    design: Design = field(default_factory=lambda: ExponentialSum(modes=24))
    initialisation: Annotated[str, OneOf(*INITIALISATIONS)] = "caputo"
    safeguards: Safeguards | None = None
    order_learning_rate: Annotated[ArrayLike, PerJoint(low=0.0, rows=2)] = 0.0
    integral_order_bounds: Annotated[Sequence[float], Check(check_bounds)] = (0.02, 1.0)
    derivative_order_bounds: Annotated[Sequence[float], Check(check_bounds)] = (0.3, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.on_measurement and self.initialisation != "caputo":
            raise checks.ArgumentError(
                "initialisation", "caputo with derivative_on = measurement", self.initialisation
            )

    # ------------------------------------------------------------------------ the law

    @staticmethod
    def surface(c: Any) -> None:
        """Write the sliding surface S = q' - q_r, (22).

        Its q_r is the integral of (21), q'_d + k1 e + k0 int e.
        """
        c.s = -(c.e_dot + c.k1 * c.e + c.k0 * c.int_e)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return u_FPID over the scale, (10)."""
        return c.kp * c.e + c.ki * c.i_e + c.kd * (c.d_sign * c.d_e)

    @property
    def adapt(self) -> Any:
        """The function that moves the gains, and the orders where they adapt."""
        return adapt_gains_and_orders if self.moves_orders else adapt_gains

    # ---------------------------------------------------------------- what the engine asks

    @property
    def operators(self) -> Mapping[str, Operator]:
        """I^lambda e and D^mu e of (10), or D^mu q."""
        moves, of = self.moves_orders, "q" if self.on_measurement else "e"
        return {
            "i_e": Integral("integral_order", adapts=moves),
            "d_e": Derivative("derivative_order", of=of, adapts=moves),
        }

    @property
    def shown(self) -> Mapping[str, str]:
        """What a run has of the law: gains, u_FPID, u_s, S and V; orders that adapt."""
        names = ("kp", "ki", "kd", "u_s", "s", "lyapunov")
        shown = {name: name for name in names} | {"u_fpid": "u_law"}
        if self.feedforward or self.observer:
            shown["u_model"] = "u_model"
        if self.moves_orders:
            shown |= {name: name for name in ("integral_order", "derivative_order")}
        return shown

    def numbers(self, arm: Arm, step: float, horizon: float) -> Mapping[str, ArrayLike]:
        """Return gains, rates, bounds and orders on an arm, by name: see `Controller.numbers`."""
        n, guard = arm.n, self.safeguards
        rates, (low, high) = self.rates(n), Safeguards.bounds_of(guard, n)
        found: dict[str, ArrayLike] = {name: getattr(self, name) for name in ("k0", "k1")}
        for k, name in enumerate(("kp", "ki", "kd")):
            # Projection counts from the start.
            gain = np.clip(checks.per_joint(name, getattr(self, name), n), low[k], high[k])
            found |= {name: gain, f"{name}_0": gain, f"gamma_{name[1]}": rates[k]}
            found |= {f"{name}_min": low[k], f"{name}_max": high[k]}
        found["as_printed"] = float(self.regressors == "integer")
        found["d_sign"] = -1.0 if self.on_measurement else 1.0
        for name in ("sigma", "e_modification", "dead_zone"):
            found[name] = 0.0 if guard is None else getattr(guard, name)
        orders = self.orders(n)
        for k, name in enumerate(("integral_order", "derivative_order")):
            found[name] = orders[k]
            if self.moves_orders:
                low, high = self.order_bounds(n)[:, k]
                found |= {f"{name}_0": orders[k], f"{name}_rate": rates[3 + k]}
                found |= {f"{name}_min": low, f"{name}_max": high}
        return found

    # ----------------------------------------------------------------- the description

    @property
    def on_measurement(self) -> bool:
        """Whether the derivative is the measured angle's, not the error's."""
        return self.derivative_on == "measurement"

    @property
    def moves_orders(self) -> bool:
        """Whether orders adapt."""
        return bool(np.any(self.order_learning_rate))

    def rates(self, n: int) -> FloatArray:
        """Return gamma of Kp, Ki, Kd, lambda and mu on an arm with n joints, (5, n)."""
        rows = {"learning_rate": 3, "order_learning_rate": 2}
        return np.concatenate([rows_on(k, getattr(self, k), count, n) for k, count in rows.items()])

    def order_bounds(self, n: int) -> FloatArray:
        """Return the least and the largest lambda and mu, (bound, 2, n).

        Orders whose rate is 0 are bounded by [0, 1] alone.
        """
        bounds = np.array([self.integral_order_bounds, self.derivative_order_bounds]).T
        moves = self.rates(n)[3:] > 0.0
        return np.where(moves, bounds[:, :, np.newaxis], np.array([0.0, 1.0])[:, None, None])

    def orders(self, n: int) -> FloatArray:
        """Return lambda and mu, (2, n); projection of those that adapt counts from the start."""
        lam = checks.per_joint("integral_order", self.integral_order, n)
        mu = checks.per_joint("derivative_order", self.derivative_order, n)
        if not self.moves_orders:
            return np.stack([lam, mu])
        # D^0 e is e, but the limit for mu that falls to 0 is e - e(0): the one to start from.
        mu = np.maximum(mu, np.finfo(float).tiny)
        return np.asarray(np.clip(np.stack([lam, mu]), *self.order_bounds(n)))


def leakage(c: Any, value: float, initial: float, gamma: float, s: float) -> Any:
    """Return the rate at which safeguards pull a gain, or an order, back to where it began."""
    return (c.sigma + c.e_modification * gamma * abs(s)) * (value - initial)


def bounded(x: float, low: float, high: float) -> float:
    """Return x within [low, high]."""
    return min(max(x, low), high)


def adapt_gains(c: Any) -> None:
    """Move the gains by one step along the gradient of S^2/2, (30)-(32).

    dK phi has the sign of -S: that is where adaptation pushes the torque.
    """
    if not winds_up(c.cut, -c.s):
        s = c.s - clip(c.s, c.dead_zone)
        i_e = c.int_e if c.as_printed > 0.0 else c.i_e
        d_e = c.e_dot if c.as_printed > 0.0 else c.d_sign * c.d_e
        p_leak = leakage(c, c.kp, c.kp_0, c.gamma_p, s)
        i_leak = leakage(c, c.ki, c.ki_0, c.gamma_i, s)
        d_leak = leakage(c, c.kd, c.kd_0, c.gamma_d, s)
        c.kp = bounded(c.kp - c.h * (c.gamma_p * s * c.e + p_leak), c.kp_min, c.kp_max)  # (30)
        c.ki = bounded(c.ki - c.h * (c.gamma_i * s * i_e + i_leak), c.ki_min, c.ki_max)  # (31)
        c.kd = bounded(c.kd - c.h * (c.gamma_d * s * d_e + d_leak), c.kd_min, c.kd_max)  # (32)


def adapt_gains_and_orders(c: Any) -> None:
    """Move orders and gains along the same gradient: theta' = -gamma S s K d(term)/dtheta."""
    if not winds_up(c.cut, -c.s):
        s = c.s - clip(c.s, c.dead_zone)
        rate, order = c.integral_order_rate, c.integral_order
        leak = leakage(c, order, c.integral_order_0, rate, s)
        order -= c.h * (rate * s * c.scale * c.ki * c.i_e_by_order + leak)
        c.integral_order = bounded(order, c.integral_order_min, c.integral_order_max)
        rate, order = c.derivative_order_rate, c.derivative_order
        leak = leakage(c, order, c.derivative_order_0, rate, s)
        order -= c.h * (rate * s * c.scale * c.kd * (c.d_sign * c.d_e_by_order) + leak)
        c.derivative_order = bounded(order, c.derivative_order_min, c.derivative_order_max)
    adapt_gains(c)
