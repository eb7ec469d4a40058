"""The body of ``fpid-pin operators``: what a fractional operator is worth, in a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import Crone, Design, ExponentialSum, report

DESIGNS = ("exponential_sum", "crone")


def operators_table(
    orders: Sequence[float],
    step: float,
    horizon: float,
    *,
    design: str = "exponential_sum",
    modes: int | None = None,
    tolerance: float | None = None,
    band: tuple[float, float] = (1e-2, 1e3),
    n: int = 5,
    widening: float = 0.0,
    plot: Path | None = None,
) -> str:
    """Return the report of a design for some orders, and draw it where a path is given.

    Parameters
    ----------
    orders
        Orders in [0, 1].
    step, horizon
        Sampling step and horizon [s].
    design
        ``"exponential_sum"``, to which `modes` or `tolerance` belong, or ``"crone"``, to which
        `band` [rad/s], `n` and `widening` [decades] belong.
    modes, tolerance, band, n, widening
        See `ExponentialSum` and `Crone`.
    plot
        File for the figure.

    Raises
    ------
    ArgumentError
        Whatever is out of range; no orders at all; a plot of an unknown kind.
    FileFormatError
        A plot that cannot be written.
    DesignError
        A tolerance that cannot be met.
    """
    checks.choice("design", design, DESIGNS)
    if len(orders) == 0:
        raise ArgumentError("orders", "at least one order in [0, 1]", "none")
    step = checks.number("step", step, low=checks.STEPS[0], high=checks.STEPS[1])
    horizon = checks.number("horizon", horizon, above=0.0, high=step * checks.MOST_ROWS)
    chosen: Design
    crone = design == "crone"
    chosen = Crone(*band, n, widening) if crone else ExponentialSum(modes, tolerance)
    found = report(chosen, list(orders), step=step, horizon=horizon)
    if plot is not None:
        try:
            found.plot(plot)
        except ValueError as error:
            raise ArgumentError("plot", "a file that can be written", f"{plot} ({error})") from None
    return str(found)
