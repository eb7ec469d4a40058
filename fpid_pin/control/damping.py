"""How damped an arm's loops are at several poses, and which gains change that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.frozen import terms_of
from fpid_pin.control.sampled import ComplexArray, linear_arm
from fpid_pin.fractional import ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Below this a pole does not count as oscillating, rad/s.
SLOW = 0.1


class FrozenLoops:
    """The sampled loops of an arm at rest at several poses, (poses, n), under any gains above 0.

    The operators have six modes over the `horizon` [s]. If that is some 200 over the bandwidth,
    the least damping ratio comes out within some 0.05 of that of 24 modes over an hour,
    in a tenth of the time.
    """

    def __init__(
        self, arm: Arm, law: AdaptiveFpid, poses: FloatArray, *, step: float, horizon: float
    ) -> None:
        self.step, self.poses = step, poses
        coarse = ExponentialSum(modes=6)
        self._terms = terms_of(law, arm.n, step=step, horizon=horizon, design=coarse)
        rule = "semi_implicit_euler"
        self._plants = [linear_arm(arm, q, step=step, method=rule) for q in poses]

    def damping(self, gains: FloatArray, pose: int) -> float:
        """Return the least damping ratio with Kp, Ki, Kd, (3, n), scale included, at a pose."""
        matrix = self._plants[pose].closed(self._terms.weighed(gains))
        poles = np.asarray(np.linalg.eigvals(matrix), np.complex128)
        return float(damping_ratios(poles, self.step).min())

    def ratios(self, gains: FloatArray) -> FloatArray:
        """Return the least damping ratio at every pose, (poses,)."""
        return np.array([self.damping(gains, pose) for pose in range(len(self.poses))])

    def slopes(self, gains: FloatArray, pose: int, count: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return the least damping ratios of poles or pairs, and how they depend on the gains.

        With x and y the right and left eigenvectors of a pole z, dz/dK = y^T (dA/dK) x / y^T x; and
        (dA/dK) x is what the term of this gain, as a torque, does to the arm.

        Returns
        -------
        ratios, slopes
            (count,), least first, and the derivatives by the logarithms of gains, (count, 3, n).
        """
        plant, terms = self._plants[pose], self._terms.together
        values, right = np.linalg.eig(plant.closed(self._terms.weighed(gains)))
        poles = np.asarray(values, np.complex128)
        ratios = damping_ratios(poles, self.step)
        least = np.argsort(np.where(poles.imag >= 0.0, ratios, 2.0))[:count]
        left = np.linalg.solve(right.T, np.eye(len(poles))[:, least])
        states, n = len(plant.a), gains.shape[1]
        x, z = right[:, least], poles[least]
        signals = (terms.c @ x[states:] - terms.d @ x[:states]).reshape(n, 3, count)
        felt = plant.b.T @ left[:states] / (z * self.step)
        moved = np.einsum("tj,jtk,jk->ktj", gains, signals, felt)
        s = (np.log(z) / self.step)[:, np.newaxis, np.newaxis]
        # zeta = -Re s/|s|; a pole that only grows is to grow less.
        turned = s.real * (np.conj(s) * moved).real / np.abs(s) ** 3
        slopes = -moved.real / np.abs(s) + np.where(np.abs(s.imag) > SLOW, turned, 0.0)
        return ratios[least], np.asarray(slopes)


def damping_ratios(poles: ComplexArray, step: float) -> FloatArray:
    """Return the damping ratio -Re(s)/|s| of each pole z = exp(s h).

    Poles that hardly oscillate, |Im s| < `SLOW`, have 1, or -1 outside the unit circle. So have
    those beyond a quarter of the Nyquist frequency: they are the derivative's own, and the
    sampled-data bound sees to them.
    """
    s = np.log(poles + 1e-300) / step
    size = np.abs(s)
    motion = (np.abs(s.imag) > SLOW) & (size < 0.25 * np.pi / step)
    rest = np.where(np.abs(poles) < 1.0, 1.0, -1.0)
    return np.where(motion, -s.real / np.maximum(size, 1e-300), rest)
