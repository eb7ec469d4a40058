"""What a comparison says: who is best under which condition, each one's worst case, and limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.costs import Metrics, QuadraticCost

if TYPE_CHECKING:
    from fpid_pin.cli.summary import Entry

COST = QuadraticCost()


@dataclass(frozen=True)
class Measure:
    """A figure of merit by which controllers are ranked, the less the better."""

    label: str
    unit: str
    of: Callable[[Metrics], float]

    def value(self, entry: Entry) -> float:
        """Return a run's figure; inf where it ended early."""
        run = entry.run
        return self.of(run.metrics) if run.outcome.completed else float("inf")

    def write(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.3g} {self.unit}".rstrip() if np.isfinite(value) else "ended early"


def over_joints(rms: FloatArray) -> float:
    """Return the root mean square over the joints of their RMS errors [rad], in mrad."""
    return 1e3 * float(np.sqrt(np.mean(rms**2)))


#: What `compare --metric` may name.
MEASURES = {
    "tail": Measure("RMS error of the last half", "mrad", lambda m: over_joints(m.rms_tail)),
    "rms": Measure("RMS error", "mrad", lambda m: over_joints(m.rms)),
    "peak_error": Measure(
        "peak error (worst joint)", "mrad", lambda m: 1e3 * float(m.peak_error.max())
    ),
    "cost": Measure(f"cost (33) with w1 = {COST.w1:g}, w2 = {COST.w2:g}", "", COST.of),
    "energy": Measure("energy (all joints)", "N²m²s", lambda m: float(m.energy.sum())),
    "variation": Measure(
        "torque variation (all joints)", "N m", lambda m: float(m.total_variation.sum())
    ),
    "peak": Measure("peak torque (worst joint)", "N m", lambda m: float(m.peak_torque.max())),
}


#: What the heads of the tables mean.
LEGEND = f"tail: RMS error of the last half; cost: (33) with w1 = {COST.w1:g}, w2 = {COST.w2:g}"


@dataclass(frozen=True, eq=False)
class Ranking:
    """Every controller's figure under every condition.

    Attributes
    ----------
    measure
        What is ranked by.
    conditions, controllers
        Names.
    values
        (conditions, controllers); inf where a run ended early.
    """

    measure: Measure
    conditions: tuple[str, ...]
    controllers: tuple[str, ...]
    values: FloatArray

    def order(self, condition: int) -> list[int]:
        """Return the controllers from the best to the worst under a condition."""
        return [int(k) for k in np.argsort(self.values[condition], kind="stable")]

    def is_best(self, condition: str, controller: str) -> bool:
        """Return whether nobody is better there, and the run was completed."""
        row = self.values[self.conditions.index(condition)]
        value = row[self.controllers.index(controller)]
        return bool(np.isfinite(value) and value == row.min())

    @property
    def hardest(self) -> int:
        """The condition under which the best controller does worst; the last of those that tie."""
        least = self.values.min(axis=1)
        return len(least) - 1 - int(np.argmax(least[::-1]))


def rank(entries: Sequence[Entry], measure: Measure) -> Ranking:
    """Rank the runs of a comparison."""
    conditions = tuple(dict.fromkeys(entry.condition for entry in entries))
    controllers = tuple(dict.fromkeys(entry.controller for entry in entries))
    values = np.full((len(conditions), len(controllers)), np.inf)
    for entry in entries:
        place = conditions.index(entry.condition), controllers.index(entry.controller)
        values[place] = measure.value(entry)
    return Ranking(measure, conditions, controllers, values)


def answer(entries: Sequence[Entry], ranking: Ranking) -> list[str]:
    """Return what a comparison of several controllers says, the most important first."""
    if len(ranking.controllers) < 2:
        return limit_lines(entries)
    worst = [_worst(ranking)] if len(ranking.conditions) > 1 else []
    return [_best(ranking), *worst, *limit_lines(entries)]


def _best(ranking: Ranking) -> str:
    won: dict[str, list[str]] = {}
    none = []
    for c, condition in enumerate(ranking.conditions):
        first = ranking.order(c)[0]
        if np.isfinite(ranking.values[c, first]):
            won.setdefault(ranking.controllers[first], []).append(condition)
        else:
            none.append(condition)
    if len(ranking.conditions) == 1 and won:
        first, second = ranking.order(0)[:2]
        value, following = (ranking.measure.write(ranking.values[0, k]) for k in (first, second))
        names = ranking.controllers
        best = f"{names[first]}, {value}; next {names[second]}, {following}"
        return f"Least {ranking.measure.label}: {best}."
    ahead = sorted(won.items(), key=lambda item: -len(item[1]))
    parts = [f"{controller} under {_listed(where)}" for controller, where in ahead]
    if none:
        parts.append(f"nobody under {_listed(none)}, where all ended early")
    return f"Least {ranking.measure.label}: {'; '.join(parts)}."


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def _worst(ranking: Ranking) -> str:
    worst = ranking.values.max(axis=0)
    parts = []
    for k in np.argsort(worst, kind="stable"):
        where = ranking.conditions[int(np.argmax(ranking.values[:, k]))]
        told = ranking.measure.write(float(worst[k]))
        parts.append(f"{ranking.controllers[k]} {told} ({where})")
    return f"Worst case of each: {'; '.join(parts)}."


def limit_lines(entries: Sequence[Entry]) -> list[str]:
    """Return, for each controller, where its runs ended early and which limits they passed."""
    lines = []
    several = len({entry.condition for entry in entries}) > 1
    for controller in dict.fromkeys(entry.controller for entry in entries):
        told = []
        for entry in entries:
            if entry.controller != controller:
                continue
            where = f"{entry.condition}, " if several else ""
            outcome = entry.run.outcome
            if not outcome.completed:
                told.append(f"{where}{outcome}")
            joints: dict[str, list[str]] = {}
            for e in entry.limits:
                joints.setdefault(e.quantity, []).append(f"{e.joint} {100.0 * e.part:.2g} %")
            told += [
                f"{where}{quantity} limit of {_listed(which)} of the time"
                for quantity, which in joints.items()
            ]
        if told:
            more = f"; and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
            lines.append(f"Limits passed by {controller}: {'; '.join(told[:_TOLD])}{more}.")
    return lines


#: Limits of one controller that are told in a line; all of them are in the tables.
_TOLD = 3
