"""The default design: the kernel as a sum of decaying exponentials with shared poles.

The starting point is the integral

    t^-alpha / Gamma(1 - alpha) = (sin(pi alpha)/pi) int_0^inf p^(alpha-1) exp(-p t) dp

by the trapezoidal rule in u = ln p (Beylkin and Monzón, Appl. Comput. Harmon. Anal. 19, 2005, and
28, 2010), whose weights are positive and smooth in alpha. They remove superfluous poles by Prony's
method, which would give each order poles of its own. Here the poles stay, and both ends of their
range are corrected by least squares of the relative error on [step, horizon], in factors that
multiply those weights and are held near one by a slight Tikhonov term: they too are smooth in
alpha, so they are fitted at a few Chebyshev nodes and interpolated. One table serves every order,
and an order may change at any sample.

The poles are spread evenly in ln p, wider at the slow end, and there is one at p = 0, without
which small orders (whose kernel hardly decays) cannot be met. The spread was found by
minimising the largest relative error over orders 0.1 and 0.9.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, Whole, read_only
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional.design import Design, Modes, check_grid, check_order

_DEFAULT_MODES = 24
_MAX_MODES = 128
# The slowest pole is _SLOW/horizon; the first gaps are wider by exp(_STRETCH exp(-gap/_REACH)).
_SLOW, _STRETCH, _REACH = 0.3, 0.8, 2.0
# A tail cut at p = b/step is hidden by the trapezoidal error when b is half of pi^2/spacing.
_FAST = 0.5 * math.pi**2
_NODES = 24
_REGULARISATION = 1e-11


@described("exponential_sum")
@dataclass(frozen=True)
class ExponentialSum(Design):
    """The kernel of equation (4) as a sum of exponentials, fitted on [step, horizon].

    Parameters
    ----------
    modes
        Number of modes, 1 to 128; 24 when neither is given. At 1 ms and 20 s the
        kernel is within 5e-4 with 16 modes, 6e-7 with 24, 1e-9 with 32, 1e-11 with 40,
        relative, for any order; eight more modes for a horizon 180 times longer.
    tolerance
        Instead of `modes`: the largest relative error of the kernel, over every lag from one
        step to the horizon and every order in [0, 1]. The fewest modes that meet it are used.

    Raises
    ------
    ArgumentError
        Modes below 1 or above 128, a tolerance that is not in (0, 1], or both given.
    DesignError
        Later, when step and horizon are known: the tolerance cannot be met; the message says
        which is met, and with how many modes.
    """

    modes: Annotated[int | None, Whole(low=1, high=_MAX_MODES)] = None
    tolerance: Annotated[float | None, Number(above=0.0, high=1.0)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.modes is not None and self.tolerance is not None:
            raise ArgumentError("modes", "either modes or tolerance", "both")
        if self.modes is None and self.tolerance is None:
            self._set(modes=_DEFAULT_MODES)

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Modes:
        """Return the modes' coefficients for every order in `order`, all with the same poles."""
        alpha, table = check_order(order), self._table(step, horizon)
        return Modes.of_kernel(alpha, table.step, table.poles, table.weights(alpha))

    def poles(self, *, step: float, horizon: float) -> FloatArray:
        """Return the decay rates [1/s], (modes,), slowest first; the first is 0."""
        return self._table(step, horizon).poles

    def worst_error(self, *, step: float, horizon: float) -> float:
        """Return the largest relative error of the kernel over all orders and fitted lags."""
        return self._table(step, horizon).worst_error()

    def _table(self, step: float, horizon: float) -> "_Table":
        grid = check_grid(step, horizon)
        if self.tolerance is None:
            assert self.modes is not None
            return _table(self.modes, *grid)
        return _table(_fewest_modes(self.tolerance, *grid), *grid)


