"""The sampled linear loop: joint laws and arm as difference equations around a pose.

Signals are those of regulation, e = -q and e' = -q' about the home pose, sampled every h. What a
law does between two samples of its own is exact; the arm's motion is that of the simulation's rule
(semi-implicit Euler, friction implicit) or, for a real arm behind a zero-order hold, exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.fractional import Design
from fpid_pin.fractional.design import modes_of

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

ComplexArray = NDArray[np.complex128]
METHODS = ("semi_implicit_euler", "zero_order_hold")

#: Frequencies per decade at which responses are sampled.
_DENSITY = 200


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """``x+ = A x + B u, y = C x + D u``.

    The first `core` states do not depend on the others, and those depend on no other but
    themselves: modes, for which A is diagonal. None: no such structure.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    core: int | None = None

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return C (z I - A)^-1 B + D at points z, (K,), as (K, outputs, inputs)."""
        if not len(self.a):
            return np.broadcast_to(self.d, (len(z), *self.d.shape)).astype(np.complex128)
        core = len(self.a) if self.core is None else self.core
        points = z[:, np.newaxis, np.newaxis]
        inner = np.linalg.solve(points * np.eye(core) - self.a[:core, :core], self.b[:core])
        driven = self.a[core:, :core] @ inner + self.b[core:]
        modes = driven / (points - np.diag(self.a)[core:, np.newaxis])
        return np.asarray(self.c[:, :core] @ inner + self.c[:, core:] @ modes + self.d)

    def observed(self) -> LinearSystem:
        """Return the system without the states that no output depends on."""
        seen = (self.c != 0.0).any(axis=0)
        while (through := seen | (self.a[seen] != 0.0).any(axis=0)).sum() > seen.sum():
            seen = through
        a, b, c = self.a[np.ix_(seen, seen)], self.b[seen], self.c[:, seen]
        return LinearSystem(a, b, c, self.d)

    def closed(self, law: LinearSystem) -> FloatArray:
        """Return the state matrix of this arm under a law, which sees e = -q and e' = -q'."""
        top = np.hstack([self.a - self.b @ law.d, self.b @ law.c])
        return np.vstack([top, np.hstack([-law.b, law.a])])


def frequencies(step: float, lowest: float = 1e-2) -> FloatArray:
    """Return angular frequencies [rad/s] from `lowest` to Nyquist's, evenly spread over decades."""
    highest = np.pi / step
    count = int(np.ceil(_DENSITY * np.log10(highest / lowest)))
    return np.geomspace(lowest, highest, count)


def operators(
    orders: tuple[float, float], design: Design, *, step: float, horizon: float
) -> LinearSystem:
    """Return the three terms of one joint's FPID as a system from (e, e').

    Parameters
    ----------
    orders
        lambda, mu.
    design
        Of the fractional operators; its modes become states.
    step, horizon
        [s].

    Returns
    -------
    LinearSystem
        Outputs e, I^lambda e and D^mu e.

    Raises
    ------
    ArgumentError
        A design that keeps the past instead of modes.
    """
    rules = [(True, 1.0 - orders[0]), (False, orders[1])]
    whole = signals_of(rules, design, step=step, horizon=horizon)
    kept = [0, 3, 4]
    return LinearSystem(whole.a, whole.b, whole.c[kept], whole.d[kept], core=3)


def signals_of(
    rules: Sequence[tuple[bool, float]], design: Design, *, step: float, horizon: float
) -> LinearSystem:
    """Return e, int e, e' and fractional operators of e of one joint as a system from (e, e').

    Parameters
    ----------
    rules
        For each operator whether it is one of int e, and its order alpha as a derivative.
    design, step, horizon
        See `operators`.

    Notes
    -----
    The states are int e, e and e' of the last sample and the modes of all operators. The mode with
    p = 0 is the signal itself and needs no state of its own.
    """
    found = [modes_of(design, alpha, step=step, horizon=horizon).recursion() for _, alpha in rules]
    states = 3 + sum(rule.decay.size for rule in found)
    # Rows over [int e_, e_, e'_, modes..., e, e'] of this sample's signals.
    row = np.eye(states + 2)
    e, rate = row[states], row[states + 1]
    now = np.stack([row[0] + step / 2.0 * (e + row[1]) + step**2 / 12.0 * (row[2] - rate), e, rate])
    before, at = row[:3], 3
    following, outputs = [now], [e, now[0], rate]
    for (integral, _), rule in zip(rules, found, strict=True):
        # f and f' are int e and e of an integral's operator, e and e' of a derivative's.
        k = 0 if integral else 1
        f, f_, x = now[k : k + 2], before[k : k + 2], row[at : at + rule.decay.size]
        outputs.append(rule.now @ f + rule.before @ f_ + rule.weights @ x)
        driven = rule.drive_now @ f + rule.drive_before @ f_
        following.append(rule.decay[:, np.newaxis] * x + driven)
        at += rule.decay.size
    a, c = np.concatenate(following), np.array(outputs)
    return LinearSystem(a[:, :states], a[:, states:], c[:, :states], c[:, states:], core=3)


