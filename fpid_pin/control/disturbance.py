"""What a nominal model does not explain, observed for laws that are written in NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import BoolArray, FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Largest bandwidth of an observer, times the step. There what it estimates, once cancelled, still
#: bears two samples of delay that nobody told it of, or a model 5.7 times too heavy; from 1.4 on
#: two samples make it unstable. The noise of xi is 0.44 sigma/step there where that of speeds is
#: sigma, and 0.016 at 0.1.
FASTEST = 1.0


def observer_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Return the gains of `kernels.observer`, 1 - p^2 and (1 - p)^2/h; 0 for no bandwidth.

    Raises
    ------
    ArgumentError
        An observer faster than the sampling allows.
    """
    if bandwidth * step > FASTEST + 1e-9:
        expected = f"at most {FASTEST:g}/step ({FASTEST / step:g} rad/s)"
        raise checks.ArgumentError("observer", expected, f"{bandwidth:g} rad/s")
    pole = float(np.exp(-bandwidth * step))
    return 1.0 - pole**2, (1.0 - pole) ** 2 / step


class DisturbanceObserver:
    """The observer of `kernels.observer` beside a law that knows only torques and speeds.

    Parameters
    ----------
    arm
        The nominal arm.
    bandwidths
        One a run, (runs,) [rad/s].
    step
        Sampling period [s].
    """

    def __init__(self, arm: Arm, bandwidths: FloatArray, step: float) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import law, observer

        self.bandwidths = bandwidths
        shape = (len(bandwidths), arm.n)
        self._kernels: Any = observer
        self._fleet = Fleet([arm], shape[0])
        self._robots = np.zeros(shape[0], law.ROBOT)
        self._joints = np.zeros(shape, law.JOINT)
        self._robots["h"], self._joints["viscous"] = step, arm.viscous_friction
        gains = [observer_gains(float(omega), step) for omega in bandwidths]
        self._robots["l1"], self._robots["l2"] = np.transpose(gains)
        self._q, self._v_hat, self._xi, self._a, self._tau, self._none = np.zeros((6, *shape))
        self._torque: FloatArray = np.zeros(shape)
        self._begun = False

    def observe(
        self, alive: BoolArray, q: FloatArray, v: FloatArray, applied: FloatArray
    ) -> FloatArray:
        """Return the torque that acts and that the model knows nothing of, (runs, n); a buffer.

        Parameters
        ----------
        alive
            Which runs go on, (runs,).
        q, v
            Measured now, (runs, n).
        applied
            The torque since the last tick, saturated, (runs, n).
        """
        kernels, robots, joints = self._kernels, self._robots, self._joints
        if self._begun:
            kernels.brake(joints, applied, self._v_hat, self._tau)
            self._fleet.forward_dynamics(self._q, self._v_hat, self._tau, self._a)
            kernels.predict(robots, joints, self._a, self._none)
        kernels.correct(alive, robots, joints, v, self._v_hat, self._xi)
        self._q[:], self._begun = q, True
        self._fleet.mass_times(q, self._xi, self._torque)
        return self._torque

    def retire(self, run: int) -> None:
        """End a run."""
        self._joints[run], self._robots[run] = 0.0, 0.0
        self._q[run] = 0.0
