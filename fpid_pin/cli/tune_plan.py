"""The ``[tune]`` table of a configuration, checked.

[tune]
controller = "name"          # which [[controller]] to start from; default: the first
population = 60              # and generations, crossover, mutation, seeds: `SearchSettings`
reduce = "worst"             # or "mean": over every [[condition]]; default: nominal alone
map_points = 21              # a side of the cost map over (lambda, mu); 0: none
profile_points = 9           # values of each parameter along which the cost is shown; 0: none
[tune.cost]                  # kind and arguments of a cost; default: eq. (33)
[tune.space]                 # by parameter: [low, high], then "log", "shared" as needed
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from fpid_pin import checks, descriptions
from fpid_pin.cli.configuration import Config
from fpid_pin.control import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.simulation import Experiment
from fpid_pin.text import shown
from fpid_pin.tuning import RobustCost, SearchSettings, Space
from fpid_pin.tuning.robust import REDUCTIONS

#: Arguments of `SearchSettings`; workers and checkpoints are the command line's.
SETTINGS = ("population", "generations", "crossover", "mutation", "seeds")
KEYS = ("controller", *SETTINGS, "reduce", "map_points", "profile_points", "cost", "space")
_MOST_POINTS = 201


@dataclasses.dataclass(frozen=True, eq=False)
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
    map_points
        A side of the cost map; 0: none.
    profile_points
        Values of each parameter in the profile; 0: none.
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

    Raises
    ------
    ConfigError
        A line for every fault.
    """
    table = dict(config.tune)
    faults: list[FpidError] = []
    made: dict[str, Any] = {}

    def attempt(name: str, action: Callable[[], Any]) -> None:
        try:
            made[name] = action()
        except ArgumentError as error:
            faults.append(ArgumentError(f"tune.{error.name}", error.expected, error.got))
        except FpidError as error:
            faults.append(error)

    for key in table:
        attempt("known", partial(checks.choice, key, key, KEYS))
    if "space" not in table:
        faults.append(ArgumentError("tune.space", "a table of parameters with bounds", "none"))
    first = next(iter(config.controllers))
    attempt("name", lambda: checks.choice(
        "controller", table.get("controller", first), config.controllers))  # fmt: skip
    attempt("cost", lambda: _cost(table))
    attempt("space", lambda: _space(table))
    given = {name: table[name] for name in SETTINGS if name in table}
    attempt("settings", lambda: SearchSettings(**given))
    attempt("map_points", lambda: checks.integer(
        "map_points", table.get("map_points", 21), low=0, high=_MOST_POINTS))  # fmt: skip
    attempt("profile_points", lambda: checks.integer(
        "profile_points", table.get("profile_points", 9), low=0, high=_MOST_POINTS))  # fmt: skip
    controller = config.controllers.get(made.get("name", ""))
    if controller is not None and "space" in made:
        attempt("bound", lambda: made["space"].bind(controller, config.experiment.arm.n))
    if faults or controller is None:
        raise ConfigError.of(config.path, faults)
    robust = isinstance(made["cost"], RobustCost)
    experiments = config.conditions if robust else {"nominal": config.experiment}
    return Plan(
        controller=controller,
        experiments={name: e.with_dynamics("compiled") for name, e in experiments.items()},
        cost=made["cost"],
        space=made["space"],
        settings=made["settings"],
        map_points=made["map_points"] if _has_orders(controller) else 0,
        profile_points=max(made["profile_points"], 2) if made["profile_points"] else 0,
    )


def _cost(table: Mapping[str, Any]) -> Cost:
    cost: Cost = QuadraticCost()
    if "cost" in table:
        cost = descriptions.from_dict(table["cost"], Cost, "cost")
    if "reduce" in table:
        cost = RobustCost(cost, checks.choice("reduce", table["reduce"], REDUCTIONS))
    return cost


def _space(table: Mapping[str, Any]) -> Space:
    genes = table.get("space", {})
    if not isinstance(genes, Mapping):
        raise ArgumentError("space", "a table of parameters with bounds", shown(genes))
    return Space(**genes)


def _has_orders(controller: Controller) -> bool:
    return hasattr(controller, "integral_order") and hasattr(controller, "derivative_order")
