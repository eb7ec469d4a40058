"""What searches leave behind: histories and results, and the cost around a controller."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import ReprMixin, html_table, listing, percent
from fpid_pin.tuning.space import BoundSpace

IntArray = NDArray[np.int64]
#: Part of the cost that the last quarter of a search saves, below which it has settled; part by
#: which the bests of its seeds differ, below which they agree.
_SETTLED, _AGREED = 0.01, 0.05
#: Generations without which nothing is said about settling.
_WINDOW = 10
#: A parameter whose move by a tenth of its range changes the cost by less does not matter.
_IDLE = 0.005


@dataclass(frozen=True, eq=False)
class History:
    """A row for each generation, G of them; a column for each seed, S.

    Attributes
    ----------
    seeds
        The seeds, in the columns' order.
    labels
        Names of the parameters sought, ``kp.0`` for joint 0.
    best
        Lowest cost in the population that survived, (G, S); (G, S, costs) where there are several.
    mean
        Mean of its finite costs, of the same shape.
    best_parameters
        Parameters of the best, (G, S, parameters); of the best by the first of several costs.
    diverged
        Candidates of this generation that diverged, (G, S).
    simulated
        Runs simulated in this generation, (G,): of candidates equal to one whose cost is known
        there is none.
    evaluations
        Candidates evaluated so far, all seeds together, (G,).
    """

    seeds: tuple[int, ...]
    labels: tuple[str, ...]
    best: FloatArray
    mean: FloatArray
    best_parameters: FloatArray
    diverged: IntArray
    simulated: IntArray
    evaluations: IntArray

    def __len__(self) -> int:
        return len(self.evaluations)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a generation and seed, for a table."""
        return [
            {"generation": g + 1, "seed": seed, "evaluations": int(self.evaluations[g])}
            | _numbered("best cost", self.best[g, s])
            | _numbered("mean cost", self.mean[g, s])
            | {"diverged": int(self.diverged[g, s])}
            | dict(zip(self.labels, self.best_parameters[g, s].tolist(), strict=True))
            for g in range(len(self))
            for s, seed in enumerate(self.seeds)
        ]

    def curves(self) -> dict[str, FloatArray]:
        """Return what a convergence plot shows, (G,) each: best of each seed, and their mean."""
        best, mean = (x if x.ndim == 2 else x[..., 0] for x in (self.best, self.mean))
        if len(self.seeds) == 1:
            return {"best": best[:, 0], "population mean": mean[:, 0]}
        named = {f"seed {seed}": best[:, s] for s, seed in enumerate(self.seeds)}
        return named | {"population mean": mean.mean(axis=1)}


def _numbered(name: str, value: Any) -> dict[str, float]:
    values = np.atleast_1d(value).tolist()
    return {name + f" {k}" * (len(values) > 1): v for k, v in enumerate(values)}


