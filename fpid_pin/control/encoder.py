"""Joint rates of a robot that measures angles only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, Number, PerJoint
from fpid_pin.descriptions import Description


@dataclass(frozen=True)
class EncoderRate(Description):
    """The difference of two angles over the time between them, smoothed by a first-order low pass.

        v_k = v_(k-1) + h/(tau + h) ((q_k - q_(k-1))/h - v_(k-1))

    Parameters
    ----------
    tau
        Time constant [s]; 0 is the difference alone.
    turn
        After which angle an encoder begins again [rad], 2 pi say; (n,) where joints differ, inf for
        those that do not; None: none does.

    Raises
    ------
    ArgumentError
        A `tau` below 0, or a `turn` that is not above 0.

    Notes
    -----
    A joint that moves by more than half a turn from one angle to the next cannot be told from one
    that moves the other way.
    """

    tau: Annotated[float, Number("s", low=0.0)] = 0.005
    turn: Annotated[ArrayLike | None, PerJoint("rad", above=0.0, finite=False)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.turn is not None:  # as what is hashed and compared
            turn = np.asarray(self.turn)
            self._set(turn=tuple(turn.tolist()) if turn.ndim else float(turn))

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
        a = step / (self.tau + step)
        return float(resolution / np.sqrt(12.0) * a / step * np.sqrt(2.0 / (2.0 - a)))

    def nearest(self, angle: FloatArray, to: FloatArray) -> FloatArray:
        """Return `angle` moved by whole turns, to within half a turn of `to` [rad].

        With `to` the angle before, a motion goes on where the encoder begins again.
        """
        if self.turn is None:
            return angle
        turn = np.asarray(self.turn)
        finite = np.where(np.isinf(turn), 0.0, turn)
        return np.asarray(angle - finite * np.round((angle - to) / turn))

    def start(self, step: float) -> EncoderRateState:
        """Start it at a sampling period `step` [s]."""
        return EncoderRateState(self, checks.number("step", step, above=0.0))


class EncoderRateState:
    """What an `EncoderRate` remembers of any number of joints."""

    def __init__(self, encoder: EncoderRate, step: float) -> None:
        self.encoder, self._step = encoder, step
        self._kept = encoder.tau / (encoder.tau + step)
        self._q: FloatArray | None = None
        self._v: FloatArray = np.zeros(())

    def rate(self, q: FloatArray, ticks: int = 1) -> FloatArray:
        """Return the rates [rad/s] for angles `q` [rad], `ticks` after the last; 0 at the first."""
        if self._q is None:
            self._q, self._v = q.copy(), np.zeros_like(q)
            return self._v.copy()
        moved = self.encoder.nearest(q, self._q) - self._q
        # As if the joint had moved evenly through the ticks that were missed.
        kept = self._kept**ticks
        self._v = kept * self._v + (1.0 - kept) * moved / (ticks * self._step)
        self._q = q.copy()
        return self._v.copy()

    def reset(self) -> None:
        """Forget all angles."""
        self._q = None