class _Table:
    """Weights as a function of order, for one choice of poles."""

    def __init__(self, modes: int, step: float, horizon: float) -> None:
        self.step, self.horizon = step, horizon
        self.poles, self._spacing = _poles(modes, step, horizon)
        if modes > 1:
            # Where the slowest pole's cell begins.
            self._edge = float(self.poles[1] * math.exp(-0.5 * self._spacing[0]))
        self._lags = _chebyshev_lags(step, horizon, 2 * modes + 10)
        # Chebyshev nodes of the first kind, mapped to (0, 1): neither end is among them.
        angle = math.pi * (np.arange(_NODES) + 0.5) / _NODES
        self._nodes = 0.5 - 0.5 * np.cos(angle)
        self._barycentric = np.sin(angle) * (-1.0) ** np.arange(_NODES)
        self._factors = self._fit() if modes > 1 else None

    def _fit(self) -> FloatArray | None:
        """Return correction factors (nodes, modes), or None where there is no good table.

        Where few modes span many decades some factors come out negative for some orders; those
        orders, and all where there is no table, are fitted one by one, never negative.
        """
        modes = self.poles.size
        # Small orders have small errors. In units of alpha, with the correction of the mode at
        # p = 0 in those units too, the factors are smooth down to 0 and nothing cancels.
        nodes = self._nodes[:, None]
        edge = np.log(self._edge * self._lags)
        log_zero = nodes * edge - scipy.special.gammaln(1.0 + nodes)
        pt = np.multiply.outer(self._lags, self.poles[1:])
        basis = np.exp(-pt) * pt ** nodes[:, :, None] * self._spacing
        basis *= scipy.special.rgamma(1.0 + nodes)[:, :, None]
        lags = self._lags.size
        system = np.zeros((_NODES, lags + modes, modes + 1))
        system[:, :lags, 0] = np.exp(log_zero)
        system[:, :lags, 1:modes] = basis
        system[:, :lags, modes] = -np.expm1(log_zero) / nodes - basis.sum(axis=2)
        system[:, lags:, :modes] = _REGULARISATION * math.sqrt(lags) * np.eye(modes)
        triangle: FloatArray = np.asarray(np.linalg.qr(system, mode="r"))
        right = triangle[:, :modes, modes:]
        change = np.linalg.solve(triangle[:, :modes, :modes], right)[:, :, 0]
        change[:, 0] *= self._nodes
        factors = np.asarray(1.0 + change, dtype=np.float64)
        # Where many modes crowd together the factors are too uncertain to be interpolated.
        between = 0.5 * (self._nodes[:-1] + self._nodes[1:])
        on, off = (
            np.abs(self._error(self._interpolate(factors, x) * self._scale(x), x, self._lags)).max()
            for x in (self._nodes, between)
        )
        return factors if off <= 1.5 * on else None

    def _scale(self, alpha: FloatArray) -> FloatArray:
        """Return the trapezoidal weights, (modes, ...) for alpha (...)."""
        out = np.empty(self.poles.shape + alpha.shape)
        # sin(pi alpha)/pi, exactly 0 at both ends.
        sine = alpha * scipy.special.rgamma(1.0 + alpha) * scipy.special.rgamma(1.0 - alpha)
        out[0] = scipy.special.rgamma(1.0 + alpha) * scipy.special.rgamma(1.0 - alpha)
        if self.poles.size > 1:
            column = (-1,) + (1,) * alpha.ndim
            cell, poles = self._spacing.reshape(column), self.poles[1:].reshape(column)
            out[1:] = sine * cell * poles**alpha
            # What the integral holds below the slowest pole's cell is the pole's at 0.
            out[0] *= self._edge**alpha
        return out

    def weights(self, order: FloatArray) -> FloatArray:
        """Return the modes' weights, (modes, ...), none of them negative."""
        # Populations ask for the same orders many times over.
        alpha, where = np.unique(order.reshape(-1), return_inverse=True)
        weights = np.empty((self.poles.size, alpha.size))
        good = np.zeros(alpha.size, dtype=bool)
        if self._factors is not None:
            factors = self._interpolate(self._factors, alpha)
            good = factors.min(axis=0) >= 0.0
            weights[:] = factors * self._scale(alpha)
        for k in np.flatnonzero(~good):
            weights[:, k] = self._non_negative(float(alpha[k]))
        weights[0, alpha == 0.0] = 1.0
        return weights[:, where.reshape(-1)].reshape(self.poles.shape + order.shape)

    def _interpolate(self, factors: FloatArray, alpha: FloatArray) -> FloatArray:
        """Interpolate the factors to orders (k,) by the barycentric formula: (modes, k)."""
        away = alpha[:, None] - self._nodes
        hit = away == 0.0
        fraction = self._barycentric / np.where(hit, 1.0, away)
        on_node = hit.any(axis=1)
        fraction[on_node] = hit[on_node]
        fraction /= fraction.sum(axis=1, keepdims=True)
        # Not a matrix product: its bits would depend on how many orders are asked for at once.
        out = np.zeros((self.poles.size, alpha.size))
        for node in range(_NODES):
            out += fraction[:, node] * factors[node][:, None]
        return out

    def _non_negative(self, alpha: float) -> FloatArray:
        if alpha in (0.0, 1.0):
            return np.concatenate([[1.0 - alpha], np.zeros(self.poles.size - 1)])
        relative = self._lags**alpha * scipy.special.gamma(1.0 - alpha)
        basis = np.exp(-np.multiply.outer(self._lags, self.poles)) * relative[:, None]
        size = basis.max(axis=0)
        steps = 50 * self.poles.size
        solution = scipy.optimize.nnls(basis / size, np.ones(len(basis)), maxiter=steps)[0]
        return np.asarray(solution / size)

    def _error(self, weights: FloatArray, order: FloatArray, lags: FloatArray) -> FloatArray:
        """Return the kernel's relative error for orders (k,) at lags (t,): (t, k)."""
        kernel = np.exp(-np.multiply.outer(lags, self.poles)) @ weights
        return np.asarray(kernel * lags[:, None] ** order * scipy.special.gamma(1.0 - order) - 1.0)

    def worst_error(self) -> float:
        """Return the largest relative error over fitted lags and orders in (0, 1)."""
        orders = read_only([1e-3, 0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.999])
        lags = _chebyshev_lags(self.step, self.horizon, 16 * self.poles.size + 50)
        lags = np.concatenate([[self.step], lags, [self.horizon]])
        return float(np.abs(self._error(self.weights(orders), orders, lags)).max())


