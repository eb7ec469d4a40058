"""Figures of tuning: cost maps and convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.view.style import lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKS = "o*DsP^v"


@styled
def cost_map(
    orders_lambda: ArrayLike,
    orders_mu: ArrayLike,
    costs: ArrayLike,
    marks: Mapping[str, Sequence[float]] | None = None,
) -> Figure:
    """Draw the cost over the plane of the orders, on a logarithmic scale.

    Parameters
    ----------
    orders_lambda, orders_mu
        Integral orders (L,) and derivative orders (M,), increasing.
    costs
        (L, M), positive; inf or NaN where a run diverged, drawn hatched.
    marks
        Points to point out, ``{"label": (lambda, mu)}``.

    Raises
    ------
    ArgumentError
        Shapes that do not fit, or no finite cost at all.
    """
    from matplotlib.colors import LogNorm

    x = checks.floats("orders_lambda", orders_lambda, max_ndim=1)
    y = checks.floats("orders_mu", orders_mu, max_ndim=1)
    z = np.asarray(costs, dtype=np.float64)
    if z.shape != (x.size, y.size):
        raise ArgumentError("costs", f"shape ({x.size}, {y.size})", f"shape {z.shape}")
    sound = np.isfinite(z) & (z > 0.0)
    if not sound.any():
        raise ArgumentError("costs", "at least one finite positive cost", "none")
    rows = (len(marks or {}) + 1) // 2
    figure, (panel,) = new_figure(1, 1, 5.2, 4.2 + 0.25 * rows)
    low, high = float(z[sound].min()), float(z[sound].max())
    norm = LogNorm(low, max(high, low * 1.01))
    shown = np.ma.masked_where(~sound, z)
    # A patch behind shows through where there is no cost.
    panel.patch.set(hatch="///", edgecolor="#b0b0b0", facecolor="white")
    mesh = panel.pcolormesh(x, y, shown.T, norm=norm, shading="nearest", cmap="cividis")
    figure.colorbar(mesh, ax=panel, label="cost")
    for k, (label, point) in enumerate((marks or {}).items()):
        panel.plot(
            float(point[0]), float(point[1]), _MARKS[k % len(_MARKS)], color="#D55E00",
            markeredgecolor="white", markersize=9, label=lettering(label), linestyle="none",
        )  # fmt: skip
    if marks:
        # Below the map: beside or above it, long names would squeeze it.
        figure.legend(loc="outside lower center", ncols=2)
    panel.grid(False)
    title = "" if sound.all() else "hatched: diverged"
    panel.set(xlabel=r"integral order $\lambda$", ylabel=r"derivative order $\mu$")
    panel.set_title(title, loc="right", fontweight="normal", fontsize=8)
    return figure


@styled
def convergence(history: ArrayLike | Mapping[str, ArrayLike]) -> Figure:
    """Draw cost over generations.

    Parameters
    ----------
    history
        The best cost of each generation, (G,), or several such curves by name
        (``{"best": ..., "median": ...}``). What is not finite leaves a gap.

    Raises
    ------
    ArgumentError
        No curve, or one without a finite cost.
    """
    from matplotlib.ticker import MaxNLocator

    curves = history if isinstance(history, Mapping) else {"best": history}
    if not curves:
        raise ArgumentError("history", "at least one curve", "none")
    figure, (panel,) = new_figure(1, 1, 5.6, 3.2)
    positive = True
    for (name, values), dash in zip(curves.items(), ("-", "--", ":", "-.") * 8, strict=False):
        costs = np.atleast_1d(np.asarray(values, dtype=np.float64))
        if costs.ndim != 1 or not np.isfinite(costs).any():
            raise ArgumentError(f"history.{name}", "a row of costs, some finite", f"{costs!r}")
        positive &= bool((costs[np.isfinite(costs)] > 0.0).all())
        shown = np.where(np.isfinite(costs), costs, np.nan)
        generations = np.arange(1, costs.size + 1)
        panel.plot(
            generations, shown, dash, label=lettering(name), marker="." if costs.size < 30 else ""
        )
    if positive:
        panel.set_yscale("log")
    panel.set(xlabel="generation", ylabel="cost")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    if len(curves) > 1:
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(curves))
    return figure


@styled
def profile(labels: Sequence[str], values: FloatArray, costs: FloatArray, best: float) -> Figure:
    """Draw the cost along each parameter in turn, all others held.

    Parameters
    ----------
    labels
        Of the parameters.
    values, costs
        (parameters, K); +inf where a run diverges.
    best
        The cost of the controller itself: the dotted line.
    """
    columns = min(len(labels), 4)
    rows = -(-len(labels) // columns)
    size = 1.9 * columns + 0.8, 1.6 * rows + 0.5
    figure, panels = new_figure(rows, columns, *size, count=len(labels), share_x=False)
    finite = costs[np.isfinite(costs)]
    top = min(max(float(finite.max(initial=best)), 1.1 * best), 10.0 * best)
    for k, (panel, label, x, y) in enumerate(zip(panels, labels, values, costs, strict=True)):
        panel.plot(x, np.where(y <= top, y, np.nan), ".-")
        panel.axhline(best, color="#D55E00", linestyle=":")
        panel.set(ylim=(0.0, 1.05 * top), title=lettering(label))
        if k % columns:
            panel.tick_params(labelleft=False)
        else:
            panel.set_ylabel("cost")
    return figure
