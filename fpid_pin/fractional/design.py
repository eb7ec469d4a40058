"""What a fractional operator's design is: modes for any array of orders, and their recursion.

A design answers one question, `coefficients(order)`; whatever runs or judges an operator uses the
answer. All operators here approximate, for orders alpha in [0, 1] and a lower limit at t = 0, the
Caputo derivative

    D^alpha f(t) = int_0^t k(t - s) f'(s) ds,    k(t) = t^-alpha / Gamma(1 - alpha)

of a signal sampled every `step` seconds: equation (4) of the paper (with Gamma(n - alpha), n = 1).

For lags of one step and more the kernel is ``sum_i weights_i exp(-poles_i t)``; the newest step has
weights of its own (the same split is in Jiang, Zhang, Zhang and Zhang, Commun. Comput. Phys. 21,
2017, for a rate that is not known). `kernels.operator` has the modes' recursion, and runs it on the
records that `Modes.records` makes; `Modes.recursion` is the same in matrices, for whoever asks what
it does in a loop. With q = p h and theta running back from the newest sample its coefficients are

    b1, b0, b2 = h int_0^1 exp(-q theta) {1 - theta, theta, 6 theta (1 - theta)} dtheta
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError
from fpid_pin.kernels.records import MODE, OPERATOR, POLE

ComplexArray = NDArray[np.complex128]

DEFAULT_HORIZON = 3600.0
#: What the modes hold of f(0) at t = 0: nothing where the signal had always been f(0), else all.
INITIAL_MODES = {"caputo": 0.0, "riemann_liouville": 1.0, "grunwald_letnikov": 1.0}
INITIALISATIONS = tuple(INITIAL_MODES)


def integrate_step(poles: FloatArray, step: float) -> Any:
    """Return E, b1, b0, b2 of decay rates [1/s], records `POLE` of their shape, to rounding."""
    q = np.asarray(poles, dtype=np.float64) * step
    found = np.zeros(q.shape, POLE)
    found["decay"] = np.exp(-q)
    # Kummer's integral: of exp(-q x) x^(a-1) (1-x)^(b-a-1) it is B(a, b - a) 1F1(a; b; -q).
    found["b1"] = 0.5 * step * scipy.special.hyp1f1(1.0, 3.0, -q)
    found["b0"] = 0.5 * step * scipy.special.hyp1f1(2.0, 3.0, -q)
    found["b2"] = step * scipy.special.hyp1f1(2.0, 4.0, -q)
    return found


class Records(NamedTuple):
    """Records of `kernels.operator` for orders (...): ops (...), poles (rows, modes), modes."""

    ops: Any
    poles: Any
    modes: Any


class Recursion(NamedTuple):
    """One operator as a difference equation with inputs u = [f, f'].

        y_k = now u_k + before u_(k-1) + weights x_(k-1)
        x_k = decay x_(k-1) + drive_now u_k + drive_before u_(k-1)

    The mode with p = 0 is f - f(0): it is part of `before` and no state. Orders 0 and 1 have none.
    """

    now: FloatArray
    before: FloatArray
    weights: FloatArray
    decay: FloatArray
    drive_now: FloatArray
    drive_before: FloatArray

    def response(self, back: ComplexArray) -> ComplexArray:
        """Return what inputs u z^k make of y, at points 1/z = `back`, (k,): (k, inputs)."""
        delay = back[:, np.newaxis]
        modes = delay * self.weights / (1.0 - self.decay * delay)
        driven = modes @ self.drive_now + delay * (modes @ self.drive_before)
        return np.asarray(self.now + delay * self.before + driven)


@dataclass(frozen=True, eq=False)
class Modes:
    """Decaying modes that stand for the kernel, and what the newest step contributes.

        y_k = now f'_k + before f'_(k-1) + mean m_k + sum_i weights_i E_i x_i

    Attributes
    ----------
    order
        Orders alpha, any shape (...).
    step
        Sampling step h [s].
    poles
        Decay rates [1/s], (modes,) where all orders share them, else (modes, ...). The first is
        0: its mode is f - f(0) itself.
    weights
        (modes, ...) [s^-alpha].
    now, before, mean
        Newest step's weights on f'_k, f'_(k-1) and m_k, (...).
    initial_output
        Output at t = 0 for each unit of f(0) when the start is Grünwald-Letnikov's, (...).
    """

    order: FloatArray
    step: float
    poles: FloatArray
    weights: FloatArray
    now: FloatArray
    before: FloatArray
    mean: FloatArray
    initial_output: FloatArray

    @classmethod
    def of_kernel(
        cls, order: FloatArray, step: float, poles: FloatArray, weights: FloatArray
    ) -> Self:
        """Return modes whose newest step is that of the exact kernel, t^-alpha/Gamma(1 - alpha).

        ``sum_i weights_i exp(-poles_i t)`` stands for it from one step on.
        """
        h = step ** (1.0 - order)
        now = h * scipy.special.rgamma(3.0 - order)
        mean = 6.0 * (1.0 - order) * h * scipy.special.rgamma(4.0 - order)
        return cls(order, step, poles, weights, now, (1.0 - order) * now, mean, step**-order)

    @property
    def shared_poles(self) -> bool:
        """Whether all orders use the same poles, so that an order can change without a bump."""
        return self.poles.ndim == 1

    def records(self, initialisation: str = "caputo") -> Records:
        """Return new records, at t = 0, for the kernels."""
        shape = self.order.shape
        ops = np.zeros(shape, OPERATOR)
        ops["order"] = self.order
        ops["c1"], ops["c0"], ops["c2"] = self.now, self.before, self.mean
        ops["initial_mode"] = INITIAL_MODES[initialisation]
        if initialisation == "grunwald_letnikov":
            ops["initial_output"] = self.initial_output
        if not self.shared_poles:
            ops["row"] = np.arange(self.order.size).reshape(shape)
        poles = integrate_step(self.poles.reshape(len(self.poles), -1).T, self.step)
        modes = np.zeros((*shape, len(self.poles)), MODE)
        modes["weight"] = np.moveaxis(self.weights, 0, -1)
        return Records(ops, poles, modes)

    def table(self) -> FloatArray:
        """Return c1, c0, c2 and the modes' weights of each order, (3 + modes, orders)."""
        return np.vstack([self.now, self.before, self.mean, self.weights])

    def recursion(self, index: tuple[int, ...] = ()) -> Recursion:
        """Return the difference equation of one of the orders."""
        column: Any = (slice(None), *index)
        h, poles = self.step, self.poles if self.shared_poles else self.poles[column]
        order, c1, c0, c2 = (x[index] for x in (self.order, self.now, self.before, self.mean))
        decay, b1, b0, b2 = (integrate_step(poles, h)[name] for name in ("decay", "b1", "b0", "b2"))
        weights = self.weights[column] * decay
        # m = (f - f_)/h - (f' + f'_)/2, so what multiplies m is divided among the inputs.
        now = np.array([c2 / h, c1 - 0.5 * c2])
        before = np.array([weights[0] - c2 / h, c0 - 0.5 * c2])
        drive_now = np.stack([b2 / h, b1 - 0.5 * b2], axis=1)
        drive_before = np.stack([-b2 / h, b0 - 0.5 * b2], axis=1)
        kept = slice(1, None)
        if order in (0.0, 1.0):
            now, before, kept = np.array([1.0 - order, order]), np.zeros(2), slice(0)
        return Recursion(
            now, before, weights[kept], decay[kept], drive_now[kept], drive_before[kept]
        )

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the answer to exp(j omega t), once its start has died away, (k, ...).

        The exact operator's is ``(j omega)^alpha``. Frequencies are (k,) [rad/s].
        """
        # One sample later is a factor exp(j omega h); of f = exp(j omega t) the rate is j omega f.
        back = np.exp(-1j * omega * self.step)
        inputs = np.stack([np.ones_like(back), 1j * omega])
        out = np.empty((omega.size, *self.order.shape), dtype=np.complex128)
        for k in np.ndindex(self.order.shape):
            out[:, *k] = (self.recursion(k).response(back).T * inputs).sum(axis=0)
        return out

    def kernel_error(self, lag: FloatArray) -> FloatArray:
        """Return the relative error of the kernel, which answers a unit step, at lags (k,) [s].

        It stands for ``t^-alpha/Gamma(1 - alpha)``. Orders 0 and 1 are exact. Results are (k, ...).
        """
        inner, t = (self.order > 0.0) & (self.order < 1.0), lag.reshape(-1, *[1] * self.order.ndim)
        a = np.where(inner, self.order, 0.5)
        found = sum(w * np.exp(-t * p) for w, p in zip(self.weights, self.poles, strict=True))
        return np.where(inner, found * t**a * scipy.special.gamma(1.0 - a) - 1.0, 0.0)

    def noise_gains(self, horizon: float) -> FloatArray:
        """Return the output's standard deviation for white noise of standard deviation one.

        The noise is on the value [s^-alpha] or on the rate [s^(1-alpha)] alone, independent from
        sample to sample, for one horizon [s]: (2, ...).
        """
        gains = np.zeros((2, *self.order.shape))
        for k in np.ndindex(self.order.shape):
            r = self.recursion(k)
            second = r.before + r.weights @ r.drive_now
            # From then on each mode decays by exp(-p h) a sample: sum of (sum_i c_i E_i^n)^2.
            later = r.weights[:, None] * (r.decay[:, None] * r.drive_now + r.drive_before)
            poles = self.poles if self.shared_poles else self.poles[:, *k]
            p = poles[1 : 1 + r.decay.size] * self.step
            both = p[:, None] + p
            series = np.expm1(-(round(horizon / self.step) - 1) * both) / np.expm1(-both)
            tail = np.maximum((later * (series @ later)).sum(axis=0), 0.0)
            gains[:, *k] = np.sqrt(r.now**2 + second**2 + tail)
        return gains


class Design(Description, ABC):
    """How a fractional derivative is realised; a frozen description, equal where its fields are."""

    @abstractmethod
    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Any:
        """Return what an operator needs for every order in the array `order`, each in [0, 1]."""


def modes_of(design: Design, order: ArrayLike, *, step: float, horizon: float) -> Modes:
    """Return the modes of a design for orders (...); refused are those that keep the past."""
    checks.instance("design", design, Design, "a fractional design")
    found = design.coefficients(order, step=step, horizon=horizon)
    if not isinstance(found, Modes):
        name = type(design).__name__
        raise ArgumentError("design", "one with modes", f"{name}, which keeps the past")
    shape = (len(found.poles), *np.shape(order))
    if np.shape(found.weights) != shape or not np.isfinite(found.weights).all():
        got = f"shape {np.shape(found.weights)}" if np.shape(found.weights) != shape else "others"
        raise ArgumentError("design", f"finite weights of shape {shape} (modes, orders)", got)
    return found


def check_grid(step: float, horizon: float) -> tuple[float, float]:
    """Check a sampling step and a horizon [s] that must hold more than one step."""
    step = checks.number("step", step, above=0.0)
    horizon = checks.number("horizon", horizon, above=0.0)
    if not horizon > step:
        raise ArgumentError("horizon", f"more than one step ({step:g} s)", f"{horizon:g} s")
    return step, horizon


def check_order(order: ArrayLike) -> FloatArray:
    """Check orders: numbers in [0, 1], of any shape."""
    return checks.floats("order", order, low=0.0, high=1.0)
