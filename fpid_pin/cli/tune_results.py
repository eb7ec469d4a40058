"""What a search is worth: the tuned controller beside its rivals, and the folder of results."""

from __future__ import annotations

import dataclasses
import os
import tomllib
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.arms import Arm
from fpid_pin.cli import summary
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.keep import Keep
from fpid_pin.cli.names import file_names
from fpid_pin.cli.pairs import simulate_pairs
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.summary import Entry, Row
from fpid_pin.cli.tune_parameters import parameter_rows, what_mattered
from fpid_pin.cli.tune_plan import Plan
from fpid_pin.control import AdaptiveFpid, Controller
from fpid_pin.extras import installed
from fpid_pin.simulation import cost_of
from fpid_pin.simulation.paper import PUBLISHED_ORDERS, of_paper
from fpid_pin.tuning import Profile, TuningResult, cost_map
from fpid_pin.tuning.robust import over_scenarios

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: File names, without their ending, that are given in a folder of results.
TAKEN = ("checkpoint",)
_TUNED, _AS_CONFIGURED = "tuned", "as configured"
_PUBLISHED, _INTEGER = "published orders", "integer orders"


def _named(controller: Controller, name: str, **changes: object) -> Controller:
    if hasattr(controller, "name"):
        changes["name"] = name
    return cast("Controller", dataclasses.replace(cast("Any", controller), **changes))


def _rivals(plan: Plan, result: TuningResult) -> dict[str, Controller]:
    """Return the tuned controller and, by other labels, those it has to be better than."""
    base = plan.controller
    label = getattr(base, "name", "") or getattr(type(base), "_kind", "") or _AS_CONFIGURED
    if isinstance(base, AdaptiveFpid) and not base.name:
        label = _AS_CONFIGURED
    elif label in (_TUNED, _PUBLISHED, _INTEGER):
        # As one that was tuned before is called, by its tuned.toml.
        label = f"{label}, as configured"
    rivals = {_TUNED: result.controller, label: _named(base, label)}
    if not isinstance(base, AdaptiveFpid):
        return rivals
    arm = next(iter(plan.experiments.values())).arm
    n = arm.n
    here = [
        checks.per_joint(name, getattr(base, name), n).tolist()
        for name in ("integral_order", "derivative_order")
    ]
    published, integer = PUBLISHED_ORDERS["symbol"], ((1.0,) * n, (1.0,) * n)
    for name, orders in ((_PUBLISHED, published), (_INTEGER, integer)):
        if (name == _INTEGER or of_paper(arm)) and here != [list(order) for order in orders]:
            rivals[name] = _named(base, name, integral_order=orders[0], derivative_order=orders[1])
    return rivals


def compare(plan: Plan, result: TuningResult) -> list[Entry]:
    """Simulate the tuned controller and its rivals under every condition."""
    return simulate_pairs(plan.experiments, _rivals(plan, result), TAKEN)


def draw(
    plan: Plan, result: TuningResult, along: Profile | None, pool: Executor | None
) -> dict[str, Figure]:
    """Draw convergence, the profile and, for a law with orders, the cost map."""
    from fpid_pin.view import plots

    figures = {"convergence": plots.convergence(result.history.curves())}
    if along is not None:
        figures["profile"] = plots.profile(along.labels, along.values, along.costs, along.cost)
    if plan.map_points:
        grid = np.linspace(0.0, 1.0, plan.map_points) if plan.map_points > 1 else [1.0]
        with progress_bar(f"cost map, {plan.map_points**2} candidates") as progress:
            found = cost_map(
                list(plan.experiments.values()),
                result.controller,
                plan.cost,
                integral_orders=grid,
                derivative_orders=grid,
                executor=pool,
                progress=progress,
            )
        arm = next(iter(plan.experiments.values())).arm
        figures["cost-map"] = plots.cost_map(
            found.integral_orders, found.derivative_orders, found.costs, _marks(result, arm)
        )
    return figures


