"""The constant scaling under which a loop of moving gains is smallest, and how small that is."""

from __future__ import annotations

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.sampled import ComplexArray
from fpid_pin.control.small_gain import MovingGains

#: Frequencies at first, evenly spread over decades.
FREQUENCIES = 250
#: By how much the bound may exceed what is found at frequencies.
EXCESS = 1.01
#: How often arcs may be halved.
HALVINGS = 40


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
        share = np.where(loop.radius > 0.0, d.reshape(-1, 3) ** -2.0, 0.0)
        share = share / np.maximum(right[:, np.newaxis] ** 2, 1e-300)
        inward = (np.abs(v[:, :, np.newaxis]) ** 2 * share).reshape(len(v), -1)
        slope = weights @ (u - inward) / total
        return float(log_size.max() + np.log(total) / power), slope

    log_d = np.zeros(response.shape[1])
    for power in (10.0, 100.0, 1000.0):
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
