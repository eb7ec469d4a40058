"""What a configuration's [tune] and [campaign] tables ask for, checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

from fpid_pin import checks, descriptions
from fpid_pin.campaign import Scenarios, Study, Success
from fpid_pin.checks import Check, OneOf, Plain, Text, Whole
from fpid_pin.cli.configuration import Config, moved
from fpid_pin.control import Controller
from fpid_pin.costs import Cost
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.experiment import DYNAMICS
from fpid_pin.tuning import RobustCost, SearchSettings, Space
from fpid_pin.tuning.problem import REDUCTIONS, Problem

T = TypeVar("T", bound=Description)


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


@dataclass(frozen=True, eq=False, kw_only=True)
class CampaignTable(Scenarios):
    """The table ``[campaign]``: `Scenarios`, and of what.

    Parameters
    ----------
    runs
        Plants.
    dynamics
        ``"compiled"``, or ``"pinocchio"``: slower, the same within rounding.
    controllers
        Some of the ``[[controller]]``; default: all.
    success
        When a run counts as a success: ``error``, ``peak_torque``, ``at_limits``.
    """

    runs: Annotated[int, Whole(low=1)] = 1000
    dynamics: Annotated[str, OneOf(*DYNAMICS)] = "compiled"
    controllers: Annotated[Sequence[str] | None, Plain(list, "a list of names")] = None
    success: Success = field(default_factory=Success)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.controllers is not None and not self.controllers:
            raise ArgumentError("controllers", "a list of names", "[]")


@dataclass(frozen=True, eq=False)
class Plan:
    """What a ``[tune]`` table asks for, with what it names."""

    table: TuneTable
    controller: Controller  # where the search starts from
    experiments: Mapping[str, Experiment]  # by condition, with their dynamics written out
    cost: Cost


def _read(config: Config, path: str, kind: type[T], names: Mapping[str, Any]) -> T:
    """Return a table of a configuration; `names` are the controllers that it names, by key."""
    faults: list[FpidError] = []
    table = descriptions.build(getattr(config, path), kind, path, faults)
    for key, name in names.items():
        try:
            checks.choice(f"{path}.{key}", name, config.controllers)
        except ArgumentError as error:
            faults.append(error)
    if faults:
        raise ConfigError.of(config.path, faults)
    return table  # type: ignore[no-any-return]


def read_plan(config: Config, controller: str | None = None) -> Plan:
    """Check the table ``[tune]``, a `TuneTable`, against the rest of its file.

    The search starts from a controller by its name, or from the one that the table names.

    Raises
    ------
    ConfigError
        A line for every fault.
    """
    name = controller or config.tune.get("controller", next(iter(config.controllers)))
    table = _read(config, "tune", TuneTable, {"controller": name})
    compiled = {label: e.with_dynamics("compiled") for label, e in config.conditions.items()}
    try:
        several = len(compiled) > 1 and not isinstance(table.cost, RobustCost)
        cost = RobustCost(table.cost, table.reduce) if several else table.cost
        problem = Problem(list(compiled.values()), config.controllers[name], table.space, cost)
    except FpidError as error:
        raise ConfigError.of(config.path, [moved(error, "tune")]) from None
    return Plan(table, problem.space.base, compiled, problem.costs[0])


def read_campaign(config: Config) -> tuple[Study, int]:
    """Check the table ``[campaign]``; return the study, and how many plants there are to be.

    Raises
    ------
    ConfigError
        A line for every fault of the `CampaignTable`.
    """
    given = config.campaign.get("controllers")
    names = given if isinstance(given, list) else list(config.controllers)
    numbered = {f"controllers.{k}": name for k, name in enumerate(names)}
    table = _read(config, "campaign", CampaignTable, numbered)
    experiment = dataclasses.replace(config.experiment, dynamics=table.dynamics)
    laws = {name: config.controllers[name] for name in names}
    scenarios = Scenarios(table.uncertain, table.sampling, table.seed, table.points)
    try:
        return Study(experiment, laws, scenarios, config.title, table.success), table.runs
    except FpidError as error:
        raise ConfigError.of(config.path, [moved(error, "campaign")]) from None
