"""Runs beside each other: tables of them, who is best where, each one's worst case, and limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.cli.output import file_names
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.table import Row
from fpid_pin.control import Controller
from fpid_pin.costs import Metrics, QuadraticCost, over_joints
from fpid_pin.simulation import Experiment, Run, limit_report, simulate
from fpid_pin.simulation.limits import Exceedance

COST = QuadraticCost()
#: What the heads of the tables mean.
LEGEND = f"tail: RMS error of the last half; cost: (33) with w1 = {COST.w1:g}, w2 = {COST.w2:g}"
#: Limits of one controller that are told in a line; all of them are in the tables.
_TOLD = 3
#: Columns of each joint, by the metric and a factor.
_JOINT_COLUMNS = {
    "RMS [rad]": ("rms", 1.0), "RMS tail [rad]": ("rms_tail", 1.0), "ISE [rad^2 s]": ("ise", 1.0),
    "IAE [rad s]": ("iae", 1.0), "ITAE [rad s^2]": ("itae", 1.0),
    "energy [N²m²s]": ("energy", 1.0), "variation [N m]": ("total_variation", 1.0),
    "peak torque [N m]": ("peak_torque", 1.0), "peak error [rad]": ("peak_error", 1.0),
    "settled [s]": ("settling_time", 1.0), "overshoot [rad]": ("overshoot", 1.0),
    "at its limit [%]": ("saturated", 100.0), "torque rate [N m/s]": ("torque_rate", 1.0),
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A run with its place in a comparison, and the name of its file."""

    condition: str
    controller: str
    run: Run
    file: str

    @cached_property
    def limits(self) -> list[Exceedance]:
        """What its run went beyond: tables and sentences ask for it, and it is looked for once."""
        return limit_report(self.run)


def simulate_pairs(
    experiments: Mapping[str, Experiment],
    controllers: Mapping[str, Controller],
    taken: Sequence[str] = (),
) -> list[Entry]:
    """Simulate every controller under every condition, both by name.

    Each run has a file name of its own, none of those that are `taken` already.
    """
    pairs = [(condition, label) for condition in experiments for label in controllers]
    many = len(experiments) > 1
    files = file_names([pair if many else pair[1:] for pair in pairs], taken=taken)
    with progress_bar(f"simulating {len(pairs)} run{'s' * (len(pairs) > 1)}") as progress:
        runs = simulate(
            [experiments[condition] for condition, _ in pairs],
            [controllers[label] for _, label in pairs],
            progress=progress,
        )
    each = zip(pairs, runs, files, strict=True)
    return [Entry(*pair, run, f"{file}.npz") for pair, run, file in each]


# ------------------------------------------------------------------ who is best


@dataclass(frozen=True)
class Measure:
    """A figure of a run over its joints by which controllers are ranked, the less the better."""

    label: str
    head: str
    of: Callable[[Metrics], float]

    @property
    def unit(self) -> str:
        """What stands in the brackets of its head."""
        return self.head.partition(" [")[2].rstrip("]")

    def write(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.3g} {self.unit}".rstrip() if np.isfinite(value) else "ended early"


def _joints(metric: str, how: str, factor: float = 1.0) -> Callable[[Metrics], float]:
    return lambda metrics: factor * over_joints(getattr(metrics, metric), how)


#: What `compare --metric` may name.
MEASURES = {
    "tail": Measure(
        "RMS error of the last half", "tail (all joints) [mrad]", _joints("rms_tail", "rms", 1e3)
    ),
    "rms": Measure("RMS error", "RMS (all joints) [mrad]", _joints("rms", "rms", 1e3)),
    "peak": Measure(
        "peak torque (worst joint)", "peak (worst joint) [N m]", _joints("peak_torque", "worst")
    ),
    "variation": Measure(
        "torque variation (all joints)", "variation (all joints) [N m]",
        _joints("total_variation", "sum"),
    ),
    "energy": Measure(
        "energy (all joints)", "energy (all joints) [N²m²s]", _joints("energy", "sum")
    ),
    "cost": Measure(f"cost (33) with w1 = {COST.w1:g}, w2 = {COST.w2:g}", "cost (33)", COST.of),
    "peak_error": Measure(
        "peak error (worst joint)", "peak error (worst joint) [mrad]",
        _joints("peak_error", "worst", 1e3),
    ),
}  # fmt: skip
#: All figures of a run, by their heads.
FIGURES = {measure.head: measure.of for measure in MEASURES.values()} | {
    "settled (worst joint) [s]": _joints("settling_time", "worst"),
    "at its limit (worst joint) [%]": _joints("saturated", "worst", 100.0),
    "torque rate (worst joint) [N m/s]": _joints("torque_rate", "worst"),
}
#: Those that a screen has room for, and those that are infinite where a run ended early.
_ON_SCREEN, _OF_WHOLE_RUNS = list(FIGURES)[:6], ("tail (all joints) [mrad]", "cost (33)")


