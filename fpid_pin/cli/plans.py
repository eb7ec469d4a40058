"""What a configuration's [tune] and [campaign] tables ask for, checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from fpid_pin import checks, descriptions
from fpid_pin.campaign import Scenarios, Study
from fpid_pin.cli.configuration import Config, known, moved
from fpid_pin.control import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.experiment import DYNAMICS
from fpid_pin.text import shown
from fpid_pin.tuning import RobustCost, SearchSettings, Space
from fpid_pin.tuning.robust import REDUCTIONS

#: Of [tune]: arguments of `SearchSettings`; workers and checkpoints are the command line's.
SETTINGS = ("population", "generations", "crossover", "mutation", "seeds")
TUNE_KEYS = ("controller", *SETTINGS, "reduce", "map_points", "profile_points", "cost", "space")
CAMPAIGN_KEYS = ("runs", "seed", "sampling", "dynamics", "controllers", "uncertain")


class _Attempts:
    """Actions of one table, each of whose faults is kept under the table's path."""

    def __init__(self, path: str, file: str) -> None:
        self.path, self.file, self.faults = path, file, list[FpidError]()

    def __call__(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except FpidError as error:
            self.faults.append(moved(error, self.path))
            return None

    def end(self) -> None:
        """Raise all faults, if there are any."""
        if self.faults:
            raise ConfigError.of(self.file, self.faults)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a ``[tune]`` table asks for.

    Attributes
    ----------
    controller
        Where the search starts from.
    experiments
        By condition; every candidate goes through all of them. Dynamics are written out.
    cost, space, settings
        What `tune` takes.
    map_points, profile_points
        A side of the cost map, and values of each parameter in the profile; 0: none.
    """

    controller: Controller
    experiments: Mapping[str, Experiment]
    cost: Cost
    space: Space
    settings: SearchSettings
    map_points: int
    profile_points: int


def read_plan(config: Config) -> Plan:
    """Check the ``[tune]`` table.

        controller = "name"   which [[controller]] to start from; default: the first
        population = 60       and generations, crossover, mutation, seeds: `SearchSettings`
        reduce = "worst"      or "mean": over every [[condition]]; default: nominal alone
        map_points = 21       a side of the cost map over (lambda, mu); 0: none
        profile_points = 9    values of each parameter along which the cost is shown; 0: none
        [tune.cost]           kind and arguments of a cost; default: eq. (33)
        [tune.space]          by parameter: [low, high], then "log", "shared" as needed

    Raises
    ------
    ConfigError
        A line for every fault.
    """
    attempt = _Attempts("tune", config.path)
    table = known("tune", config.tune, TUNE_KEYS, attempt.faults)
    first, most = next(iter(config.controllers)), checks.Whole(low=0, high=201)
    name = attempt(
        lambda: checks.choice("controller", table.get("controller", first), config.controllers)
    )
    cost: Any = QuadraticCost()
    if "cost" in table:
        cost = descriptions.build(table["cost"], Cost, "tune.cost", attempt.faults)
    if "reduce" in table:
        reduce = attempt(lambda: checks.choice("reduce", table["reduce"], REDUCTIONS))
        cost = attempt(lambda: RobustCost(cost, reduce)) if reduce and cost else cost
    genes = table.get("space", "none")
    if isinstance(genes, Mapping):
        space = attempt(lambda: Space(**genes))
    else:
        expected = "a table of parameters with bounds"
        attempt.faults.append(ArgumentError("tune.space", expected, shown(genes)))
        space = None
    given: dict[str, Any] = {key: table[key] for key in SETTINGS if key in table}
    settings = descriptions.build(given, SearchSettings, "tune", attempt.faults)
    sides = attempt(lambda: most("map_points", table.get("map_points", 21)))
    values = attempt(lambda: most("profile_points", table.get("profile_points", 9)))
    if name is not None and space is not None:
        attempt(lambda: space.bind(config.controllers[name], config.experiment.arm.n))
    attempt.end()
    law = config.controllers[name]
    robust = isinstance(cost, RobustCost)
    experiments = config.conditions if robust else {"nominal": config.experiment}
    orders = hasattr(law, "integral_order") and hasattr(law, "derivative_order")
    return Plan(
        law, {label: e.with_dynamics("compiled") for label, e in experiments.items()},
        cost, space, settings, sides if orders else 0, max(values, 2) if values else 0,
    )  # fmt: skip


def read_campaign(config: Config) -> tuple[Study, int]:
    """Check the ``[campaign]`` table; return the study, and how many plants there are to be.

        runs = 1_000              plants
        seed = 0                  what all samples derive from
        sampling = "sobol"        or "latin_hypercube", in blocks of 256 runs
        dynamics = "compiled"     or "pinocchio": slower, the same within rounding
        controllers = ["name"]    some of the [[controller]]s; default: all
        [campaign.uncertain]      by quantity, kind and arguments of a distribution
        mass = { kind = "uniform", low = 0.8, high = 1.2 }    of each link, a factor

    Raises
    ------
    ConfigError
        A line for every fault.
    """
    attempt = _Attempts("campaign", config.path)
    table = known("campaign", config.campaign, CAMPAIGN_KEYS, attempt.faults)
    runs = attempt(lambda: checks.integer("runs", table.get("runs", 1000), low=1))
    dynamics = attempt(
        lambda: checks.choice("dynamics", table.get("dynamics", "compiled"), DYNAMICS)
    )
    names = table.get("controllers", list(config.controllers))
    if isinstance(names, list) and names:
        for k, name in enumerate(names):
            attempt(partial(checks.choice, f"controllers.{k}", name, config.controllers))
    else:
        fault = ArgumentError("campaign.controllers", "a list of names", shown(names))
        attempt.faults.append(fault)
    if "uncertain" in table:
        given = {key: table[key] for key in table if key in ("sampling", "seed", "uncertain")}
        scenarios = Scenarios.from_table(given, "campaign", attempt.faults)
    else:
        expected = "a table of quantities with their distributions"
        attempt.faults.append(ArgumentError("campaign.uncertain", expected, "none"))
    attempt.end()
    experiment = dataclasses.replace(config.experiment, dynamics=dynamics)
    laws = {name: config.controllers[name] for name in names}
    study = attempt(lambda: Study(experiment, laws, scenarios, config.title))
    attempt.end()
    return study, runs
