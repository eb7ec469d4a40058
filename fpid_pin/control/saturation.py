"""Effort limits with anti-windup: one component that every controller shares."""

from __future__ import annotations

import numpy as np

from fpid_pin.checks import BoolArray, FloatArray


class Saturation:
    """Clip torques at the nominal arm's effort limits and say where that winds integrals up.

    Anti-windup is conditional: a joint whose torque was cut keeps its integrals where integrating
    on would ask for yet more torque in the same direction, and lets them unwind otherwise
    (Åström and Hägglund, *Advanced PID Control*, section 3.5). States are held, never fed zeros:
    the fractional integral of a zero error fades, the held one does not.

    Parameters
    ----------
    effort_limit
        Largest torque of each joint, (n,), N m; inf where there is none.
    runs
        Number of runs.
    """

    def __init__(self, effort_limit: FloatArray, runs: int) -> None:
        self.limited = bool(np.isfinite(effort_limit).any())
        shape = (runs, len(effort_limit))
        self._high = np.ascontiguousarray(np.broadcast_to(effort_limit, shape))
        self._low = -self._high
        self._cut = np.zeros(shape)
        self._beyond: BoolArray = np.zeros(shape, dtype=np.bool_)
        self.active = False

    def apply(self, torque: FloatArray) -> FloatArray:
        """Clip `torque`, (runs, n), in place and remember by how much it was cut."""
        if not self.limited:
            return torque
        np.abs(torque, out=self._cut)
        np.greater(self._cut, self._high, out=self._beyond)
        self.active = bool(self._beyond.any())
        if self.active:
            np.copyto(self._cut, torque)
            np.minimum(torque, self._high, out=torque)
            np.maximum(torque, self._low, out=torque)
            np.subtract(self._cut, torque, out=self._cut)
        return torque

    def winds_up(self, push: FloatArray) -> BoolArray | None:
        """Return where `push` would drive a torque further beyond its limit, or None: nowhere.

        Parameters
        ----------
        push
            Direction in which the torque would change, (runs, n); only its sign counts.
        """
        if not self.active:
            return None
        mask: BoolArray = self._cut * push > 0.0
        return mask
