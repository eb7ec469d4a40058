"""The loop that moving gains close, and a bound on its size over the whole unit circle.

Every gain is K = K0 + r delta, |delta| <= 1 any sequence in time. The deltas close a loop about

    G(z) = diag(r) Phi(z) N(z)^-1 B,    N(z) = z I - A - B K0 Phi(z)

from torques to terms. Its states are q and q' of the arm and, of each joint, d = (e_ - e)/h, int e
and e' of the last sample; the modes of the operators are eliminated, and Phi(z), from these states
to all terms, holds them. With E each term's torque enters its joint. If some constant diagonal D
makes ||D G E D^-1|| < 1 on the unit circle, no sequence destabilises the loop: the small gain
theorem, for deltas commute with D.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.frozen import Terms
from fpid_pin.control.sampled import ComplexArray, LinearSystem


@dataclass(frozen=True, eq=False)
class _Operators:
    """One joint's terms: ``direct + out diag(1/(z - decay)) drive`` from the states `at`."""

    at: list[int]
    direct: FloatArray
    out: FloatArray
    drive: FloatArray
    decay: FloatArray


class MovingGains:
    """The loop of moving gains at one pose of an arm.

    Parameters
    ----------
    plant
        From torque to [q, q'], its first states.
    terms
        Of the law.
    gains, radius
        K0 and r, (3, n), scale included.
    step
        [s].
    """

    def __init__(
        self, plant: LinearSystem, terms: Terms, gains: FloatArray, radius: FloatArray,
        *, step: float,
    ) -> None:  # fmt: skip
        n, given = gains.shape[1], len(plant.a)
        size = given + 3 * n
        self._gains, self.radius = gains.T, radius.T
        a, b = np.zeros((size, size)), np.vstack([plant.b, np.zeros((3 * n, n))])
        a[:given, :given] = plant.a
        # int e, e, e' of the last sample, e and e' in terms of int e, d, e', q, q'. It is e - e_
        # that drives modes: bounds by the moduli of both would lose as much as e is larger.
        change = np.diag([1.0, step, 1.0, -1.0, -1.0])
        change[1, 3] = -1.0
        used = np.ones(size, dtype=bool)
        self._joints = []
        for j, system in enumerate(terms.joints):
            own = given + 3 * j
            at = [own, own + 1, own + 2, j, n + j]
            whole = np.hstack([system.a[:, :3], system.b]) @ change
            direct = np.hstack([system.c[:, :3], system.d]) @ change
            a[own : own + 3, at] = whole[:3]
            a[own + 1] = (a[j] - np.eye(size)[j]) / step
            b[own + 1] = b[j] / step
            decay = np.diag(system.a)[3:]
            self._joints.append(_Operators(at, direct, system.c[:, 3:], whole[3:], decay))
            # int e is no state of the loop where nothing depends on it.
            used[own] = direct[1, 0] != 0.0 and bool(gains[1, j] or radius[1, j])
        self._used = np.flatnonzero(used)
        self._a, self._b = a[np.ix_(self._used, self._used)], b[self._used]

    @property
    def slowest(self) -> float:
        """How near to z = 1 the nearest mode is."""
        return min(float((1.0 - joint.decay).min(initial=1.0)) for joint in self._joints)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return G at points, (K,), as (K, 3 n, n)."""
        phi, inverse = self._loop(z)
        return np.asarray(self.radius.reshape(-1, 1) * (phi @ (inverse @ self._b)))

    def sides(self, scaling: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return D diag(r), (3 n), and one factor a joint, (n), that may stand for E D^-1.

        It is the root of E D^-1 D^-1 E^T, which is diagonal, so norms are the same.
        """
        inverse = np.where(self.radius > 0.0, 1.0 / scaling.reshape(-1, 3), 0.0)
        return scaling * self.radius.reshape(-1), np.sqrt((inverse**2).sum(axis=1))

    def sizes(
        self, angle: FloatArray, width: FloatArray, scaling: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the scaled norm at frequencies, and a bound on it around them.

        Parameters
        ----------
        angle, width
            Of arcs of the unit circle, (K,): their middles and lengths [rad].
        scaling
            D, (3 n).

        Notes
        -----
        On an arc about z_c let x = z - z_c, |x| <= rho, Y = N(z_c)^-1, ' the derivative by z, L =
        D diag(r), and R >= |Phi - Phi_c - x Phi'_c| entry by entry. With

            Q = rho |Y N'| + |Y B| |K0| R,    V = (I - Q)^-1 |Y B| >= |N(z)^-1 B|
            P = rho |L Phi_c Y N'| + |L Phi_c Y B| |K0| R

        D G E D^-1 differs from G_c + x G'_c by no more, entry by entry, than

            |L| R V + |L Phi_c Y B| |K0| R |Y B| + (P + rho |L Phi'_c|) Q V

        where (I - Q)^-1 has no entry below 0. The norm of G_c + x G'_c is convex in x, so it is
        largest at a corner of a triangle around the arc: its ends, and where their tangents meet.
        """
        z, rho = np.exp(1j * angle), 2.0 * np.sin(0.25 * width)[:, np.newaxis, np.newaxis]
        left, right = self.sides(scaling)
        phi, inverse = self._loop(z)
        slope = self._summed(lambda decay: -1.0 / (z[:, np.newaxis] - decay) ** 2)
        rest = self._rest(z, rho[:, 0])
        torque = _weighed(rest, np.abs(self._gains))
        moved = inverse @ (np.eye(len(self._a)) - self._b @ _weighed(slope, self._gains))
        seen, slope = left[:, np.newaxis] * phi, left[:, np.newaxis] * slope
        felt = inverse @ self._b
        value = seen @ felt
        rate = (slope - seen @ moved) @ felt
        q = rho * np.abs(moved) + np.abs(felt) @ torque
        p = rho * (np.abs(seen @ moved) + np.abs(slope)) + np.abs(value) @ torque
        with np.errstate(over="ignore", invalid="ignore"):
            grown = np.linalg.inv(np.eye(q.shape[-1]) - q)
            most = grown @ np.abs(felt)
            change = left[:, np.newaxis] * rest @ most + p @ (q @ most)
            change = (change + np.abs(value) @ (torque @ np.abs(felt))) * right
            ok = (grown >= 0.0).all(axis=(1, 2)) & np.isfinite(change).all(axis=(1, 2))
            change = np.where(ok[:, np.newaxis, np.newaxis], change, 0.0)
        half = 0.5 * width
        corners = [np.expm1(1j * half), np.expm1(-1j * half), 1.0 / np.cos(half) - 1.0]
        around = [_norm((value + _points(x * z) * rate) * right) for x in corners]
        upper = np.where(ok, np.max(around, axis=0) + _norm(change), np.inf)
        return _norm(value * right), upper

    def _loop(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return Phi and N^-1 at points, (K, 3 n, states) and (K, states, states)."""
        phi = self._summed(lambda decay: 1.0 / (z[:, np.newaxis] - decay), direct=True)
        own = self._a + self._b @ _weighed(phi, self._gains)
        inverse = np.linalg.inv(_points(z) * np.eye(len(self._a)) - own)
        return phi, np.asarray(inverse, np.complex128)

    def _summed(
        self, part: Callable[[FloatArray], ComplexArray], *, direct: bool = False
    ) -> ComplexArray:
        """Return all joints' modes with a factor (K, modes) each, as (K, 3 n, states)."""
        rows = [
            joint.out @ (part(joint.decay)[:, :, np.newaxis] * joint.drive) + direct * joint.direct
            for joint in self._joints
        ]
        return np.asarray(self._placed(rows))

    def _rest(self, z: ComplexArray, rho: FloatArray) -> FloatArray:
        """Return R, (K, 3 n, states), by how much modes can differ from their tangents.

        For 1/(z - E) that is rho^2/(|z_c - E|^2 (|z_c - E| - rho)); NaN where the mode is too near.
        """
        rows = []
        for joint in self._joints:
            far = np.abs(z[:, np.newaxis] - joint.decay)
            near = np.where(far > rho, far - rho, np.nan)
            part = rho**2 / (far**2 * near)
            rows.append(np.abs(joint.out) @ (part[:, :, np.newaxis] * np.abs(joint.drive)))
        return np.asarray(self._placed(rows))

    def _placed(self, rows: list[Any]) -> Any:
        """Return rows over each joint's own states, (K, 3, 5), as rows over all that are used."""
        n = len(rows)
        full = np.zeros((len(rows[0]), 3 * n, self._used[-1] + 1), rows[0].dtype)
        for j, (joint, row) in enumerate(zip(self._joints, rows, strict=True)):
            full[:, 3 * j : 3 * j + 3, joint.at] = row
        return full[:, :, self._used]


def _weighed(phi: Any, gains: FloatArray) -> Any:
    """Return the torques of terms, (K, n, states)."""
    return np.einsum("jt,kjtm->kjm", gains, phi.reshape(len(phi), *gains.shape, -1))


def _points(x: ComplexArray) -> ComplexArray:
    return x[:, np.newaxis, np.newaxis]


def _norm(matrices: ComplexArray) -> FloatArray:
    """Return the spectral norm of each of tall matrices, (K,)."""
    gram = np.conj(np.swapaxes(matrices, 1, 2)) @ matrices
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[:, -1], 0.0)))
