"""The streaming operator: D^alpha of many signals at once, one sample at a time."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.fractional.design import (
    DEFAULT_HORIZON,
    INITIALISATIONS,
    Design,
    Records,
    check_grid,
    check_order,
    modes_of,
)

RATES = ("measured", "differenced")


class Bank:
    """Fractional derivatives of order alpha in [0, 1] of an array of signals, streaming.

    The state is constant in time and grows with the number of modes only. Order 0 is the
    identity f and order 1 the rate f', both exactly, whatever the design.

    Parameters
    ----------
    design
        How: `ExponentialSum`, `Crone`, or another with modes.
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
        # Imported late: it loads numba.
        from fpid_pin.kernels import operator

        self._kernels: Any = operator
        checks.instance("design", design, Design, "a fractional design")
        self.design = design
        self.order = check_order(order)
        self.step, self.horizon = check_grid(step, horizon)
        self.initialisation = checks.choice("initialisation", initialisation, INITIALISATIONS)
        self.rate = checks.choice("rate", rate, RATES)
        self.shape = self.order.shape
        size = self.order.size
        # This sample and the last, and the output, all channels in a row.
        self._f, self._f_, self._rate, self._rate_, self._output = np.zeros((5, size))
        self._records = self._fitted()
        self._end = round(self.horizon / self.step) + 1
        self.reset()

    def _fitted(self) -> Records:
        """Return new records of the modes for the orders in use."""
        flat = self.order.reshape(-1)
        modes = modes_of(self.design, flat, step=self.step, horizon=self.horizon)
        return modes.records(self.initialisation)

    def reset(self) -> None:
        """Go back to t = 0."""
        self._output[:] = 0.0
        self._tick = 0

    def update(
        self,
        value: NDArray[np.float64],
        rate: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Take one sample and return D^alpha f at it.

        Parameters
        ----------
        value, rate
            f and f' now, of the bank's shape; `rate` only where it is measured.
        out
            Where to write the result, of the bank's shape; None: into a new array.

        Raises
        ------
        ArgumentError
            A rate that is missing, or given where it is not used; a wrong shape.
        """
        measured, started = self.rate == "measured", self._tick > 0
        if measured and rate is None:
            raise ArgumentError("rate", "the signal's rate (or a bank with 'differenced')", "none")
        if not measured and rate is not None:
            raise ArgumentError("rate", "none (the bank is 'differenced')", "one")
        self._copy("value", value, self._f)
        if rate is not None:
            self._copy("rate", rate, self._rate)
        elif started:
            np.subtract(self._f, self._f_, out=self._rate)
            self._rate /= self.step
        else:
            jumps = self.initialisation == "grunwald_letnikov"
            self._rate[:] = self._f / self.step * jumps
        if self._tick == self._end:
            warnings.warn(
                f"the fractional bank runs past its horizon of {self.horizon:g} s, beyond which "
                "its kernel is not fitted: fractional.report tells how far it can be trusted",
                FpidWarning,
                stacklevel=2,
            )
        # A differenced rate is constant over the step: the same at both its ends.
        last = self._rate_ if measured else self._rate
        self._kernels.sample(
            started, *self._records, self._f, self._f_, self._rate, last, self._output,
            self.step,
        )  # fmt: skip
        self._tick += 1
        out = np.empty(self.shape) if out is None else out
        np.copyto(out, self._output.reshape(self.shape))
        return out

    def recorded(self, value: FloatArray, rate: FloatArray | None = None) -> FloatArray:
        """Return D^alpha of whole signals from t = 0, as `update` gives it sample by sample.

        Parameters
        ----------
        value, rate
            f and, where it is known, f', (N, ...): time first. What is streaming is left alone.

        Raises
        ------
        ArgumentError
            A wrong shape.
        """
        samples = max(len(value), 1)
        for name, given in (("value", value), ("rate", value if rate is None else rate)):
            if np.shape(given) != (samples, *self.shape):
                expected = f"shape {(samples, *self.shape)}"
                raise ArgumentError(name, expected, f"shape {np.shape(given)} (time first)")
        f = np.ascontiguousarray(value, dtype=np.float64).reshape(samples, -1)
        if rate is None:
            jump = f[:1] * (self.initialisation == "grunwald_letnikov")
            df = last = np.diff(f, axis=0, prepend=f[:1] - jump) / self.step
        else:
            df = np.ascontiguousarray(rate, dtype=np.float64).reshape(samples, -1)
            last = np.concatenate([df[:1], df[:-1]])
        out = np.empty_like(f)
        self._kernels.record(*self._fitted(), f, np.empty_like(f[0]), df, last, out, self.step)
        return out.reshape(samples, *self.shape)

    def _copy(self, name: str, given: ArrayLike, to: FloatArray) -> None:
        try:
            np.copyto(to.reshape(self.shape), given)
        except (TypeError, ValueError):
            got = f"shape {np.shape(given)}"
            raise ArgumentError(name, f"numbers of shape {self.shape}", got) from None

    def set_order(self, order: ArrayLike) -> None:
        """Change the orders, from the next sample on.

        With shared poles (`ExponentialSum`) the output from then on equals that of a bank which
        had the new orders from t = 0. With poles that depend on the order (CRONE) each mode
        keeps its value and only what follows is new, which leaves a bump.

        Parameters
        ----------
        order
            New orders in [0, 1], broadcastable to the bank's shape.

        Raises
        ------
        ArgumentError
            An order outside [0, 1] or of the wrong shape.
        """
        new = check_order(order)
        try:
            self.order = checks.read_only(np.broadcast_to(new, self.shape))
        except ValueError:
            raise ArgumentError("order", f"shape {self.shape}", f"shape {new.shape}") from None
        values = self._records.modes["x"]
        self._records = self._fitted()
        self._records.modes["x"] = values
