"""What a fractional operator's design is: coefficients for any array of orders.

A design answers one question, `coefficients(order)`; a `Bank` advances the states. All operators
here approximate, for orders alpha in [0, 1] and a lower limit at t = 0, the Caputo derivative

    D^alpha f(t) = int_0^t k(t - s) f'(s) ds,    k(t) = t^-alpha / Gamma(1 - alpha)

of a signal sampled every `step` seconds: equation (4) of the paper (with Gamma(n - alpha), n = 1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError

if TYPE_CHECKING:
    from fpid_pin.fractional.bank import Bank
    from fpid_pin.fractional.report import Report

DEFAULT_HORIZON = 3600.0


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Decaying modes that stand for the kernel, and what the newest step contributes.

    For lags of one step and more the kernel is ``sum_i weights_i exp(-poles_i t)``; the newest
    step has its own three weights, on the quadratic that takes both rates and has the mean m:

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
    chord
        Newest step's weight where only f is known, on (f_k - f_(k-1))/h, (...).
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
    chord: FloatArray
    kick: FloatArray

    @property
    def shared_poles(self) -> bool:
        """Whether all orders use the same poles, so that an order can change without a bump."""
        return self.poles.ndim == 1


class Design(ABC):
    """How a fractional derivative is realised; a frozen description."""

    _kind: ClassVar[str]

    @abstractmethod
    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Any:
        """Return what a bank needs for every order in the array `order`, each in [0, 1]."""

    def bank(
        self,
        order: ArrayLike,
        *,
        step: float,
        horizon: float = DEFAULT_HORIZON,
        initialisation: str = "caputo",
        rate: str = "measured",
    ) -> Bank:
        """Start the streaming operator of this design: see `Bank`."""
        from fpid_pin.fractional.bank import Bank

        return Bank(
            self, order, step=step, horizon=horizon, initialisation=initialisation, rate=rate
        )

    def state_space(
        self,
        order: float,
        *,
        step: float,
        horizon: float = DEFAULT_HORIZON,
        sampled: bool = False,
        rate: str = "measured",
    ) -> Any:
        """Return one operator as a `scipy.signal.StateSpace`: see `interop.state_space`."""
        from fpid_pin.fractional.interop import state_space

        return state_space(self, order, step=step, horizon=horizon, sampled=sampled, rate=rate)

    def zeros_poles_gain(
        self, order: float, *, step: float, horizon: float = DEFAULT_HORIZON
    ) -> Any:
        """Return one continuous operator as a `scipy.signal.ZerosPolesGain`."""
        from fpid_pin.fractional.interop import zeros_poles_gain

        return zeros_poles_gain(self, order, step=step, horizon=horizon)

    @classmethod
    def _bank_class(cls) -> type[Bank]:
        from fpid_pin.fractional.bank import Bank

        return Bank

    def report(self, order: ArrayLike, *, step: float, horizon: float = DEFAULT_HORIZON) -> Report:
        """Measure the design's errors in frequency and time: see `Report`."""
        from fpid_pin.fractional.report import report

        return report(self, order, step=step, horizon=horizon)


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
