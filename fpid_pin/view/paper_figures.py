"""The paper's figures 4 and 5 from runs of our own, and what goes with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.simulation.run import Run
from fpid_pin.view import plots
from fpid_pin.view.scene import as_runs
from fpid_pin.view.panels import REFERENCE, has_gains, has_supervisor, lettered_names, limits_of
from fpid_pin.view.style import lettering, new_figure, styled, thinned

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def response(run: Run, heading: str = "") -> Figure:
    """Draw the panels of Figs. 4 and 5: (a) tracking, (b) control signals, (c) errors.

    Parameters
    ----------
    run
        What to draw; all joints share each panel.
    heading
        Above the figure; the run's name if empty.
    """
    figure, axes = new_figure(3, 1, 6.6, 6.6)
    track, control, error = (row[0] for row in axes)
    n = run.q.shape[1]
    for j, name in enumerate(lettered_names(run)):
        colour = f"C{j % 7}"
        track.plot(*thinned(run.t, run.q[:, j]), color=colour, label=f"{name}, actual")
        look = REFERENCE | {"label": "desired" if j == n - 1 else "_"}
        track.plot(*thinned(run.t, run.q_ref[:, j]), **look)
        control.plot(*thinned(run.t, run.torque[:, j]), color=colour, label=name)
        error.plot(*thinned(run.t, run.error[:, j]), color=colour, label=name)
        limit = float(limits_of(run)[j])
        if np.isfinite(limit) and np.abs(run.torque[:, j]).max(initial=0.0) > 0.5 * limit:
            for side in (limit, -limit):
                control.axhline(side, color=colour, linestyle=":", linewidth=1.0)
    track.set(title="(a) tracking", ylabel="joint angle, rad")
    control.set(title="(b) control signals", ylabel="torque, N m")
    error.set(title="(c) tracking errors", ylabel="$q_d - q$, rad", xlabel="time, s")
    for panel, columns in ((track, n + 1), (control, n), (error, n)):
        panel.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=min(columns, 4), borderaxespad=0.1
        )
    figure.suptitle(lettering(heading or run.name), fontsize=10)
    return figure


def is_integer(run: Run) -> bool:
    """Whether a run's controller is of integer orders (or has no orders at all)."""
    table = run.meta["controller"]
    orders = [table.get(f"{kind}_order", 1.0) for kind in ("integral", "derivative")]
    return all(bool((np.asarray(order, dtype=np.float64) == 1.0).all()) for order in orders)


def figures(runs: Run | Sequence[Run]) -> dict[str, Figure]:
    """Return the figures of an experiment by name.

    ``fig4`` is the first integer-order run and ``fig5`` the first fractional one, as in the paper;
    ``gains`` those of the fractional run (else of the first that has any), ``lyapunov`` its
    supervisor, ``comparison`` all runs. What the runs do not hold is left out.
    """
    several = as_runs(runs)
    integer = [run for run in several if is_integer(run)]
    fractional = [run for run in several if not is_integer(run)]
    drawn: dict[str, Figure] = {}
    if integer:
        drawn["fig4"] = response(integer[0], f"Integer orders: {integer[0].name}")
    if fractional:
        drawn["fig5"] = response(fractional[0], f"Fractional orders: {fractional[0].name}")
    first = [*fractional, *integer]
    for run in first:
        if has_gains(run):
            drawn["gains"] = plots.gains(run)
            break
    for run in first:
        if has_supervisor(run):
            drawn["lyapunov"] = plots.lyapunov(run)
            break
    if len(several) > 1 and len({run.q.shape[1] for run in several}) == 1:
        drawn["comparison"] = plots.comparison(several)
    return drawn