@dataclass(frozen=True, eq=False)
class Profile:
    """Costs along each parameter in turn.

    Attributes
    ----------
    labels
        Of the parameters, as in `History`.
    values, costs
        (parameters, K); +inf where the run diverges.
    nudged
        (parameters, 2): the cost with the parameter a tenth of its range lower and higher, or at
        its bound where that is nearer.
    cost
        The controller's own.
    """

    labels: tuple[str, ...]
    values: FloatArray
    costs: FloatArray
    nudged: FloatArray
    cost: float

    @property
    def rises(self) -> FloatArray:
        """By what part of the cost it rises when a parameter moves a tenth of its range, at most.

        (parameters,); about 0: the parameter could be left out of the search.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            rises = self.nudged.max(axis=1) / self.cost - 1.0
        return np.where(np.isnan(rises), 0.0, rises)  # costs of 0 all along

    @property
    def advice(self) -> list[str]:
        """Which parameters matter, the most first, and which do not; one sentence each."""
        rises = self.rises
        order = np.argsort(-rises, kind="stable")
        told = [percent(r) if np.isfinite(r) else "divergence" for r in rises]
        found = {
            "What a tenth of its range costs": [
                f"{self.labels[k]} ({told[k]})" for k in order if not rises[k] < _IDLE
            ][:5],
            "Hardly matters": [self.labels[k] for k in order if rises[k] < _IDLE],
        }
        return [f"{head}: {', '.join(names)}." for head, names in found.items() if names]


@dataclass(frozen=True, eq=False)
class CostMap:
    """Costs of orders that all joints share.

    Attributes
    ----------
    integral_orders, derivative_orders
        lambda, (L,), and mu, (M,).
    costs
        (L, M); +inf where the run diverges.
    """

    integral_orders: FloatArray
    derivative_orders: FloatArray
    costs: FloatArray

    @property
    def best(self) -> tuple[float, float]:
        """(lambda, mu) of the lowest cost on the grid."""
        i, j = divmod(int(np.argmin(self.costs)), self.costs.shape[1])
        return float(self.integral_orders[i]), float(self.derivative_orders[j])


@dataclass(frozen=True, eq=False, repr=False)
class TuningResult(ReprMixin):
    """The best of a search, and how it came about.

    Attributes
    ----------
    controller, cost
        The best of all seeds, or the controller that the search started from.
    start_cost
        The cost of that; +inf where it diverges.
    space
        What was sought, on the controller that the search started from: its ``labels``, and their
        bounds ``low`` and ``high``.
    controllers, costs
        The best of each seed, and its cost, (S,).
    history
        Generation by generation.
    evaluations, simulations
        Candidates evaluated, and runs simulated for them; fewer where candidates were equal, more
        where each goes through several experiments.
    """

    controller: Controller
    cost: float
    start_cost: float
    space: BoundSpace
    controllers: tuple[Controller, ...]
    costs: FloatArray
    history: History
    evaluations: int
    simulations: int

    @property
    def parameters(self) -> Mapping[str, float | FloatArray]:
        """What was sought, at the best: by name, floats where shared, else (n,)."""
        return self.space.parameters(self.controller)

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Labels of what lies at a bound of the space, or within a hundredth of its range."""
        point = self.space.nearest(self.controller)
        near = np.minimum(point, 1.0 - point) < 0.01
        return tuple(label for label, here in zip(self.space.labels, near, strict=True) if here)

    @property
    def within(self) -> bool:
        """Whether the best lies in the space: a start that was not beaten may be outside."""
        try:
            self.space.point(self.controller)
        except ArgumentError:
            return False
        return True

    def rows(self, along: Profile | None = None) -> list[dict[str, Any]]:
        """Return one row a parameter: at the start, tuned, its range, and whether at a bound.

        With a `profile` of the best, also by how much the cost rises over a tenth of the range.
        """
        space, at_bounds = self.space, self.at_bounds
        columns: dict[str, Any] = {
            "parameter": space.labels,
            "start": space.numbers(space.base).tolist(),
            "tuned": space.numbers(self.controller).tolist(),
            "low": space.low.tolist(),
            "high": space.high.tolist(),
        }
        if along is not None:
            columns["a tenth of the range costs [%]"] = (100.0 * along.rises).tolist()
        columns["at a bound"] = ["yes" if x in at_bounds else "no" for x in space.labels]
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    @property
    def mean(self) -> float:
        """Mean over the seeds of their best cost."""
        return float(np.mean(self.costs))

    @property
    def spread(self) -> float:
        """Standard deviation over the seeds of their best cost; 0 for a single seed."""
        return float(np.std(self.costs, ddof=1)) if len(self.costs) > 1 else 0.0

    @property
    def gain(self) -> float:
        """The part of the start's cost that was saved, 0 to 1; 1 where the start diverges."""
        if not np.isfinite(self.start_cost):
            return 1.0 if np.isfinite(self.cost) else 0.0
        return 1.0 - self.cost / self.start_cost if self.start_cost > 0.0 else 0.0

    @property
    def late_gain(self) -> float:
        """The part of the best cost that the last quarter of the generations saved, 10 at least.

        NaN where there have not been so many.
        """
        best = self.history.best.min(axis=1)
        window = max(len(best) // 4, _WINDOW)
        if len(best) <= window:
            return float("nan")
        before = float(best[-window - 1])
        return 1.0 - float(best[-1]) / before if 0.0 < before < np.inf else 0.0

    @property
    def advice(self) -> list[str]:
        """What was gained, and whether to go on; one sentence each."""
        start = f"{self.start_cost:.4g}" if np.isfinite(self.start_cost) else "a run that diverges"
        lines = [f"From {start} to {self.cost:.4g}: {percent(self.gain)} less than the start."]
        if self.cost >= self.start_cost:
            lines = [f"The start, {start}, was not improved on: widen the space or search longer."]
        if self.at_bounds:
            lines.append(f"At a bound: {', '.join(self.at_bounds)}; a wider space may cost less.")
        if np.isnan(self.late_gain):
            lines.append(f"Only {len(self.history)} generations: go on (more of them, and resume).")
        elif self.late_gain > _SETTLED:
            lines.append(
                f"The last quarter of the generations saved {percent(self.late_gain)}: go on "
                "(more generations, and resume)."
            )
        elif self.spread > _AGREED * abs(self.mean):
            lines.append(
                f"The seeds differ by {percent(self.spread / abs(self.mean))}: the search has "
                "settled, but in several places; try more seeds or a larger population."
            )
        else:
            lines.append("The search has settled: more generations will hardly help.")
        return lines

    @property
    def summary(self) -> str:
        """The cost that was found, how many seeds agree on it, and after how many candidates."""
        seeds = len(self.costs)
        about = f"{seeds} seeds: {self.mean:.6g} +- {self.spread:.2g}" if seeds > 1 else "1 seed"
        return f"cost {self.cost:.6g} ({about}; {self.evaluations} evaluations)"

    def __str__(self) -> str:
        return listing(
            self.summary, ((k, np.asarray(v).tolist(), "") for k, v in self.parameters.items())
        )

    def _repr_html_(self) -> str:
        rows = self.rows()
        told = " ".join([self.summary, *self.advice])
        return html_table(told, list(rows[0]), [list(row.values()) for row in rows])


@dataclass(frozen=True, eq=False, repr=False)
class ParetoResult(ReprMixin):
    """Controllers of which none is better than another in every cost.

    Attributes
    ----------
    controllers
        K of them, by rising first cost.
    costs
        (K, costs).
    parameters
        (K, parameters), named by ``history.labels``.
    history
        Generation by generation.
    evaluations, simulations
        As in `TuningResult`.
    """

    controllers: tuple[Controller, ...]
    costs: FloatArray
    parameters: FloatArray
    history: History
    evaluations: int
    simulations: int

    def __len__(self) -> int:
        return len(self.controllers)

    def __str__(self) -> str:
        several = self.costs.shape[1]
        title = f"{len(self)} controllers, {several} costs ({self.evaluations} evaluations)"
        rows = []
        for k, j in enumerate(np.argmin(self.costs, axis=0)):
            found = dict(zip(self.history.labels, self.parameters[j].tolist(), strict=True))
            rows.append((f"least cost {k + 1}, {self.costs[j, k]:.4g}", found, ""))
        return listing(title, rows)

    def _repr_html_(self) -> str:
        head = [f"cost {k + 1}" for k in range(self.costs.shape[1])] + list(self.history.labels)
        return html_table(
            str(self).splitlines()[0], head, np.column_stack([self.costs, self.parameters]).tolist()
        )
