"""Controllers beside each other: who is best where, each one's worst case, and limits passed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray, checked
from fpid_pin.control.law import Controller
from fpid_pin.costs import METRICS, Metrics, QuadraticCost
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation.entry import simulate
from fpid_pin.simulation.experiment import Experiment, of_paper
from fpid_pin.simulation.recorded import Exceedance, limit_report
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.toml import by_name
from fpid_pin.text import ReprMixin, against, enumerated, head_for, html_table, percent

COST = QuadraticCost()
#: Who is worse than the best by no more than this part ties with it.
TIE = 0.03
#: Limits of one controller that are told in a line; all of them are in the tables.
_TOLD = 3


@dataclass(frozen=True)
class Measure:
    """A figure of a run over its joints by which controllers are ranked, the less the better."""

    label: str
    head: str
    of: Callable[[Metrics], float]
    metric: str = ""  # whose it is, this many times
    scale: float = 1.0

    @property
    def unit(self) -> str:
        """What stands in the brackets of its head."""
        return self.head.partition(" [")[2].rstrip("]")

    def write(self, value: float) -> str:
        """Return a value with its unit."""
        if not np.isfinite(value):
            return "ended early"
        return f"{float(f'{value:.3g}'):g} {self.unit}".rstrip()


def _measure(metric: str, word: str, label: str = "") -> Measure:
    """Return a metric over the joints, angles in thousandths and shares in percent."""
    m = METRICS[metric]
    scale, unit = {"rad": (1e3, "mrad"), "share of time": (100.0, "%")}.get(m.unit, (1.0, m.unit))
    over = "worst joint" if m.joints == "worst" else f"{m.joints} of joints"
    head = f"{word} ({over}) [{unit}]"
    return Measure(
        label, head, lambda metrics: scale * m.of(getattr(metrics, metric)), metric, scale
    )


#: What a comparison may be decided by.
MEASURES = {
    "tail": _measure("rms_tail", "tail", "RMS error of the last half"),
    "variation": _measure("total_variation", "variation", "torque variation (sum of joints)"),
    "rms": _measure("rms", "RMS", "RMS error"),
    "peak": _measure("peak_torque", "peak", "peak torque (worst joint)"),
    "energy": _measure("energy", "energy", "energy (sum of joints)"),
    "cost": Measure(f"cost (33) with w1 = {COST.w1:g}, w2 = {COST.w2:g}", "cost (33)", COST.of),
    "peak_error": _measure("peak_error", "peak error", "peak error (worst joint)"),
}
_TAIL, _VARIATION, _COST = (MEASURES[name] for name in ("tail", "variation", "cost"))
#: All figures of a run.
_FIGURES = (
    *MEASURES.values(), _measure("settling_time", "settled"),
    _measure("saturated", "at its limit"), _measure("torque_rate", "torque rate"),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(ReprMixin):
    """Runs of every controller under every condition; printed, it says who is best where.

    Attributes
    ----------
    conditions, controllers
        Their names, C and L of them.
    runs
        C L of them: condition by condition, the controllers in their order.
    measure
        What decides; None: nothing does.
    """

    conditions: tuple[str, ...]
    controllers: tuple[str, ...]
    runs: tuple[Run, ...]
    measure: Measure | None = None

    @cached_property
    def values(self) -> FloatArray:
        """What the measure is of each run, (C, L); inf where one ended early."""
        of = self.measure.of if self.measure else lambda metrics: np.inf
        values = [of(run.metrics) if run.outcome.completed else np.inf for run in self.runs]
        return np.reshape(values, (len(self.conditions), len(self.controllers)))

    @cached_property
    def angles(self) -> set[str]:
        """The units of the joints' coordinates: ``"rad"``, ``"m"``, or both."""
        return {unit for run in self.runs for unit in run.arm.units}

    @property
    def is_best(self) -> BoolArray:
        """Where nobody is better under the same condition, and the run was completed, (C, L)."""
        least = self.values.min(axis=1, keepdims=True)
        return np.asarray(np.isfinite(self.values) & (self.values == least))

    @property
    def hardest(self) -> str:
        """The condition under which the best controller does worst; the last of those that tie."""
        least = self.values.min(axis=1)
        if self.measure is None:
            return self.conditions[0]
        return self.conditions[len(least) - 1 - int(np.argmax(least[::-1]))]

    @cached_property
    def limits(self) -> list[list[Exceedance]]:
        """What each run went beyond, by `limit_report`."""
        return [limit_report(run) for run in self.runs]

    @property
    def answer(self) -> list[str]:
        """Sentences, the most important first: the best, by condition, worst cases, limits."""
        said = []
        if self.measure is not None and len(self.controllers) > 1:
            said = [self._best(self.measure)]
            if len(self.conditions) > 1:
                said += [self._by_condition(), self._worst(self.measure)]
        return said + self._limits()

    def _ties(self, row: FloatArray) -> list[int]:
        """Return who ties with the best under a condition, itself included, the best first."""
        order = np.argsort(row, kind="stable")
        return [int(k) for k in order if row[k] <= (1.0 + TIE) * row[order[0]] < np.inf]

    def _best(self, measure: Measure) -> str:
        """Say who is best where it is hardest, over whom by how much, and what its torque costs."""
        place = self.conditions.index(self.hardest)
        row, names = self.values[place], self.controllers
        runs = self.runs[place * len(names) : (place + 1) * len(names)]
        where = f" under {self.hardest}" if len(self.conditions) > 1 else ""
        if not (ties := self._ties(row)):
            return f"Least {measure.label}{where}: nobody; all ended early."
        # To be better than: the next one, the best of another law, and what the file has first.
        rest = [int(k) for k in np.argsort(row, kind="stable") if k not in ties]
        kinds = [run.meta["controller"]["kind"] for run in runs]
        others = [k for k in rest if kinds[k] != kinds[ties[0]]][:1]
        rivals = list(dict.fromkeys([*rest[:1], *others, *(k for k in rest if k == 0)]))
        told = standing(names, row, [*map(measure.write, row)], ties, rivals, "ended early")
        text = f"Least {measure.label}{where}: {told}."
        varies = [_VARIATION.of(run.metrics) for run in runs]
        costs = {
            k: change(varies[ties[0]], varies[k], names[k])
            for k in dict.fromkeys([*ties[1:2], *others, *rest[:1]])
            if np.isfinite(row[k])
        }
        if measure.of is _VARIATION.of or not costs:
            return text
        return f"{text} Its torque varies {enumerated([*costs.values()][:2])}."

    def _by_condition(self) -> str:
        won: dict[tuple[int, ...], list[str]] = {}
        for condition, row in zip(self.conditions, self.values, strict=True):
            won.setdefault(tuple(sorted(self._ties(row))), []).append(condition)
        none = won.pop((), [])
        parts = [
            f"{enumerated([self.controllers[k] for k in ties])}{' alike' * (len(ties) > 1)} "
            f"under {enumerated(where)}"
            for ties, where in sorted(won.items(), key=lambda item: -len(item[1]))
        ]
        if none:
            parts.append(f"nobody under {enumerated(none)}, where all ended early")
        return f"Best by condition: {'; '.join(parts)}."

    def _worst(self, measure: Measure) -> str:
        worst = self.values.max(axis=0)
        parts = [
            f"{self.controllers[k]} {measure.write(float(worst[k]))} "
            f"({self.conditions[int(np.argmax(self.values[:, k]))]})"
            for k in np.argsort(worst, kind="stable")
        ]
        return f"Worst case of each: {'; '.join(parts)}."

    def _limits(self) -> list[str]:
        """Say of each controller where its runs ended early and which limits they passed."""
        told: dict[str, list[str]] = {}
        for labels, run, limits in self._each():
            where = f"{labels['condition']}, " if len(self.conditions) > 1 else ""
            lines = told.setdefault(labels["controller"], [])
            if not run.outcome.completed:
                lines.append(f"{where}{run.outcome}")
            joints: dict[str, list[str]] = {}
            for e in limits:
                joints.setdefault(e.passed, []).append(f"{e.joint} {percent(e.part)}")
            lines += [
                f"{where}{limit} limit of {enumerated(which)} of the time"
                for limit, which in joints.items()
            ]
        return [
            f"Limits passed by {controller}: {'; '.join(lines[:_TOLD])}"
            + (f"; and {len(lines) - _TOLD} more." if lines[_TOLD:] else ".")
            for controller, lines in told.items()
            if lines
        ]

    def _each(self) -> Iterator[tuple[dict[str, Any], Run, list[Exceedance]]]:
        pairs = product(self.conditions, self.controllers)
        labels = [{"condition": condition, "controller": law} for condition, law in pairs]
        return zip(labels, self.runs, self.limits, strict=True)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each run: its figures over the joints, and whether it is the best."""
        rows = []
        for (row, run, _), first in zip(self._each(), self.is_best.ravel(), strict=True):
            ended = not run.outcome.completed
            for figure in _FIGURES:
                if figure is not _COST or self._has_cost:
                    # Of those of whole runs, one that ended early has none.
                    lost = ended and figure in (_TAIL, _COST)
                    head = head_for(figure.head, self.angles)
                    row[head] = np.inf if lost else figure.of(run.metrics)
            row["outcome"] = str(run.outcome) if ended else "completed"
            rows.append(row | ({"best": "best" if first else ""} if self.measure else {}))
        return rows

    @property
    def _has_cost(self) -> bool:
        """Whether (33) says anything: away from the paper's arm it is nearly all energy."""
        return self.measure == _COST or all(of_paper(run.arm) for run in self.runs)

    @property
    def legend(self) -> str:
        """What the heads of the tables mean."""
        cost = f"; {_COST.label}" if self._has_cost else ""
        return f"tail: RMS error of the last half{cost}"

    def joint_rows(self) -> list[dict[str, Any]]:
        """Return a row for each run and joint: every metric.

        Where a column has a unit for each kind, the names of joints that slide say that they do.
        """
        return [
            labels
            | {"joint": joint if unit == "rad" else f"{joint} [m, N]"}
            | {
                head_for(metric.head, self.angles): metric.scale * getattr(run.metrics, name)[j]
                for name, metric in METRICS.items()
            }
            for labels, run, _ in self._each()
            for j, (joint, unit) in enumerate(zip(run.arm.joint_names, run.arm.units, strict=True))
        ]

    def limit_rows(self) -> list[dict[str, Any]]:
        """Return a row for each limit that a run passed, or that its torque stood at."""
        return [
            labels
            | {
                "joint": e.joint,
                "quantity": f"{e.passed} [{e.unit}]",
                "limit": e.limit,
                "first [s]": e.time,
                "worst": e.value,
                "part [%]": 100.0 * e.part,
            }
            for labels, _, limits in self._each()
            for e in limits
        ]

    def __str__(self) -> str:
        many = f"{len(self.controllers)} controllers, {len(self.conditions)} conditions"
        return "\n".join(self.answer or [many])

    def _repr_html_(self) -> str:
        rows = self.rows()
        caption = " ".join(str(self).splitlines())
        return html_table(caption, list(rows[0]), ([*row.values()] for row in rows))


