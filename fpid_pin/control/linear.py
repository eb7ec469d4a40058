"""An arm at rest as a linear sampled system, and the frequencies at which loops are measured.

Signals are deviations from rest at a pose, sampled every h. The arm moves by the simulation's rule:
semi-implicit Euler, viscous friction implicit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

ComplexArray = NDArray[np.complex128]
#: Frequencies per decade. Crossings between them are interpolated, which at 1.2 % apart costs less
#: than 1e-4 of a margin.
DENSITY = 200
#: Lowest frequency that is looked at [rad/s]: ten minutes a period, slower than any arm is moved.
LOWEST = 1e-2
#: Step of the difference that gives dG/dq [rad]: error and rounding are both about 1e-10 of G.
STIFFNESS_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """``x+ = A x + B u, y = C x``."""

    a: FloatArray
    b: FloatArray
    c: FloatArray

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return C (z I - A)^-1 B at points z, (K,), as (K, outputs, inputs)."""
        inner = z[:, np.newaxis, np.newaxis] * np.eye(len(self.a)) - self.a
        return np.asarray(self.c @ np.linalg.solve(inner, self.b.astype(np.complex128)))

    def closed(self, gain: FloatArray) -> FloatArray:
        """Return the state matrix under the feedback u = `gain` y."""
        return self.a + self.b @ (gain @ self.c)


def linear_arm(
    arm: Arm, q: FloatArray, *, step: float, inertia: float = 1.0, late: int = 0
) -> LinearSystem:
    """Return the arm at rest at `q` as a system from torque to [q, q'], its first 2 n states.

    Gravity's stiffness and viscous friction are included; dry friction, a constant to a joint that
    slides, is not. The mass matrix counts `inertia` times: a load that the model does not know of.
    Measurements are `late` samples old, the older values being further states.
    """
    n = arm.n
    stiffness, viscous = gravity_stiffness(arm, q), np.diag(arm.viscous_friction)
    inverse = step * np.linalg.inv(inertia * arm.mass_matrix(q) + step * viscous)
    speed = np.hstack([-inverse @ stiffness, np.eye(n) - inverse @ viscous])
    size = 2 * n * (1 + late)
    a, b = np.eye(size, k=-2 * n), np.zeros((size, n))
    a[: 2 * n, : 2 * n] = np.vstack([np.eye(n, 2 * n) + step * speed, speed])
    b[: 2 * n] = np.vstack([step * inverse, inverse])
    return LinearSystem(a, b, np.eye(size)[size - 2 * n :])


def gravity_stiffness(arm: Arm, q: FloatArray) -> FloatArray:
    """Return dG/dq at `q`, (n, n) [N m/rad], by central differences."""
    shifts = STIFFNESS_STEP * np.eye(arm.n)
    ends = [arm.gravity_vector(q + x) - arm.gravity_vector(q - x) for x in shifts]
    return np.stack(ends, axis=1) / (2.0 * STIFFNESS_STEP)


def frequencies(step: float, lowest: float = LOWEST) -> FloatArray:
    """Return angular frequencies [rad/s] from `lowest` to Nyquist's, evenly spread over decades."""
    highest = np.pi / step
    return np.geomspace(lowest, highest, int(np.ceil(DENSITY * np.log10(highest / lowest))))


def crossings(
    omega: FloatArray, loop: ComplexArray, level: Callable[[ComplexArray], FloatArray]
) -> tuple[FloatArray, ComplexArray]:
    """Return where ``level(loop)`` changes sign, and the loop there, interpolated."""
    values = level(loop)
    k = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    part = values[k] / (values[k] - values[k + 1])
    at = omega[k] * (omega[k + 1] / omega[k]) ** part
    return at, loop[k] + part * (loop[k + 1] - loop[k])


def critical_gain(loop: ComplexArray) -> FloatArray:
    """Return the factors at which loops along all frequencies, (K,), pass through -1.

    At Nyquist's own frequency, the last, everything is real: no change of sign announces it.
    """
    _, at = crossings(np.arange(1.0, len(loop) + 1.0), loop, lambda x: np.asarray(x.imag))
    real = np.append(at.real, loop[-1].real)
    return np.asarray(1.0 / np.abs(real[real < 0.0]))
