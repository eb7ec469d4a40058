"""The loop that moving gains close, and a bound on its size over the whole unit circle.

Every gain is K = K0 + r delta, |delta| <= 1 any sequence in time. The deltas close a loop about

    G(z) = diag(r) Phi(z) N(z)^-1 B,    N(z) = z I - A - B E K0 Phi(z)

from torques to terms, where Phi(z) are the terms, (3 n), of the states that are no modes of an
operator, the modes being eliminated, and E K0 the law (10): each term's torque enters its joint. If
some constant diagonal D makes ||D G E D^-1|| < 1 on the unit circle, no sequence destabilises the
loop: the small gain theorem, for deltas commute with D (Khalil, *Nonlinear Systems*, 2002, section
5.4; scalings: Doyle, IEE Proceedings D 129, 1982).
"""

from __future__ import annotations

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.linear import ComplexArray, LinearSystem
from fpid_pin.control.linear_law import feedback, modal

#: Frequencies at first, evenly spread over decades: some 30 a decade, as in a Bode diagram.
FREQUENCIES = 250
#: By how much the bound may exceed what is found at frequencies.
EXCESS = 1.01
#: How often arcs may be halved: after that they are as short as rounding.
HALVINGS = 40
#: Powers of the mean that stands for the largest of the norms, one search after another.
POWERS = (10.0, 100.0, 1000.0)


class MovingGains:
    """The loop of moving gains at one pose of an arm.

    Parameters
    ----------
    terms
        From the law's torque to its terms, of `terms_of`.
    gains, radius
        K0 and r, (3, n), scale included.
    step
        [s].
    """

    def __init__(
        self, terms: LinearSystem, gains: FloatArray, radius: FloatArray, *, step: float
    ) -> None:
        n = gains.shape[1]
        self.radius = radius.reshape(-1)
        self._law, self._joint = feedback(gains), feedback(np.ones((3, n)))
        # A term without any gain is in no loop, nor are the states that it alone shows.
        c = terms.c * ((self.radius > 0.0) | self._law.any(axis=0))[:, np.newaxis]
        seen = (c != 0.0).any(axis=0)
        seen[: 2 * n] = True
        for _ in seen:
            seen = seen | (terms.a[seen] != 0.0).any(axis=0)
        a, b, c = terms.a[np.ix_(seen, seen)], terms.b[seen], c[:, seen]
        self._closed = LinearSystem(a, b, c).closed(self._law)
        core = len(a) - int(seen[len(seen) - terms.modes :].sum())
        # It is e - e_ that drives modes: bounds by the moduli of both would lose as much as e is
        # larger. So (e_ - e)/h is the state in place of e_, the error of the last sample.
        change = np.eye(core)
        for j in range(n):
            last = (a[:core] == -np.eye(len(a))[j]).all(axis=1)
            change[last, last], change[last, j] = step, -1.0
        back = np.linalg.inv(change)
        self._a, self._b = back @ a[:core, :core] @ change, back @ b[:core]
        self._direct, self._out = c[:, :core] @ change, c[:, core:]
        self._drive, self._decay = a[core:, :core] @ change, np.diag(a)[core:]

    @property
    def stable(self) -> bool:
        """Whether the loop is, gains standing still."""
        return bool(np.abs(np.linalg.eigvals(self._closed)).max() < 1.0)

    @property
    def slowest(self) -> float:
        """How near to z = 1 the nearest mode is."""
        return float((1.0 - self._decay).min(initial=1.0))

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return G at points, (K,), as (K, 3 n, n)."""
        phi, inverse = self._loop(z)
        return np.asarray(self.radius[:, np.newaxis] * (phi @ (inverse @ self._b)))

    def sides(self, scaling: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return D diag(r), (3 n), and one factor a joint, (n,), that may stand for E D^-1.

        It is the root of E D^-1 D^-1 E^T, which is diagonal, so norms are the same.
        """
        inverse = np.where(self.radius > 0.0, 1.0 / scaling, 0.0)
        return scaling * self.radius, np.sqrt(self._joint @ inverse**2)

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
        slope = modal(-1.0 / (z[:, np.newaxis] - self._decay) ** 2, self._out, self._drive)
        rest = self._rest(z, rho[:, 0])
        torque = np.abs(self._law) @ rest
        moved = inverse @ (np.eye(len(self._a)) - self._b @ (self._law @ slope))
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
        phi = modal(1.0 / (z[:, np.newaxis] - self._decay), self._out, self._drive) + self._direct
        own = self._a + self._b @ (self._law @ phi)
        inverse = np.linalg.inv(_points(z) * np.eye(len(self._a)) - own)
        return phi, np.asarray(inverse, np.complex128)

    def _rest(self, z: ComplexArray, rho: FloatArray) -> FloatArray:
        """Return R, (K, 3 n, states), by how much modes can differ from their tangents.

        For 1/(z - E) that is rho^2/(|z_c - E|^2 (|z_c - E| - rho)); NaN where the mode is too near.
        """
        far = np.abs(z[:, np.newaxis] - self._decay)
        part = rho**2 / (far**2 * np.where(far > rho, far - rho, np.nan))
        return np.asarray(modal(part, np.abs(self._out), np.abs(self._drive)))