def _chebyshev_lags(step: float, horizon: float, count: int) -> FloatArray:
    """Return lags on [step, horizon], Chebyshev in ln t: least squares there is near minimax."""
    angle = math.pi * (np.arange(count) + 0.5) / count
    return np.asarray(step * (horizon / step) ** (0.5 - 0.5 * np.cos(angle)))


def _poles(modes: int, step: float, horizon: float) -> tuple[FloatArray, FloatArray]:
    """Return the poles, (modes,), and the trapezoidal cells of all but the first."""
    count = modes - 1
    if count == 0:
        return read_only([0.0]), np.zeros(0)
    if count == 1:
        return read_only([0.0, 1.0 / math.sqrt(step * horizon)]), np.array([2.0])
    gaps = np.exp(_STRETCH * np.exp(-np.arange(count - 1) / _REACH))
    fast = 8.0
    for _ in range(61):
        spacing = math.log(fast * horizon / (_SLOW * step)) / gaps.sum()
        fast = min(max(_FAST / spacing, 0.5), 36.0)
    position = np.concatenate([[0.0], np.cumsum(gaps * spacing)])
    poles = np.concatenate([[0.0], (_SLOW / horizon) * np.exp(position)])
    return read_only(poles), np.gradient(position)


_table = lru_cache(maxsize=64)(_Table)


@lru_cache(maxsize=64)
def _fewest_modes(tolerance: float, step: float, horizon: float) -> int:
    errors: dict[int, float] = {}
    for modes in range(8, 81, 8):
        errors[modes] = _table(modes, step, horizon).worst_error()
        if errors[modes] <= tolerance:
            fewer = range(modes - 7, modes + 1)
            return next(m for m in fewer if _table(m, step, horizon).worst_error() <= tolerance)
        if errors[modes] > 0.5 * errors.get(modes - 8, np.inf):
            break  # rounding has taken over: more modes no longer help
    best = min(errors, key=errors.__getitem__)
    raise DesignError(
        f"tolerance: expected one that can be met for lags in [{step:g}, {horizon:g}] s,"
        f" got {tolerance:g}; {errors[best]:.1e} is met, with {best} modes"
    )
