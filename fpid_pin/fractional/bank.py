"""The streaming operator: D^alpha of many signals at once, one sample at a time.

Each mode of a design obeys x' = -p x + f', and the output is a weighted sum of modes and newest
samples. In the basis of `rows` a sample costs one weighted sum and three passes over the modes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.design import (
    DEFAULT_HORIZON,
    Coefficients,
    Design,
    check_grid,
    check_order,
)
from fpid_pin.fractional.rows import rows

_einsum: Callable[..., Any]
try:
    # What np.einsum calls, without 1.5 us of Python around it (twice the rest, for one robot).
    from numpy._core.multiarray import c_einsum as _einsum
except ImportError:  # pragma: no cover - a NumPy that moved it
    _einsum = np.einsum

INITIALISATIONS = ("caputo", "riemann_liouville", "grunwald_letnikov")
RATES = ("measured", "differenced")
_NEVER = -1
_T = TypeVar("_T", bound=np.generic)


class Bank:
    """Fractional derivatives of order alpha in [0, 1] of an array of signals, streaming.

    The state is constant in time and grows with the number of modes only. Order 0 is the
    identity f and order 1 the rate f', both exactly, whatever the design.

    Parameters
    ----------
    design
        How: `ExponentialSum`, `Crone`, `RefinedOustaloup`; `GrunwaldLetnikov` and `L1` keep the
        signal's past instead of modes.
    order
        Orders alpha, of any shape, for example (terms, runs, joints); it is the bank's shape.
    step
        Sampling step h [s].
    horizon
        Longest time [s] the design is fitted for; running past it warns once.
    initialisation
        What is taken to have happened before t = 0, where f starts at f(0):

        ``"caputo"``
            The signal had always been f(0): output 0 at t = 0 (0 < alpha < 1), no kick.
        ``"riemann_liouville"``
            It was 0 until t = 0 and jumped: adds ``f(0) t^-alpha/Gamma(1 - alpha)``, which is
            infinite at t = 0. That sample gives 0 as Caputo's does; the next, one step later,
            has ``f(0) h^-alpha/Gamma(1 - alpha)``, some hundreds of times f(0) at 1 ms.
        ``"grunwald_letnikov"``
            As above, and the sample at t = 0 already has the kick of the sum (1),
            ``f(0) h^-alpha``; of a CRONE filter at rest that sees a step, ``f(0) H(inf)``.
    rate
        ``"measured"``: value and rate are both given; between samples the rate is the quadratic
        through both measured rates that integrates to the change of f, so that a constant bias
        of the rate does not accumulate. ``"differenced"``: only f is given and its rate is
        taken constant between samples, which is the L1 rule.

    Attributes
    ----------
    shape : tuple of int
        Shape of every input and output.
    order : ndarray
        Orders in use.

    Raises
    ------
    ArgumentError
        An order outside [0, 1], step <= 0, horizon <= step, an unknown word.
    """

    def __new__(cls, design: Design, *args: Any, **kwargs: Any) -> Bank:
        """Choose the bank that the design runs on."""
        if cls is Bank:
            checks.instance("design", design, Design, "a fractional design")
            cls = design._bank_class()
        return object.__new__(cls)

    def __init__(
        self,
        design: Design,
        order: ArrayLike,
        *,
        step: float,
        horizon: float = DEFAULT_HORIZON,
        initialisation: str = "caputo",
        rate: str = "measured",
    ) -> None:
        self.design = design
        self.order = check_order(order)
        self.step, self.horizon = check_grid(step, horizon)
        self.initialisation = checks.choice("initialisation", initialisation, INITIALISATIONS)
        self.rate = checks.choice("rate", rate, RATES)
        self.shape = self.order.shape
        self._measured = self.rate == "measured"
        # One channel is padded to two: with a single column NumPy sums pairwise, in another
        # order, and a run alone would differ in its last bits from the same run in a population.
        self._count = self.order.size
        self._channels = max(self._count, 2)
        self._dead: NDArray[np.bool_] | None = None
        self._allocate()
        self.reset()

    def _allocate(self) -> None:
        coefficients = self._coefficients(self.order)
        self._modes = coefficients.poles.shape[0] - 1
        self._inputs = 2 if self._measured else 1
        self._head = 2 * self._inputs + (self.initialisation != "caputo")
        self._rows = np.zeros((self._head + self._modes, self._channels))
        self._output = np.zeros(self._channels)
        self._scratch = np.zeros((self._modes, self._channels))
        self._offset = np.zeros(self.shape)
        # Views, made once: a slice costs as much as the arithmetic of one robot.
        self._value_view = self._rows[0, : self._count].reshape(self.shape)
        self._rate_view = self._rows[self._inputs - 1, : self._count].reshape(self.shape)
        self._value_row, self._rate_row = self._rows[0:1], self._rows[1:2]
        self._now = self._rows[: self._inputs]
        self._before = self._rows[self._inputs : 2 * self._inputs]
        self._w = self._rows[self._head :]
        self._output_view = self._output[: self._count].reshape(self.shape)
        self._assemble(coefficients)

    def _coefficients(self, order: FloatArray) -> Coefficients:
        found = self.design.coefficients(order, step=self.step, horizon=self.horizon)
        if not isinstance(found, Coefficients):
            raise ArgumentError("design", "one with modes", type(self.design).__name__)
        return found

    def _columns(self, array: NDArray[_T]) -> NDArray[_T]:
        """Flatten the trailing (shape) of an array to channels, padded."""
        lead = array.shape[: array.ndim - len(self.shape)]
        flat = array.reshape(*lead, self._count)
        return np.concatenate([flat] * 2, axis=-1) if self._count == 1 else flat

    def _assemble(self, c: Coefficients) -> None:
        """Take over a design's coefficients."""
        self._shared = c.shared_poles
        self._kick = c.kick
        self._constants = constants = rows(
            c,
            measured=self._measured,
            from_rest=self._head > 2 * self._inputs,
            channels=self._channels,
        )
        self._weights = constants.weights
        # A product with a full array takes half the time of one that is broadcast, and a sum of
        # two outer products less than two passes.
        size = (self._modes, self._channels)
        self._decay = np.ascontiguousarray(np.broadcast_to(constants.decay, size))
        self._sigma = constants.sigma
        self._drive = np.concatenate([np.ones_like(self._sigma), self._sigma], axis=1)
        identity = self.order == 0.0
        self._identity: NDArray[np.bool_] | None = identity if identity.any() else None
        self._clear_dead()

    def reset(self) -> None:
        """Go back to t = 0; retired channels stay retired."""
        self._rows[:] = 0.0
        self._output[:] = 0.0
        self._offset[...] = 0.0
        self._tick = 0
        self._ramp: tuple[FloatArray, FloatArray, int, int] | None = None
        self._end = round(self.horizon / self.step)
        self._event = 0

    def update(
        self,
        value: NDArray[np.float64],
        rate: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        hold: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.float64]:
        """Take one sample and return D^alpha f at it.

        Parameters
        ----------
        value, rate
            f and f' now, of the bank's shape; `rate` only where it is measured.
        out
            Where to write the result; the bank's own buffer, overwritten by the next call, when
            it is None.
        hold
            Channels whose clock stands still for this sample, broadcastable to the bank's shape:
            their state and output stay, and the present value and rate become the previous
            sample's, so that nothing jumps on release.

        Raises
        ------
        ArgumentError
            A rate that is missing, or given where it is not used; a wrong shape.
        """
        if self._tick == self._event:
            if self._tick == 0:
                return self._begin(value, rate, out)
            self._attend()
        self._tick += 1
        try:
            np.subtract(value, self._offset, out=self._value_view)
            if self._measured:
                np.copyto(self._rate_view, rate)  # type: ignore[arg-type]
            elif rate is not None:
                raise ValueError
        except (TypeError, ValueError):
            raise self._wrong(value, rate) from None
        if hold is not None:
            self._advance_held(value, hold)
        else:
            if self._dead is not None:
                np.copyto(self._now, 0.0, where=self._dead)
            _einsum("mc,mc->c", self._weights, self._rows, out=self._output)
            self._advance()
            if self._identity is not None:
                np.copyto(self._output_view, value, where=self._identity)
        if out is None:
            return self._output_view
        np.copyto(out, self._output_view)
        return out

    def _advance(self) -> None:
        w, scratch = self._w, self._scratch
        np.multiply(w, self._decay, out=w)
        if not self._measured:
            np.add(w, self._value_row, out=w)
        elif self._shared:
            _einsum("mk,kc->mc", self._drive, self._now, out=scratch)
            np.add(w, scratch, out=w)
        else:
            np.multiply(self._sigma, self._rate_row, out=scratch)
            np.add(scratch, self._value_row, out=scratch)
            np.add(w, scratch, out=w)
        self._before[...] = self._now

    def _advance_held(self, value: NDArray[np.float64], hold: NDArray[np.bool_]) -> None:
        """Advance with some channels' clocks standing still."""
        held = np.broadcast_to(hold, self.shape)
        still = self._columns(held)
        present, before = self._rows, self._before
        # f is counted from an offset that moves with it: the change is not part of the signal.
        drift = np.where(still, present[0] - before[0], 0.0)
        self._offset += drift[: self._count].reshape(self.shape)
        present[0, still] = before[0, still]
        kept = self._w[:, still]
        if self._measured:
            jump = present[1] - before[1]
            kept = kept + (self._constants.kappa * jump)[:, still]
        if self._dead is not None:
            np.copyto(self._now, 0.0, where=self._dead)
        fresh = np.empty_like(self._output)
        _einsum("mc,mc->c", self._weights, present, out=fresh)
        np.copyto(self._output, fresh, where=~still)
        if self._identity is not None:
            np.copyto(self._output_view, value, where=self._identity & ~held)
        self._advance()
        self._w[:, still] = kept

    def _begin(
        self,
        value: NDArray[np.float64],
        rate: NDArray[np.float64] | None,
        out: NDArray[np.float64] | None,
    ) -> NDArray[np.float64]:
        """Take the sample at t = 0, where the initialisation decides."""
        try:
            self._offset[...] = value
            if self._measured:
                np.copyto(self._rate_view, rate)  # type: ignore[arg-type]
            elif rate is not None:
                raise ValueError
        except (TypeError, ValueError):
            raise self._wrong(value, rate) from None
        result = np.zeros(self.shape)
        if self.initialisation == "grunwald_letnikov":
            result[...] = self._kick * self._offset
        if self._measured:
            np.copyto(result, self._rate_view, where=self.order == 1.0)
        np.copyto(result, self._offset, where=self.order == 0.0)
        self._rows[0] = 0.0
        start = np.zeros(self._channels)
        if self._head > 2 * self._inputs:
            start[: self._count] = self._offset.reshape(-1)
            self._rows[self._head - 1] = start
        rate_row = self._rate_row if self._measured else np.zeros((1, self._channels))
        self._w[...] = self._constants.start(start, rate_row)
        if self._dead is not None:
            self._rows[:, self._dead] = 0.0
            result.reshape(-1)[self._dead[: self._count]] = 0.0
        self._output_view[...] = result
        self._advance()
        self._tick = 1
        self._event = 1 if self._ramp is not None else self._end + 1
        if out is None:
            return self._output_view
        np.copyto(out, self._output_view)
        return out

    def _wrong(self, value: ArrayLike, rate: ArrayLike | None) -> ArgumentError:
        """Say what is wrong with a sample, once it is known that something is."""
        if self._measured and rate is None:
            return ArgumentError("rate", "the signal's rate (or a bank with 'differenced')", "none")
        if not self._measured and rate is not None:
            return ArgumentError("rate", "none (the bank is 'differenced')", "one")
        name, given = "value", np.shape(value)
        if self._measured and rate is not None and given == self.shape:
            name, given = "rate", np.shape(rate)
        return ArgumentError(name, f"numbers of shape {self.shape}", f"shape {given}")

    def _attend(self) -> None:
        """Do what is due before this sample: a step of a ramp, or the horizon's warning."""
        if self._ramp is not None:
            first, last, since, steps = self._ramp
            part = (self._tick - since + 1) / steps
            self._use(last if part >= 1.0 else checks.read_only(first + part * (last - first)))
            if part >= 1.0:
                self._ramp = None
        if self._tick == self._end + 1:
            self._warn_past_horizon()
        if self._ramp is not None:
            self._event = self._tick + 1
        else:
            self._event = self._end + 1 if self._tick <= self._end else _NEVER

    def _warn_past_horizon(self) -> None:
        # Imported late: most programs never get here.
        from fpid_pin.fractional.response import warn_past_horizon

        warn_past_horizon(self.design, self.order, step=self.step, horizon=self.horizon)

    def set_order(self, order: ArrayLike, ramp: float = 0.0) -> None:
        """Change the orders, from the next sample on.

        With shared poles (`ExponentialSum`) the output from then on equals that of a bank which
        had the new orders from t = 0. With poles that depend on the order (CRONE) each mode
        keeps its value and only what follows is new, which leaves a bump.

        Parameters
        ----------
        order
            New orders in [0, 1], broadcastable to the bank's shape.
        ramp
            Time [s] over which the orders move there linearly, one set of coefficients a sample.
            An order that ends at exactly 0 jumps from f - f(0) to f there.

        Raises
        ------
        ArgumentError
            An order outside [0, 1] or of the wrong shape, a negative ramp.
        """
        new = check_order(order)
        ramp = checks.number("ramp", ramp, low=0.0)
        try:
            new = checks.read_only(np.broadcast_to(new, self.shape))
        except ValueError:
            raise ArgumentError("order", f"shape {self.shape}", f"shape {new.shape}") from None
        steps = round(ramp / self.step)
        if steps > 0:
            self._ramp = (self.order, new, self._tick, steps)
            if self._tick > 0:
                self._event = self._tick
        else:
            self._ramp = None
            self._use(new)

    def _use(self, order: FloatArray) -> None:
        coefficients = self._coefficients(order)
        self.order = order
        if self._shared or self._tick == 0:
            self._assemble(coefficients)
            return
        value = self._before[0]
        rate = self._before[1] if self._measured else np.zeros_like(value)
        modes = self._constants.modes(self._w, value, rate)
        self._assemble(coefficients)
        self._w[...] = self._constants.from_modes(modes, value, rate)

    def retire(self, index: Any) -> None:
        """Turn channels into exact zeros for good: state, weights, input and output.

        A run that has diverged would otherwise fill its modes with infinities, or with
        denormal numbers, which cost sixteen times the time of others.

        Parameters
        ----------
        index
            Anything that indexes an array of the bank's shape: ``(slice(None), run)``.
        """
        mask = np.zeros(self.shape, dtype=bool)
        mask[index] = True
        dead = self._columns(mask)
        self._dead = dead if self._dead is None else self._dead | dead
        self._clear_dead()

    def _clear_dead(self) -> None:
        dead = self._dead
        if dead is None:
            return
        self._weights[:, dead] = 0.0
        self._rows[:, dead] = 0.0
        self._output[dead] = 0.0
        living = ~dead[: self._count].reshape(self.shape)
        self._offset[~living] = 0.0
        if self._identity is not None:
            self._identity = self._identity & living
