"""The body of ``fpid-pin tune``: search, compare what was found with its rivals, and write it."""

from __future__ import annotations

import dataclasses
import filecmp
import shutil
import tomllib
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fpid_pin import checks
from fpid_pin.cli.campaign import executor_of
from fpid_pin.cli.configuration import Config, load
from fpid_pin.cli.output import output_folder
from fpid_pin.cli.plans import Plan, read_plan
from fpid_pin.cli.results import OutputOptions, figures_of, simulate_all, write_results
from fpid_pin.cli.screen import Row, comma_separated, print_table, progress_bar, say
from fpid_pin.control import AdaptiveFpid, Controller
from fpid_pin.exceptions import FpidError
from fpid_pin.files import discard, replacing
from fpid_pin.simulation import Comparison, cost_of
from fpid_pin.simulation.experiment import PUBLISHED_ORDERS, of_paper
from fpid_pin.simulation.toml import controllers_toml, toml_text
from fpid_pin.simulation.workers import executor_of as pool_of
from fpid_pin.text import named, visible
from fpid_pin.tuning import Profile, RobustCost, TuningResult, cost_map, profile, tune
from fpid_pin.tuning.problem import over_scenarios

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The checkpoint within the folder of results.
KEPT = "checkpoint.npz"
_ORDERS = ("integral_order", "derivative_order")
_TUNED, _PUBLISHED, _INTEGER = "tuned", "published orders", "integer orders"


def run_tuning(
    path: Path,
    out: Path,
    resume: bool = False,
    workers: int | None = None,
    options: OutputOptions | None = None,
    dask: str | None = None,
    condition: str | None = None,
    controller: str | None = None,
) -> TuningResult:
    """Search as a configuration says, and write the folder `out`.

    One condition, or all of them; from one controller, or from what the table names.

    The search's checkpoint lies beside `out` until the folder is written, with it inside.

    Raises
    ------
    ConfigError, FileFormatError, TuningError
        What is wrong, `out` cannot be written (before the search starts), or see `tune`.
    """
    scheduler = executor_of(workers, dask)
    config = load(path)
    if condition is not None:
        config = config.under(condition)
    plan = read_plan(config, controller)
    if len(plan.experiments) > 1:
        over = plan.cost.reduce if isinstance(plan.cost, RobustCost) else "mean"
        say(f"Tuned for the {over} of {', '.join(map(named, plan.experiments))}.")
    experiments = list(plan.experiments.values())
    checkpoint = out.with_name(f"{out.name}.checkpoint.npz")
    # Entered before hours are spent: what cannot be written is told now.
    with output_folder(out) as folder:
        _take_up(checkpoint, out / KEPT, resume)
        with (
            scheduler as far,
            pool_of(far, workers, experiments, [plan.controller]) as pool,
        ):
            settings = dataclasses.replace(
                plan.table.settings, executor=pool, checkpoint=checkpoint, resume=resume
            )
            try:
                with progress_bar("search") as bar:
                    result = tune(
                        experiments, plan.controller, plan.table.space, plan.cost, settings,
                        progress=bar,
                    )  # fmt: skip
            except KeyboardInterrupt:
                if checkpoint.exists():
                    say(f"{checkpoint}: --resume goes on from here", error=True)
                raise
            except FpidError:
                # Refused before it went on, a search has not touched what it took up.
                _drop_copy(checkpoint, out / KEPT)
                raise
            along, figures = explore(plan, result, pool)
        comparison, files = simulate_all(plan.experiments, rivals(plan, result), None)
        advice = [*result.advice, *(along.advice if along else [])]
        tables = {
            "Parameters": result.rows(along),
            "Cost tuned for": cost_rows(plan, comparison),
            "Seeds": [
                {"seed": str(seed), "best cost": float(cost)}
                for seed, cost in zip(result.history.seeds, result.costs, strict=True)
            ],
        }
        write_results(
            folder, config.at(out), comparison, files, figures | figures_of(comparison),
            options or OutputOptions(), title=f"{config.title}, tuned",
            said=[result.summary, *advice], tables=tables,
        )  # fmt: skip
        for name, text in (
            ("tuned.toml", _tuned_toml(config, plan, result, out)),
            ("history.csv", comma_separated(result.history.rows())),
        ):
            (folder / name).write_text(text, encoding="utf-8")
        # In the folder before this takes its place: at no moment is there one without it.
        shutil.copyfile(checkpoint, folder / KEPT)
    discard(checkpoint)
    say(*advice)
    print_table(tables["Cost tuned for"], "Tuned")
    say(*str(result).splitlines())
    say(f"{out}: tuned.toml, report.html, figures, history.csv, summary, runs (.npz)")
    return result


def _take_up(checkpoint: Path, kept: Path, resume: bool) -> None:
    """Find the checkpoint to go on from where the last search has left it.

    While a search goes on its checkpoint lies beside the folder, at its end in it; killed in
    between, a search leaves two that are equal.
    """
    _drop_copy(checkpoint, kept)
    if resume and kept.is_file() and not checkpoint.exists():
        with replacing(checkpoint) as temporary:
            shutil.copyfile(kept, temporary)


