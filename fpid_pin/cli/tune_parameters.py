"""What a search says of each parameter: where it was and is, and whether it matters."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.summary import Row
from fpid_pin.cli.tune_plan import Plan
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import Profile, TuningResult, profile
from fpid_pin.tuning.space import BoundSpace

#: A parameter whose move by a tenth of its range changes the cost by less does not matter.
_IDLE = 0.005


def explore(plan: Plan, result: TuningResult, pool: Executor | None) -> Profile | None:
    """Find the cost along each parameter; None where that is not wanted, or the start was kept."""
    bound = _bound(plan)
    try:
        bound.point(result.controller)
    except ArgumentError:
        return None  # The start was kept, and lies outside of the space.
    if not plan.profile_points:
        return None
    count = bound.size * (plan.profile_points + 2)
    with progress_bar(f"profile, {count} candidates") as progress:
        return profile(
            list(plan.experiments.values()), result.controller, plan.space, plan.cost,
            points=plan.profile_points, executor=pool, progress=progress,
        )  # fmt: skip


def parameter_rows(plan: Plan, result: TuningResult, along: Profile | None) -> list[Row]:
    """Return one row a parameter: at the start, tuned, its range, what it matters."""
    bound = _bound(plan)
    rows: list[Row] = []
    start, tuned = (bound.settings(c) for c in (plan.controller, result.controller))
    for k, label in enumerate(bound.labels):
        row: Row = {
            "parameter": label,
            "start": float(start[k]),
            "tuned": float(tuned[k]),
            "low": float(bound.low[k]),
            "high": float(bound.high[k]),
        }
        if along is not None:
            row["a tenth of the range costs [%]"] = 100.0 * float(along.rises[k])
        row["at a bound"] = "yes" if label in result.at_bounds else "no"
        rows.append(row)
    return rows


def what_mattered(along: Profile | None) -> list[str]:
    """Say which parameters mattered, the most first, and which did not."""
    if along is None:
        return []
    order = np.argsort(-along.rises, kind="stable")
    mattered = [k for k in order if not along.rises[k] < _IDLE]
    idle = [along.labels[k] for k in order if along.rises[k] < _IDLE]
    lines = []
    if mattered:
        parts = []
        for k in mattered[:5]:
            rise = along.rises[k]
            told = f"{100.0 * rise:.2g} %" if np.isfinite(rise) else "divergence"
            parts.append(f"{along.labels[k]} ({told})")
        lines.append(f"What a tenth of its range costs: {', '.join(parts)}.")
    if idle:
        lines.append(f"Hardly matters: {', '.join(idle)}.")
    return lines


def _bound(plan: Plan) -> BoundSpace:
    return plan.space.bind(plan.controller, next(iter(plan.experiments.values())).arm.n)
