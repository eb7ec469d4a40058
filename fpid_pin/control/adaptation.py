"""The adaptive gains: sliding surface and gradient law, eqs. (21)-(32)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.descriptions import described


@described("safeguards")
@dataclass(frozen=True, eq=False)
class Safeguards:
    """Ways of keeping adapted gains bounded; none is on in the paper's experiment.

    The gradient law alone drifts: under a constant load ``Ki' = gamma k0 (int e)^2 >= 0``, so
    gains grow slowly for ever, and with noise faster.

    Parameters
    ----------
    minimum, maximum
        Projection: each of Kp, Ki, Kd stays within, initial ones included; scalars, (n,) or
        (3, n).
    sigma
        Leakage towards the initial gains, 1/s: ``K' = ... - sigma (K - K(0))``
        (Ioannou and Kokotovic 1984).
    e_modification
        Leakage in proportion to the surface: ``K' = ... - gamma nu |S| (K - K(0))``
        (Narendra and Annaswamy 1987).
    dead_zone
        No adaptation while ``|S|`` is below it; beyond, only the excess counts.
    """

    minimum: ArrayLike = 0.0
    maximum: ArrayLike = np.inf
    sigma: float = 0.0
    e_modification: float = 0.0
    dead_zone: float = 0.0

    def __post_init__(self) -> None:
        low = checks.floats("safeguards.minimum", self.minimum, max_ndim=2)
        high = checks.floats("safeguards.maximum", self.maximum, low=0, finite=False, max_ndim=2)
        if np.any(low > high):
            raise checks.ArgumentError(
                "safeguards.minimum", "at most safeguards.maximum", f"{low.max():g}"
            )
        object.__setattr__(self, "minimum", low)
        object.__setattr__(self, "maximum", high)
        for name in ("sigma", "e_modification", "dead_zone"):
            value = checks.number(f"safeguards.{name}", getattr(self, name), low=0)
            object.__setattr__(self, name, value)


class Adaptation:
    """Gains K = [Kp, Ki, Kd], (3, runs, n), and the surface S, (runs, n), that drives them.

    Per joint, with q_r the velocity reference of (21)-(22),

        S = q' - q_r = -(e' + k1 e + k0 int e)
        K' = -gamma S phi                                               (30)-(32)

    phi being the regressors: e, I^lambda e, D^mu e (the gradient of the law in use) or, as
    printed, e, int e, e'. Over a step the law is a forward Euler step of length h.

    Parameters
    ----------
    gains
        Initial gains, (3, runs, n).
    rate
        gamma, (3, runs, n).
    k0, k1
        Sliding surface, (runs, n).
    step
        Sampling period, s.
    safeguards
        One a run, or None where there are none.
    """

    def __init__(
        self,
        gains: FloatArray,
        rate: FloatArray,
        k0: FloatArray,
        k1: FloatArray,
        *,
        step: float,
        safeguards: Sequence[Safeguards | None],
    ) -> None:
        self.gains = gains.copy()
        self.surface = np.zeros(gains.shape[1:])
        self._step_rate = -step * rate
        # Where every term of a joint has the same rate (the usual case), S gamma h is (runs, n).
        if (self._step_rate == self._step_rate[:1]).all():
            self._step_rate = self._step_rate[0].copy()
        self.active = bool(rate.any())
        self._weights = -np.stack([k0, k1, np.ones_like(k0)])
        self._work = np.empty_like(gains)
        self._drive = np.empty_like(self._step_rate)
        self._guard = None
        if any(guard is not None for guard in safeguards):
            self._guard = _Guard(safeguards, self.gains, step, rate)

    def measure(self, signals: FloatArray) -> None:
        """Evaluate S from [int e, e, e'], (3, runs, n)."""
        np.multiply(self._weights, signals, out=self._work)
        np.add.reduce(self._work, axis=0, out=self.surface)

    def advance(self, regressors: FloatArray, hold: BoolArray | None) -> None:
        """Move the gains by a step along -gamma S phi, except where `hold`, (runs, n), says so."""
        guard = self._guard
        surface = self.surface if guard is None else guard.dead_zone(self.surface)
        np.multiply(self._step_rate, surface, out=self._drive)
        np.multiply(self._drive, regressors, out=self._work)
        if guard is not None:
            guard.leak(self.gains, surface, self._work)
        if hold is not None:
            np.copyto(self._work, 0.0, where=hold)
        np.add(self.gains, self._work, out=self.gains)
        if guard is not None:
            guard.project(self.gains)

    def retire(self, run: int) -> None:
        """Zero a run's gains, rates and surface for good."""
        self.gains[:, run] = 0.0
        self._step_rate[..., run, :] = 0.0
        self._weights[:, run] = 0.0
        self.surface[run] = 0.0
        if self._guard is not None:
            self._guard.retire(run)


class _Guard:
    """The arrays of `Safeguards` for all runs; runs without any have neutral values."""

    def __init__(
        self,
        safeguards: Sequence[Safeguards | None],
        gains: FloatArray,
        step: float,
        rate: FloatArray,
    ) -> None:
        runs, n = gains.shape[1:]
        self._low = np.full_like(gains, -np.inf)
        self._high = np.full_like(gains, np.inf)
        sigma = np.zeros((runs, 1))
        nu = np.zeros((runs, 1))
        dead = np.zeros((runs, 1))
        for run, guard in enumerate(safeguards):
            if guard is not None:
                self._low[:, run] = _bound("safeguards.minimum", guard.minimum, n)
                self._high[:, run] = _bound("safeguards.maximum", guard.maximum, n)
                sigma[run], nu[run] = guard.sigma, guard.e_modification
                dead[run] = guard.dead_zone
        self._sigma = step * sigma
        self._nu = step * rate * nu
        self._dead = np.ascontiguousarray(np.broadcast_to(dead, (runs, n)))
        # What no run asks for costs nothing; for a run that did not ask, the arithmetic of those
        # that did adds exact zeros.
        self._leaks = bool(sigma.any() or nu.any())
        self._has_dead_zone = bool(dead.any())
        self._excess = np.zeros((runs, n))
        self.project(gains)
        self._initial = gains.copy()

    def dead_zone(self, surface: FloatArray) -> FloatArray:
        if not self._has_dead_zone:
            return surface
        excess = self._excess
        np.minimum(surface, self._dead, out=excess)
        np.maximum(excess, -self._dead, out=excess)
        np.subtract(surface, excess, out=excess)
        return excess

    def leak(self, gains: FloatArray, surface: FloatArray, increment: FloatArray) -> None:
        if self._leaks:
            increment -= (self._sigma + self._nu * np.abs(surface)) * (gains - self._initial)

    def project(self, gains: FloatArray) -> None:
        np.maximum(gains, self._low, out=gains)
        np.minimum(gains, self._high, out=gains)

    def retire(self, run: int) -> None:
        self._initial[:, run] = 0.0
        self._low[:, run] = self._high[:, run] = 0.0


def _bound(name: str, value: ArrayLike, n: int) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and array.shape not in ((n,), (3, n)):
        raise checks.ArgumentError(name, f"shape ({n},) or (3, {n})", f"shape {array.shape}")
    return array