def _drop_copy(checkpoint: Path, kept: Path) -> None:
    both = checkpoint.is_file() and kept.is_file()
    if both and filecmp.cmp(checkpoint, kept, shallow=False):
        discard(checkpoint)


def rivals(plan: Plan, result: TuningResult) -> dict[str, Controller]:
    """Return the tuned controller and, by other labels, those it has to be better than."""

    def called(name: str, **changes: object) -> Controller:
        return dataclasses.replace(cast("Any", base), name=name, **changes)  # type: ignore[no-any-return]

    base = plan.controller
    adaptive = isinstance(base, AdaptiveFpid)
    label = base.name or ("" if adaptive else getattr(base, "_kind", "")) or "as configured"
    if label in (_TUNED, _PUBLISHED, _INTEGER):
        # As one that was tuned before is called, by its tuned.toml.
        label = f"{label}, as configured"
    found = {_TUNED: result.controller, label: called(label)}
    if adaptive:
        arm = next(iter(plan.experiments.values())).arm
        integer = ((1.0,) * arm.n,) * 2
        here = [checks.per_joint(name, getattr(base, name), arm.n).tolist() for name in _ORDERS]
        for name, orders in ((_PUBLISHED, PUBLISHED_ORDERS["symbol"]), (_INTEGER, integer)):
            own = name == _INTEGER or of_paper(arm)
            if own and here != [list(order) for order in orders]:
                found[name] = called(name, integral_order=orders[0], derivative_order=orders[1])
    return found


def explore(
    plan: Plan, result: TuningResult, pool: Executor | None
) -> tuple[Profile | None, dict[str, Figure]]:
    """Find and draw the cost around the best: along each parameter, and over a law's orders."""
    from fpid_pin.view import plots

    table, experiments, best = plan.table, list(plan.experiments.values()), result.controller
    figures, along = {"convergence": plots.convergence(result.history.curves())}, None
    if table.profile_points and result.within:
        points = max(table.profile_points, 2)
        with progress_bar(f"profile, {result.space.size * (points + 2)} candidates") as bar:
            along = profile(
                experiments, best, table.space, plan.cost, points=points, executor=pool,
                progress=bar,
            )  # fmt: skip
        figures["profile"] = plots.profile(along.labels, along.values, along.costs, along.cost)
    if table.map_points and all(hasattr(best, name) for name in _ORDERS):
        grid = np.linspace(0.0, 1.0, table.map_points) if table.map_points > 1 else [1.0]
        with progress_bar(f"cost map, {table.map_points**2} candidates") as bar:
            found = cost_map(
                experiments, best, plan.cost, integral_orders=grid, derivative_orders=grid,
                executor=pool, progress=bar,
            )  # fmt: skip
        figures["cost-map"] = plots.cost_map(
            found.integral_orders, found.derivative_orders, found.costs, _marks(plan, result)
        )
    return along, figures


def _marks(plan: Plan, result: TuningResult) -> dict[str, Sequence[float]]:
    """Return what the map points out: ours, on its own arm the paper's, and integer corners."""
    arm = next(iter(plan.experiments.values())).arm
    n = arm.n
    tuned = [checks.per_joint(name, getattr(result.controller, name), n) for name in _ORDERS]
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


def cost_rows(plan: Plan, comparison: Comparison) -> list[Row]:
    """Return the cost that was tuned for, a row a controller, beside its ratio to the best."""
    costs = [cost_of(run, plan.cost) for run in comparison.runs]
    total = over_scenarios(plan.cost, np.array(costs).reshape(len(plan.experiments), -1))
    with np.errstate(divide="ignore", invalid="ignore"):  # costs of 0, or of inf where all diverge
        ratios = total[0] / total
    return [
        {"controller": name, "cost tuned for": float(cost), "tuned over this": float(ratio)}
        for name, cost, ratio in zip(comparison.controllers, total, ratios, strict=True)
    ]


def _tuned_toml(config: Config, plan: Plan, result: TuningResult, out: Path) -> str:
    """Return the configuration with the tuned controller beside what it was tuned against."""
    table = tomllib.loads(config.at(out).text)
    for key in ("tune", "campaign", "controller"):
        table.pop(key, None)
    # Those of the search, so that a run costs what was found to the last bit.
    dynamics = next(iter(plan.experiments.values())).dynamics
    table["simulation"] = table.get("simulation", {}) | {"dynamics": dynamics}
    table.pop("title", None)
    head: dict[str, Any] = {"format": table.pop("format"), "title": f"{config.title}, tuned"}
    head |= {"import": table.pop("import")} if "import" in table else {}
    notes = dict.fromkeys(rivals(plan, result), "what it was tuned against")
    notes[_TUNED] = f"searched: {', '.join(result.parameters)}"
    text = [
        f"# Found by `fpid-pin tune {visible(config.path)}`: {result.summary}.",
        f"#   fpid-pin compare {visible(str(out / 'tuned.toml'))}",
        f"#   fpid-pin run {visible(str(out / 'tuned.toml'))} --controller {_TUNED}",
        toml_text(head | table),
        controllers_toml(rivals(plan, result), notes),
    ]
    return "\n".join(text)
