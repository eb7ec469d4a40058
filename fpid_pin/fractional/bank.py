"""The streaming operator: D^alpha of many signals at once, one sample at a time."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.fractional.design import DEFAULT_HORIZON, Design, check_grid, check_order
from fpid_pin.fractional.history import HistoryDesign
from fpid_pin.fractional.memory import ModalMemory, PastMemory
from fpid_pin.fractional.modes import INITIALISATIONS

RATES = ("measured", "differenced")


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
        checks.instance("design", design, Design, "a fractional design")
        self.design = design
        self.order = check_order(order)
        self.step, self.horizon = check_grid(step, horizon)
        self.initialisation = checks.choice("initialisation", initialisation, INITIALISATIONS)
        self.rate = checks.choice("rate", rate, RATES)
        self.shape = self.order.shape
        self._measured = self.rate == "measured"
        flat = self.order.reshape(-1)
        self._memory: ModalMemory | PastMemory
        # The past does not wear out: only modes are fitted to a horizon.
        self._end = -1
        if isinstance(design, HistoryDesign):
            self._memory = PastMemory(design, flat, self.step, self.initialisation)
        else:
            grid = (self.step, self.horizon)
            self._memory = ModalMemory(design, flat, *grid, self.initialisation)
            self._end = round(self.horizon / self.step) + 1
        # This sample and the last, and the output, all channels in a row.
        self._f, self._f_, self._rate, self._rate_, self._output = np.zeros((5, flat.size))
        self._dead, self._held = np.zeros((2, flat.size), dtype=bool)
        self._retired = False
        self.reset()

    def reset(self) -> None:
        """Go back to t = 0; retired channels stay retired."""
        self._output[:] = 0.0
        self._tick = 0
        self._ramp: tuple[FloatArray, FloatArray, int, int] | None = None

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
            sample's, so that nothing jumps on release. Nothing is held at t = 0.

        Raises
        ------
        ArgumentError
            A rate that is missing, or given where it is not used; a wrong shape.
        """
        shape, held, started = self.shape, self._dead, self._tick > 0
        try:
            np.copyto(self._f.reshape(shape), value)
            if self._measured:
                np.copyto(self._rate.reshape(shape), rate)  # type: ignore[arg-type]
            elif rate is not None:
                raise ValueError
            if hold is not None and started:
                held = self._held
                np.copyto(held.reshape(shape), hold)
                held |= self._dead
        except (TypeError, ValueError):
            raise self._wrong(value, rate, hold) from None
        if self._ramp is not None:
            self._follow(*self._ramp)
        if self._tick == self._end:
            warnings.warn(
                f"the fractional bank runs past its horizon of {self.horizon:g} s, beyond which "
                "its kernel is not fitted: fractional.report tells how far it can be trusted",
                FpidWarning,
                stacklevel=2,
            )
        if self._retired:
            self._f[self._dead] = self._rate[self._dead] = 0.0
        if not self._measured:
            self._difference(started)
        # A differenced rate is constant over the step: the same at both its ends.
        last_rate = self._rate_ if self._measured else self._rate
        signals = self._f, self._f_, self._rate, last_rate
        self._memory.sample(started, signals, held, self._output)
        self._tick += 1
        result = self._output.reshape(shape)
        if out is None:
            return result
        np.copyto(out, result)
        return out

    def _difference(self, started: bool) -> None:
        """Take the rate for constant since the last sample, and at t = 0 for that of the start."""
        if started:
            np.subtract(self._f, self._f_, out=self._rate)
            self._rate /= self.step
        else:
            self._rate[:] = self._f / self.step * (self.initialisation == "grunwald_letnikov")

    def _wrong(self, value: Any, rate: Any, hold: Any) -> ArgumentError:
        if self._measured and rate is None:
            return ArgumentError("rate", "the signal's rate (or a bank with 'differenced')", "none")
        if not self._measured and rate is not None:
            return ArgumentError("rate", "none (the bank is 'differenced')", "one")
        given = {"value": value} | ({"rate": rate} if self._measured else {})
        for name, array in given.items():
            try:
                np.copyto(np.empty(self.shape), array)
            except (TypeError, ValueError):
                got = f"shape {np.shape(array)}"
                return ArgumentError(name, f"numbers of shape {self.shape}", got)
        return ArgumentError("hold", f"booleans of shape {self.shape}", f"shape {np.shape(hold)}")

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
        self._ramp = (self.order, new, self._tick, steps) if steps > 0 else None
        if self._ramp is None:
            self._use(new)

    def _follow(self, first: FloatArray, last: FloatArray, since: int, steps: int) -> None:
        """Move the orders to where the ramp is at this sample."""
        part = (self._tick - since + 1) / steps
        if part >= 1.0:
            self._ramp = None
            self._use(last)
        else:
            self._use(checks.read_only(first + part * (last - first)))

    def _use(self, order: FloatArray) -> None:
        self.order = order
        self._memory.use(order.reshape(-1))

    def retire(self, index: Any) -> None:
        """Turn channels into exact zeros for good: state, input and output.

        A run that has diverged would otherwise fill its modes with infinities, or with
        denormal numbers, which cost sixteen times the time of others.

        Parameters
        ----------
        index
            Anything that indexes an array of the bank's shape: ``(slice(None), run)``.
        """
        self._dead.reshape(self.shape)[index] = True
        self._retired = True
        self._output[self._dead] = 0.0
        self._memory.clear(self._dead)