def best_scaling(loop: MovingGains, response: ComplexArray) -> FloatArray:
    """Return D, (3 n), that makes the largest scaled norm of responses, (K, 3 n, n), about least.

    The logarithm of the norm is convex in ln D (Sezginer and Overton, IEEE Transactions on
    Automatic Control 35, 1990); its largest over the points is smoothed by a power mean.
    """
    from scipy.optimize import minimize

    def merit(log_d: FloatArray, power: float) -> tuple[float, FloatArray]:
        d = np.exp(log_d)
        right = loop.sides(d)[1]
        scaled = d[:, np.newaxis] * response * right
        square, v = np.linalg.eigh(np.conj(np.swapaxes(scaled, 1, 2)) @ scaled)
        square, v = square[:, -1], v[:, :, -1]
        u = np.abs((scaled @ v[:, :, np.newaxis])[:, :, 0]) ** 2 / (square[:, np.newaxis] + 1e-300)
        log_size = 0.5 * np.log(square + 1e-300)
        weights = np.exp(power * (log_size - log_size.max()))
        total = weights.sum()
        # What part of a joint's factor is each term's.
        share = np.where(loop.radius > 0.0, d**-2.0, 0.0)
        share = share / np.maximum(np.tile(right**2, 3), 1e-300)
        slope = weights @ (u - np.tile(np.abs(v) ** 2, 3) * share) / total
        return float(log_size.max() + np.log(total) / power), slope

    log_d = np.zeros(response.shape[1])
    for power in POWERS:
        log_d = minimize(merit, log_d, args=(power,), jac=True, method="L-BFGS-B").x
    return np.asarray(np.exp(log_d))


def least_size(loop: MovingGains) -> float:
    """Return a number that a scaled norm of the loop stays below on the whole unit circle.

    It is at most one per cent above the largest norm that is met. Arcs between frequencies are
    halved until their bounds say so; inf where they never do.
    """
    edges = np.append(0.0, np.geomspace(min(0.1 * loop.slowest, 1e-6), np.pi, FREQUENCIES))
    angle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    scaling = best_scaling(loop, loop.response(np.exp(1j * angle[::3])))
    most = 0.0
    for _ in range(HALVINGS):
        middle, upper = loop.sizes(angle, width, scaling)
        most = max(most, float(middle.max()))
        left = upper > EXCESS * most
        if not left.any():
            return EXCESS * most
        angle, width = angle[left], 0.5 * width[left]
        angle = np.concatenate([angle - 0.5 * width, angle + 0.5 * width])
        width = np.concatenate([width, width])
    return np.inf


def _points(x: ComplexArray) -> ComplexArray:
    return x[:, np.newaxis, np.newaxis]


def _norm(matrices: ComplexArray) -> FloatArray:
    """Return the spectral norm of each of tall matrices, (K,)."""
    gram = np.conj(np.swapaxes(matrices, 1, 2)) @ matrices
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[:, -1], 0.0)))
