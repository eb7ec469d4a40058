"""What `tune` does: search as the table says, compare what was found with its rivals, write it."""

from __future__ import annotations

import filecmp
import shutil
import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import Check, OneOf, Text, Whole
from fpid_pin.cli.campaign import executor_of
from fpid_pin.cli.configuration import Config, load, moved, read_table
from fpid_pin.cli.output import output_folder
from fpid_pin.cli.results import OutputOptions, figures_of, simulate_all, write_results
from fpid_pin.cli.screen import Row, comma_separated, print_table, progress_bar, say
from fpid_pin.control import AdaptiveFpid, Controller
from fpid_pin.costs import Cost
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.files import discard, replacing
from fpid_pin.simulation import Comparison, Experiment, cost_of
from fpid_pin.simulation.experiment import PUBLISHED_ORDERS, of_paper
from fpid_pin.simulation.toml import controllers_toml, toml_text
from fpid_pin.simulation.workers import executor_of as pool_of
from fpid_pin.text import named, visible
from fpid_pin.tuning import (
    Profile,
    RobustCost,
    SearchSettings,
    Space,
    TuningResult,
    cost_map,
    profile,
    tune,
)  # fmt: skip
from fpid_pin.tuning.problem import REDUCTIONS, Problem, over_scenarios

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The checkpoint within the folder of results.
KEPT = "checkpoint.npz"
_ORDERS = ("integral_order", "derivative_order")
_TUNED, _PUBLISHED, _INTEGER = "tuned", "published orders", "integer orders"


def _space(path: str, genes: Any) -> Space:
    """Return the space of ``[tune.space]``, or one that is made of it already."""
    if isinstance(genes, Space):
        return genes
    checks.plain(path, genes, Mapping, "a table of parameters with bounds")
    try:
        return Space(**genes)
    except ArgumentError as error:
        name = path + error.name.removeprefix("space")
        raise ArgumentError(name, error.expected, error.got) from None


@dataclass(frozen=True, eq=False, kw_only=True)
class TuneTable(Description):
    """The table ``[tune]``.

    Parameters
    ----------
    controller
        Which ``[[controller]]`` to start from; default: the first.
    population, generations, crossover, mutation, seeds
        See `SearchSettings`; workers and checkpoints are the command line's.
    reduce
        ``"worst"`` or ``"mean"`` over every ``[[condition]]``.
    map_points
        A side of the cost map over (lambda, mu); 0: none.
    profile_points
        Values of each parameter along which the cost is shown; 0: none.
    cost
        Kind and arguments of a cost; default: eq. (33) on the paper's arm, on others the worst
        joint's RMS error over the last half, at no more variation of the torque than at the start.
    space
        By parameter: ``[low, high]``, then ``"log"``, ``"shared"`` as needed.
    """

    controller: Annotated[str | None, Text] = None
    population: int = SearchSettings.population
    generations: int = SearchSettings.generations
    crossover: float = SearchSettings.crossover
    mutation: float = SearchSettings.mutation
    seeds: Sequence[int] = (0,)
    reduce: Annotated[str, OneOf(*REDUCTIONS)] = "worst"
    map_points: Annotated[int, Whole(low=0, high=201)] = 21
    profile_points: Annotated[int, Whole(low=0, high=201)] = 9
    cost: Cost | None = None
    space: Annotated[Space, Check(_space)]

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.settings

    @property
    def settings(self) -> SearchSettings:
        """How to search."""
        return SearchSettings(
            self.population, self.generations, self.crossover, self.mutation, self.seeds
        )


@dataclass(frozen=True, eq=False)
class Plan:
    """What a ``[tune]`` table asks for, with what it names."""

    table: TuneTable
    controller: Controller  # where the search starts from
    experiments: Mapping[str, Experiment]  # by condition, with their dynamics written out
    cost: Cost


def read_plan(config: Config, controller: str | None = None) -> Plan:
    """Check the table ``[tune]``; the search starts from `controller`, else from the table's."""
    name = controller or config.tune.get("controller", next(iter(config.controllers)))
    table = read_table(config, "tune", TuneTable, {"controller": name})
    compiled = {label: e.with_dynamics("compiled") for label, e in config.conditions.items()}
    try:
        several = len(compiled) > 1 and not isinstance(table.cost, RobustCost)
        cost = RobustCost(table.cost, table.reduce) if several else table.cost
        problem = Problem(list(compiled.values()), config.controllers[name], table.space, cost)
    except FpidError as error:
        raise ConfigError.of(config.path, [moved(error, "tune")]) from None
    return Plan(table, problem.space.base, compiled, problem.costs[0])


def run_tuning(
    path: Path,
    out: Path,
    resume: bool = False,
    controller: str | None = None,
    condition: str | None = None,
    workers: int | None = None,
    dask: str | None = None,
    png: bool = False,
    allow_import: bool = False,
) -> TuningResult:
    """Search as a configuration and the command's options say, and write the folder `out`.

    The search's checkpoint lies beside `out` until the folder is written, with it inside.
    """
    scheduler = executor_of(workers, dask)
    config = load(path, allow_import)
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
        with scheduler as far, pool_of(far, workers, experiments, [plan.controller]) as pool:
            settings = replace(
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
        config = replace(config.at(out), title=f"{config.title}, tuned")
        write_results(
            folder, config, comparison, files, figures | figures_of(comparison),
            OutputOptions(png=png), [result.summary, *advice], tables,
        )  # fmt: skip
        (folder / "tuned.toml").write_text(_tuned_toml(config, plan, result, out), "utf-8")
        (folder / "history.csv").write_text(comma_separated(result.history.rows()), "utf-8")
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
        return replace(cast("Any", base), name=name, **changes)  # type: ignore[no-any-return]

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
    tuned = np.array(
        [checks.per_joint(name, getattr(result.controller, name), arm.n) for name in _ORDERS]
    )
    if arm.n == 2 and np.ptp(tuned, axis=1).any():
        marks = {f"tuned, joint {j + 1}": tuned[:, j].tolist() for j in range(2)}
    else:
        marks = {"tuned" if arm.n == 1 else "tuned (mean)": tuned.mean(axis=1).tolist()}
    # The paper's two joints lie closer together than a mark is wide.
    if of_paper(arm):
        marks["published (mean)"] = np.mean(PUBLISHED_ORDERS["symbol"], axis=1).tolist()
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
    table = tomllib.loads(config.text) | {"title": config.title}
    for key in ("tune", "campaign", "controller"):
        table.pop(key, None)
    # Those of the search, so that a run costs what was found to the last bit.
    dynamics = next(iter(plan.experiments.values())).dynamics
    table["simulation"] = table.get("simulation", {}) | {"dynamics": dynamics}
    laws = rivals(plan, result)
    notes = dict.fromkeys(laws, "what it was tuned against")
    notes[_TUNED] = f"searched: {', '.join(result.parameters)}"
    text = [
        f"# Found by `fpid-pin tune {visible(config.path)}`: {result.summary}.",
        f"#   fpid-pin compare {visible(str(out / 'tuned.toml'))}",
        f"#   fpid-pin run {visible(str(out / 'tuned.toml'))} --controller {_TUNED}",
        toml_text(table),
        controllers_toml(laws, notes),
    ]
    return "\n".join(text)