@dataclass(frozen=True, eq=False)
class Ranking:
    """Every controller's figure under every condition."""

    measure: Measure
    conditions: tuple[str, ...]
    controllers: tuple[str, ...]
    values: FloatArray  # (conditions, controllers); inf where a run ended early

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

    @property
    def best(self) -> str:
        """A sentence: who is best under which condition."""
        won: dict[str, list[str]] = {}
        for condition, row in zip(self.conditions, self.values, strict=True):
            first = int(np.argmin(row))
            won.setdefault(self.controllers[first] if np.isfinite(row[first]) else "", []).append(
                condition
            )
        none = won.pop("", [])
        if len(self.conditions) == 1 and won:
            first, second = np.argsort(self.values[0], kind="stable")[:2]
            parts = [
                f"{before}{self.controllers[k]}, {self.measure.write(self.values[0, k])}"
                for before, k in (("", first), ("next ", second))
            ]
        else:
            ahead = sorted(won.items(), key=lambda item: -len(item[1]))
            parts = [f"{controller} under {_listed(where)}" for controller, where in ahead]
        if none:
            parts.append(f"nobody under {_listed(none)}, where all ended early")
        return f"Least {self.measure.label}: {'; '.join(parts)}."

    @property
    def worst(self) -> str:
        """A sentence: each controller's worst case."""
        worst = self.values.max(axis=0)
        parts = [
            f"{self.controllers[k]} {self.measure.write(float(worst[k]))} "
            f"({self.conditions[int(np.argmax(self.values[:, k]))]})"
            for k in np.argsort(worst, kind="stable")
        ]
        return f"Worst case of each: {'; '.join(parts)}."


def rank(entries: Sequence[Entry], measure: Measure) -> Ranking:
    """Rank the runs of a comparison."""
    conditions = tuple(dict.fromkeys(entry.condition for entry in entries))
    controllers = tuple(dict.fromkeys(entry.controller for entry in entries))
    values = np.full((len(conditions), len(controllers)), np.inf)
    for e in entries:
        if e.run.outcome.completed:
            place = conditions.index(e.condition), controllers.index(e.controller)
            values[place] = measure.of(e.run.metrics)
    return Ranking(measure, conditions, controllers, values)


def answer(entries: Sequence[Entry], ranking: Ranking) -> list[str]:
    """Return what a comparison of several controllers says, the most important first."""
    said = [ranking.best] if len(ranking.controllers) > 1 else []
    said += [ranking.worst] if said and len(ranking.conditions) > 1 else []
    return said + limit_lines(entries)


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def limit_lines(entries: Sequence[Entry]) -> list[str]:
    """Return, for each controller, where its runs ended early and which limits they passed."""
    told: dict[str, list[str]] = {}
    several = len({entry.condition for entry in entries}) > 1
    for entry in entries:
        where = f"{entry.condition}, " if several else ""
        lines = told.setdefault(entry.controller, [])
        if not entry.run.outcome.completed:
            lines.append(f"{where}{entry.run.outcome}")
        joints: dict[str, list[str]] = {}
        for e in entry.limits:
            joints.setdefault(e.quantity, []).append(f"{e.joint} {100.0 * e.part:.2g} %")
        lines += [
            f"{where}{quantity} limit of {_listed(which)} of the time"
            for quantity, which in joints.items()
        ]
    return [
        f"Limits passed by {controller}: {'; '.join(lines[:_TOLD])}"
        + (f"; and {len(lines) - _TOLD} more." if lines[_TOLD:] else ".")
        for controller, lines in told.items()
        if lines
    ]


# ------------------------------------------------------------------ tables


def run_rows(entries: Sequence[Entry], ranking: Ranking | None = None) -> list[Row]:
    """Return one row a run, its `FIGURES`; the best of a ranking are marked."""
    rows = []
    for entry in entries:
        m, ended = entry.run.metrics, not entry.run.outcome.completed
        row: Row = {"condition": entry.condition, "controller": entry.controller}
        for head, figure in FIGURES.items():
            row[head] = np.inf if ended and head in _OF_WHOLE_RUNS else figure(m)
        row["outcome"] = str(entry.run.outcome) if ended else "completed"
        row["file"] = entry.file
        if ranking is not None:
            row["best"] = "best" if ranking.is_best(entry.condition, entry.controller) else ""
        rows.append(row)
    return rows


def screen_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the columns of `run_rows` that a screen has room for."""
    heads = ["condition", "controller", *_ON_SCREEN, "best"]
    return [{head: row[head] for head in heads if head in row} for row in rows]


def joint_rows(entries: Sequence[Entry]) -> list[Row]:
    """Return one row a run and joint, every metric.

    A column's [rad] and [N m] are [m] and [N] of a joint that slides, whose name says so.
    """
    return [
        {
            "condition": entry.condition,
            "controller": entry.controller,
            "joint": joint if unit == "rad" else f"{joint} [m, N]",
        }
        | {
            head: factor * getattr(entry.run.metrics, name)[j]
            for head, (name, factor) in _JOINT_COLUMNS.items()
        }
        for entry in entries
        for j, (joint, unit) in enumerate(
            zip(entry.run.arm.joint_names, entry.run.arm.units, strict=True)
        )
    ]


def limit_rows(entries: Sequence[Entry]) -> list[Row]:
    """Return one row a limit that a run passed, or that its torque stood at."""
    return [
        {
            "condition": entry.condition,
            "controller": entry.controller,
            "joint": e.joint,
            "quantity": f"{e.quantity} [{e.unit}]",
            "limit": e.limit,
            "first [s]": e.time,
            "worst": e.value,
            "part [%]": 100.0 * e.part,
        }
        for entry in entries
        for e in entry.limits
    ]
