"""Joint rates of a robot that measures angles only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray


@dataclass(frozen=True)
class EncoderRate:
    """The difference of two angles over the time between them, smoothed by a first-order low pass.

        v_k = v_(k-1) + h/(tau + h) ((q_k - q_(k-1))/h - v_(k-1))

    Parameters
    ----------
    tau
        Time constant [s]; 0 is the difference alone.
    turn
        What an encoder that begins again counts for one turn [rad], 2 pi say; None: it does not.

    Raises
    ------
    ArgumentError
        A `tau` below 0, or a `turn` that is not above 0.
    """

    tau: float = 0.005
    turn: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "tau", checks.number("tau", self.tau, low=0.0))
        if self.turn is not None:
            object.__setattr__(self, "turn", checks.number("turn", self.turn, above=0.0))

    def delay(self, step: float) -> float:
        """Return by how much slow motions are late, ``tau + h/2`` [s]; compare delay_margin.

        Half a step is the difference's own: it is the rate in the middle of the step.
        """
        return self.tau + 0.5 * step

    def noise(self, resolution: float, step: float) -> float:
        """Return the rate's standard deviation [rad/s] for angles in steps of `resolution` [rad].

        Rounding counts as white noise of ``resolution/sqrt(12)``, as it is while the joint moves by
        more than a step of it a tick.
        """
        share = step / (self.tau + step)
        return float(resolution / np.sqrt(12.0) * share / step * np.sqrt(2.0 / (2.0 - share)))

    def start(self, step: float) -> EncoderRateState:
        """Start it at a sampling period `step` [s]."""
        return EncoderRateState(self, checks.number("step", step, above=0.0))


class EncoderRateState:
    """What an `EncoderRate` remembers of any number of joints."""

    def __init__(self, filter_: EncoderRate, step: float) -> None:
        self._turn, self._step = filter_.turn, step
        self._kept = filter_.tau / (filter_.tau + step)
        self._q: FloatArray | None = None
        self._v: FloatArray = np.zeros(())

    def rate(self, q: FloatArray, ticks: int = 1) -> FloatArray:
        """Return the rates [rad/s] for angles `q` [rad], `ticks` after the last; 0 at the first."""
        if self._q is None:
            self._q, self._v = q.copy(), np.zeros_like(q)
            return self._v.copy()
        moved = q - self._q
        if self._turn is not None:
            moved -= self._turn * np.round(moved / self._turn)
        # As if the joint had moved evenly through the ticks that were missed.
        kept = self._kept**ticks
        self._v = kept * self._v + (1.0 - kept) * moved / (ticks * self._step)
        self._q = q.copy()
        return self._v.copy()

    def reset(self) -> None:
        """Forget all angles."""
        self._q = None