@checked
def compare(
    experiments: Experiment | Mapping[str, Experiment],
    controllers: Sequence[Controller] | Mapping[str, Controller],
    metric: str | None = "tail",
    *,
    progress: ProgressCallback | None = None,
) -> Comparison:
    """Simulate every controller under every condition, and rank them.

    Parameters
    ----------
    experiments
        The conditions, by name; one experiment is called nominal.
    controllers
        By name, or with names of their own.
    metric
        What decides: ``"tail"``, ``"rms"``, ``"peak"``, ``"variation"``, ``"energy"``, ``"cost"``
        or ``"peak_error"``; None: nothing does.
    progress
        Called as the work goes on.

    Returns
    -------
    Comparison
        Printed, it says who is best where; its rows are those of ``fpid-pin compare``.

    Raises
    ------
    ArgumentError
        An unknown metric, controllers of one name, or whatever `simulate` refuses.
    """
    measure = None if metric is None else MEASURES[checks.choice("metric", metric, MEASURES)]
    if isinstance(experiments, Experiment):
        experiments = {"nominal": experiments}
    controllers = by_name(controllers)
    pairs = list(product(experiments.values(), controllers.values()))
    runs = simulate([e for e, _ in pairs], [law for _, law in pairs], progress=progress)
    if measure is not None:
        angles = {unit for e in experiments.values() for unit in e.arm.units}
        measure = replace(measure, head=head_for(measure.head, angles))
    return Comparison(tuple(experiments), tuple(controllers), tuple(runs), measure)


def standing(
    names: Sequence[str],
    values: FloatArray,
    written: Sequence[str],
    ties: Sequence[int],
    rivals: Sequence[int],
    lost: str,
) -> str:
    """Say who is best, the first of `ties`, with whom it ties, and over whom by how much.

    `values` decide and are `written` with their units; a rival whose value is not finite is `lost`.
    """
    best, *same = ties
    told = [f"{names[best]}, {written[best]}"]
    if same:
        told.append(f"a tie with {enumerated([f'{names[k]} ({written[k]})' for k in same])}")
    if rivals:
        better = [
            f"{against(values[best], values[k])} {names[k]} ({written[k]})"
            if np.isfinite(values[k])
            else f"{names[k]} {lost}"
            for k in rivals
        ]
        told.append(enumerated(better))
    return "; ".join(told)


def change(value: float, other: float, name: str) -> str:
    """Say by how much a torque varies more or less than another's."""
    if abs(value / other - 1.0) <= TIE if other else value == other:
        return f"as much as that of {name}"
    return f"{against(value, other)} that of {name}"
