"""What a fractional operator's design is: modes for any array of orders.

A design answers one question, `coefficients(order)`; whatever runs or judges an operator consumes
the answer. All operators here approximate, for orders alpha in [0, 1] and a lower limit at t = 0,
the Caputo derivative

    D^alpha f(t) = int_0^t k(t - s) f'(s) ds,    k(t) = t^-alpha / Gamma(1 - alpha)

of a signal sampled every `step` seconds: equation (4) of the paper (with Gamma(n - alpha), n = 1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.modes import Modes

DEFAULT_HORIZON = 3600.0


class Design(ABC):
    """How a fractional derivative is realised; a frozen description, equal where its fields are."""

    @abstractmethod
    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Any:
        """Return what an operator needs for every order in the array `order`, each in [0, 1]."""


def modes_of(design: Design, order: ArrayLike, *, step: float, horizon: float) -> Modes:
    """Return the modes of a design for orders (...).

    Raises
    ------
    ArgumentError
        Not a design, or one that keeps the signal's past instead of modes.
    """
    checks.instance("design", design, Design, "a fractional design")
    found = design.coefficients(order, step=step, horizon=horizon)
    if not isinstance(found, Modes):
        name = type(design).__name__
        raise ArgumentError("design", "one with modes", f"{name}, which keeps the past")
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
