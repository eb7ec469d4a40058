"""An arm at rest as a linear sampled system, and the frequencies at which loops are measured.

Signals are deviations from rest at a pose, sampled every h. The arm moves by the simulation's rule
(semi-implicit Euler, viscous friction implicit) or, as a real arm does behind a zero-order hold,
exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

ComplexArray = NDArray[np.complex128]
METHODS = ("semi_implicit_euler", "zero_order_hold")
#: Frequencies per decade. Crossings between them are interpolated, which at 1.2 % apart costs less
#: than 1e-4 of a margin.
DENSITY = 200
#: Lowest frequency that is looked at [rad/s]: ten minutes a period, slower than any arm is moved.
LOWEST = 1e-2
#: Step of the difference that gives dG/dq [rad]: error and rounding are both about 1e-10 of G.
STIFFNESS_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """``x+ = A x + B u, y = C x``.

    The last `modes` states drive nothing but themselves and y, and their part of A is diagonal.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    modes: int = 0

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return C (z I - A)^-1 B at points z, (K,), as (K, outputs, inputs)."""
        inner = z[:, np.newaxis, np.newaxis] * np.eye(len(self.a)) - self.a
        return np.asarray(self.c @ np.linalg.solve(inner, self.b.astype(np.complex128)))

    def closed(self, gain: FloatArray) -> FloatArray:
        """Return the state matrix under the feedback u = `gain` y."""
        return self.a + self.b @ (gain @ self.c)


def linear_arm(
    arm: Arm, q: FloatArray, *, step: float, method: str = "semi_implicit_euler",
    inertia: float = 1.0, late: int = 0,
) -> LinearSystem:  # fmt: skip
    """Return the arm at rest at `q` as a system from torque to [q, q'], its first 2 n states.

    Gravity's stiffness and viscous friction are included, dry friction is not: a joint that slides
    feels it as a constant.

    Parameters
    ----------
    arm, q
        The arm and its pose, (n,).
    step
        Sampling period [s].
    method
        How it moves between samples, one of `METHODS`.
    inertia
        Factor of its mass matrix: a load that the model does not know of.
    late
        By how many samples what is seen is late; the older values are further states.
    """
    checks.choice("method", method, METHODS)
    n = arm.n
    mass, viscous = inertia * arm.mass_matrix(q), np.diag(arm.viscous_friction)
    stiffness, eye, zero = gravity_stiffness(arm, q), np.eye(n), np.zeros((n, n))
    if method == "zero_order_hold":
        from scipy.linalg import expm

        inverse = np.linalg.inv(mass)
        rates = np.hstack([-inverse @ stiffness, -inverse @ viscous, inverse])
        whole = expm(step * np.vstack([np.hstack([zero, eye, zero]), rates, np.zeros((n, 3 * n))]))
        moved, pushed = whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :]
    else:
        inverse = step * np.linalg.inv(mass + step * viscous)
        speed = np.hstack([-inverse @ stiffness, eye - inverse @ viscous])
        moved = np.vstack([np.hstack([eye, zero]) + step * speed, speed])
        pushed = np.vstack([step * inverse, inverse])
    size = 2 * n * (1 + late)
    a, b = np.eye(size, k=-2 * n), np.zeros((size, n))
    a[: 2 * n, : 2 * n], b[: 2 * n] = moved, pushed
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