def _marks(result: TuningResult, arm: Arm) -> dict[str, Sequence[float]]:
    """Return what the map points out: ours, on its own arm the paper's, and integer corners."""
    n = arm.n
    law = cast("AdaptiveFpid", result.controller)
    tuned = [
        checks.per_joint("order", order, n) for order in (law.integral_order, law.derivative_order)
    ]
    marks: dict[str, Sequence[float]] = {}
    if n == 2 and any(order[0] != order[1] for order in tuned):
        marks = {f"tuned, joint {j + 1}": [float(o[j]) for o in tuned] for j in range(n)}
    else:
        name = "tuned" if n == 1 else "tuned (mean)"
        marks[name] = [float(np.mean(order)) for order in tuned]
    # The paper's two joints lie closer together than a mark is wide.
    if of_paper(arm):
        marks["published (mean)"] = [float(np.mean(order)) for order in PUBLISHED_ORDERS["symbol"]]
    for corner in ((1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (0.0, 0.0)):
        marks[f"integer ({corner[0]:g}, {corner[1]:g})"] = corner
    return marks


def cost_rows(plan: Plan, entries: Sequence[Entry]) -> list[Row]:
    """Return the cost that was tuned for, a row a controller, beside its ratio to the best.

    `entries` are those of `compare`: condition by condition, the controllers in one order.
    """
    costs = [cost_of(entry.run, plan.cost) for entry in entries]
    total = over_scenarios(plan.cost, np.array(costs).reshape(len(plan.experiments), -1))
    with np.errstate(divide="ignore", invalid="ignore"):  # costs of 0, or of inf where all diverge
        ratios = total[0] / total
    return [
        {
            "controller": entry.controller,
            "cost tuned for": float(cost),
            "tuned over this": float(ratio),
        }
        for entry, cost, ratio in zip(entries, total, ratios, strict=False)
    ]


def write(
    folder: Path,
    out: Path,
    config: Config,
    plan: Plan,
    result: TuningResult,
    entries: Sequence[Entry],
    figures: dict[str, Figure],
    along: Profile | None,
    keep: Keep,
) -> list[Row]:
    """Write everything into `folder`, which will be `out`; return the table of costs."""
    from fpid_pin.view import plots
    from fpid_pin.view.report import report_html

    costs = cost_rows(plan, entries)
    rows = summary.drop_constant(summary.run_rows(entries), "condition")
    joints = summary.drop_constant(summary.joint_rows(entries), "condition")
    seeds = [
        {"seed": seed, "best cost": float(cost)}
        for seed, cost in zip(result.history.seeds, result.costs, strict=True)
    ]
    many = len(plan.experiments) > 1
    names = file_names([[condition] for condition in plan.experiments], prefix="comparison-")
    for name, condition in zip(names if many else ["comparison"], plan.experiments, strict=True):
        runs = [entry.run for entry in entries if entry.condition == condition]
        figures[name] = plots.comparison(runs)
    drawn = keep.draw(figures, folder)
    for entry in entries:
        entry.run.save(folder / entry.file, compressed=installed("pcodec"))
    tables = {
        "Parameters": parameter_rows(plan, result, along),
        "Cost tuned for": costs,
        "Seeds": seeds,
        "All joints": rows,
        "Each joint": joints,
    }
    told = [str(result), *result.advice, *what_mattered(along), summary.dynamics_of(entries)]
    text = "".join(f"## {head}\n\n{summary.markdown(table)}\n" for head, table in tables.items())
    title = config.title or Path(config.path).stem
    files = {
        "config.toml": config.text,
        "tuned.toml": _tuned_toml(config, plan, result, out),
        "history.csv": summary.comma_separated(result.history.rows()),
        "summary.csv": summary.comma_separated(rows),
        "joints.csv": summary.comma_separated(joints),
        "summary.md": f"# {summary.in_markdown(title)}, tuned\n\n"
        + "".join(f"- {summary.in_markdown(line)}\n" for line in told)
        + f"\n{text}",
    }
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    report_html(
        [entry.run for entry in entries],
        folder / "report.html",
        title=f"{title}, tuned",
        tables={head: [list(t[0]), *(list(r.values()) for r in t)] for head, t in tables.items()},
        figures=drawn,
        config_text=config.text,
        answer=told[1:],
    )
    return costs


def _tuned_toml(config: Config, plan: Plan, result: TuningResult, out: Path) -> str:
    """Return the configuration with the tuned controller alone, as TOML that `run` takes."""
    import tomli_w

    table = tomllib.loads(config.text)
    table.pop("tune", None)
    table["controller"] = [descriptions.to_dict(result.controller)]
    # Those of the search, so that a run costs what was found to the last bit.
    dynamics = next(iter(plan.experiments.values())).dynamics
    table["simulation"] = table.get("simulation", {}) | {"dynamics": dynamics}
    table["title"] = f"{config.title or Path(config.path).stem}, tuned"
    source = Path(config.path).resolve().parent
    if "import" in table:
        files = [table["import"]] if isinstance(table["import"], str) else table["import"]
        table["import"] = [os.path.relpath(source / file, out.resolve()) for file in files]
    for arm in (table["arm"], table.get("plant", {}).get("arm")):
        if isinstance(arm, dict) and isinstance(arm.get("path"), str):
            # Paths start at the file that names them, and this one lies elsewhere.
            arm["path"] = os.path.relpath(source / arm["path"], out.resolve())
    return tomli_w.dumps(table)
