"""The modes of a design: what every consumer of one is made of.

For lags of one step and more the kernel is ``sum_i weights_i exp(-poles_i t)``; the newest step has
weights of its own. `kernels.operator` has the recursion, one signal at a time; `Modes.records` are
the records that it runs on, and `Modes.recursion` is the same in matrices, for whoever asks what it
does to a sinusoid, to noise, or in a loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fpid_pin.checks import FloatArray
from fpid_pin.fractional.special import rgamma
from fpid_pin.fractional.step_integrals import integrate_step

ComplexArray = NDArray[np.complex128]

#: What the modes hold of f(0) at t = 0: nothing where the signal had always been f(0), else all.
FROM_REST = {"caputo": 0.0, "riemann_liouville": 1.0, "grunwald_letnikov": 1.0}
INITIALISATIONS = tuple(FROM_REST)


class Records(NamedTuple):
    """Records of `kernels.operator` for orders (...): ops (...), poles (rows, modes), modes."""

    ops: Any
    poles: Any
    modes: Any


class Recursion(NamedTuple):
    """One operator as a difference equation with inputs u = [f, f'] (or [f], rate differenced).

        y_k = now u_k + before u_(k-1) + weights x_(k-1)
        x_k = decay x_(k-1) + drive_now u_k + drive_before u_(k-1)

    The mode with p = 0 is f - f(0): it is part of `before` and no state. Orders 0 and 1 have none.

    Attributes
    ----------
    now, before
        (inputs,).
    weights, decay
        (modes,).
    drive_now, drive_before
        (modes, inputs).
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

        y_k = now f'_k + before f'_(k-1) + mean m_k + sum_i weights_i E_i x_i,   E_i = exp(-p_i h)
        m_k = (f_k - f_(k-1))/h - (f'_k + f'_(k-1))/2

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
    kick
        Output at t = 0 for each unit of f(0) when the start is Grünwald-Letnikov's, (...).
    """

    order: FloatArray
    step: float
    poles: FloatArray
    weights: FloatArray
    now: FloatArray
    before: FloatArray
    mean: FloatArray
    kick: FloatArray

    @classmethod
    def of_kernel(
        cls, order: FloatArray, step: float, poles: FloatArray, weights: FloatArray
    ) -> Modes:
        """Return modes whose newest step is that of the exact kernel, t^-alpha/Gamma(1 - alpha).

        Parameters
        ----------
        order, step, poles, weights
            See the class; ``sum_i weights_i exp(-poles_i t)`` stands for the kernel from one step
            on.
        """
        h = step ** (1.0 - order)
        now = h * rgamma(3.0 - order)
        mean = 6.0 * (1.0 - order) * h * rgamma(4.0 - order)
        return cls(order, step, poles, weights, now, (1.0 - order) * now, mean, step**-order)

    @property
    def shared_poles(self) -> bool:
        """Whether all orders use the same poles, so that an order can change without a bump."""
        return self.poles.ndim == 1

    def operator(self) -> dict[str, FloatArray]:
        """Return what depends on the order in a record of `kernels.operator`, by name."""
        return {"order": self.order, "c1": self.now, "c0": self.before, "c2": self.mean}

    def records(self, initialisation: str = "caputo") -> Records:
        """Return new records, at t = 0, for the kernels."""
        # Imported late: it loads numba.
        from fpid_pin.kernels.records import MODE, OPERATOR, POLE

        shape = self.order.shape
        ops = np.zeros(shape, OPERATOR)
        for name, value in self.operator().items():
            ops[name] = value
        ops["initial_mode"] = FROM_REST[initialisation]
        if initialisation == "grunwald_letnikov":
            ops["initial_output"] = self.kick
        if not self.shared_poles:
            ops["row"] = np.arange(self.order.size).reshape(shape)
        one = integrate_step(self.poles.reshape(len(self.poles), -1).T, self.step)
        poles = np.zeros(one.decay.shape, POLE)
        for name, value in zip(("decay", "b1", "b0", "b2"), one, strict=True):
            poles[name] = value
        modes = np.zeros((*shape, len(self.poles)), MODE)
        modes["weight"] = np.moveaxis(self.weights, 0, -1)
        return Records(ops, poles, modes)

    def table(self) -> FloatArray:
        """Return c1, c0, c2 and the modes' weights of each order, (3 + modes, orders)."""
        return np.vstack([self.now, self.before, self.mean, self.weights])

    def recursion(self, index: int = 0, *, measured: bool = True) -> Recursion:
        """Return the difference equation of one order.

        Parameters
        ----------
        index
            Of the order, counted through an array of them.
        measured
            Whether the rate is an input; else it is taken constant between samples.
        """
        h, modes = self.step, len(self.poles)
        poles = self.poles if self.shared_poles else self.poles.reshape(modes, -1)[:, index]
        one = integrate_step(poles, h)
        weights = self.weights.reshape(modes, -1)[:, index] * one.decay
        own = (self.order, self.now, self.before, self.mean)
        order, c1, c0, c2 = (float(a.reshape(-1)[index]) for a in own)
        # m = (f - f_)/h - (f' + f'_)/2, so what multiplies m is spread over the inputs.
        now = np.array([c2 / h, c1 - 0.5 * c2])
        before = np.array([weights[0] - c2 / h, c0 - 0.5 * c2])
        drive_now = np.stack([one.mean / h, one.now - 0.5 * one.mean], axis=1)
        drive_before = np.stack([-one.mean / h, one.before - 0.5 * one.mean], axis=1)
        kept = slice(1, None)
        if order in (0.0, 1.0):
            now, before, kept = np.array([1.0 - order, order]), np.zeros(2), slice(0)
        if not measured:
            # f' = f'_ = (f - f_)/h.
            now, before = _differenced(now, before, h)
            drive_now, drive_before = _differenced(drive_now, drive_before, h)
        return Recursion(
            now, before, weights[kept], one.decay[kept], drive_now[kept], drive_before[kept]
        )


def _differenced(now: FloatArray, before: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
    """Turn weights on [f, f'], now and before, into those on [f] alone."""
    slope = (now[..., 1:] + before[..., 1:]) / h
    return now[..., :1] + slope, before[..., :1] - slope