def linear_arm(arm: Arm, q: FloatArray, *, step: float, method: str) -> LinearSystem:
    """Return the arm at rest at `q` as a system from torque to [q, q'], (2 n).

    Gravity's stiffness is included, viscous friction too, dry friction not (a joint that slides
    feels it as a constant).
    """
    checks.choice("method", method, METHODS)
    n = arm.n
    inertia, viscous = arm.mass_matrix(q), np.diag(arm.viscous_friction)
    stiffness = gravity_stiffness(arm, q)
    eye, zero = np.eye(n), np.zeros((n, n))
    if method == "zero_order_hold":
        from scipy.linalg import expm

        inverse = np.linalg.inv(inertia)
        top = np.hstack([zero, eye, zero])
        middle = np.hstack([-inverse @ stiffness, -inverse @ viscous, inverse])
        whole = expm(step * np.vstack([top, middle, np.zeros((n, 3 * n))]))
        a, b = whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :]
    else:
        inverse = step * np.linalg.inv(inertia + step * viscous)
        speed = np.hstack([-inverse @ stiffness, eye - inverse @ viscous])
        a = np.vstack([np.hstack([eye, zero]) + step * speed, speed])
        b = np.vstack([step * inverse, inverse])
    return LinearSystem(a, b, np.eye(2 * n), np.zeros((2 * n, n)))


def gravity_stiffness(arm: Arm, q: FloatArray) -> FloatArray:
    """Return dG/dq at `q`, (n, n), N m/rad, by central differences."""
    width = 1e-5
    columns = []
    for j in range(arm.n):
        shift = np.zeros(arm.n)
        shift[j] = width
        ahead, behind = arm.gravity_vector(q + shift), arm.gravity_vector(q - shift)
        columns.append((ahead - behind) / (2.0 * width))
    return np.stack(columns, axis=1)


def crossings(
    omega: FloatArray, loop: ComplexArray, level: Callable[[ComplexArray], FloatArray]
) -> tuple[FloatArray, ComplexArray]:
    """Return where ``level(loop)`` changes sign, and the loop there, interpolated."""
    values = level(loop)
    k = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    part = values[k] / (values[k] - values[k + 1])
    at = omega[k] * (omega[k + 1] / omega[k]) ** part
    return at, loop[k] + part * (loop[k + 1] - loop[k])


def critical_derivative(design: Design, order: float, *, step: float, horizon: float) -> float:
    """Return the Kd at which ``Kd D^mu`` alone makes a joint of inertia 1 unstable.

    The joint moves as the simulation has it. With mu = 1 this is 2/h, reached at Nyquist's
    frequency; a lower order lags, so its loop breaks at a lower frequency, near mu pi/h.
    """
    omega = frequencies(step, lowest=1e-2 / step)
    z = np.exp(1j * omega * step)
    terms = operators((1.0, order), design, step=step, horizon=horizon)
    path = terms.response(z)[:, 2]
    speed = step / (z - 1.0)
    loop = speed * (path[:, 0] * step * z / (z - 1.0) + path[:, 1])
    _, at = crossings(omega, loop, lambda x: np.asarray(x.imag))
    # At Nyquist's own frequency everything is real: no change of sign announces it.
    real = np.append(at.real, loop[-1].real)
    real = real[real < 0.0]
    return float(1.0 / np.abs(real).max()) if real.size else np.inf
