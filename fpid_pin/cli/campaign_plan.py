"""The ``[campaign]`` table of a configuration, checked.

[campaign]
runs = 10_000                # plants
seed = 0                     # what all samples derive from
sampling = "sobol"           # or "latin_hypercube", in blocks of 256 runs
dynamics = "compiled"        # or "pinocchio": slower, the same within rounding
controllers = ["name"]       # some of the [[controller]]s; default: all
[campaign.uncertain]         # by quantity, kind and arguments of a distribution
mass = { kind = "uniform", low = 0.8, high = 1.2 }  # of each link, a factor; `shared`: one for all
payload = { kind = "normal", mean = 0.5, std = 0.3 }  # [kg], cut at 0
delay = { kind = "choices", values = [0, 1, 2] }
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from fpid_pin import checks
from fpid_pin.campaign import Scenarios, Study
from fpid_pin.cli.configuration import Config
from fpid_pin.control import Controller
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.experiment import DYNAMICS
from fpid_pin.text import shown

KEYS = ("runs", "seed", "sampling", "dynamics", "controllers", "uncertain")
#: Plants, where nothing else is said.
RUNS = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class CampaignPlan:
    """What a ``[campaign]`` table asks for.

    Attributes
    ----------
    study
        The campaign.
    runs
        How many plants.
    """

    study: Study
    runs: int


def read_campaign(config: Config) -> CampaignPlan:
    """Check the ``[campaign]`` table.

    Raises
    ------
    ConfigError
        A line for every fault.
    """
    table = config.campaign
    faults: list[FpidError] = []

    def attempt(action: Callable[[], Any]) -> Any:
        try:
            return action()
        except ArgumentError as error:
            faults.append(ArgumentError(f"campaign.{error.name}", error.expected, error.got))
        except FpidError as error:
            faults.append(error)
        return None

    for key in table:
        attempt(partial(checks.choice, key, key, KEYS))
    runs = attempt(lambda: checks.integer("runs", table.get("runs", RUNS), low=1))
    experiment = attempt(lambda: _experiment(config, table))
    controllers = attempt(lambda: _controllers(config, table))
    if "uncertain" in table:
        scenarios = Scenarios.from_table(
            {key: table[key] for key in ("sampling", "seed", "uncertain") if key in table},
            "campaign",
            faults,
        )
    else:
        scenarios = None
        expected = "a table of quantities with their distributions"
        faults.append(ArgumentError("campaign.uncertain", expected, "none"))
    study = None
    if None not in (experiment, controllers, scenarios):
        title = config.title or Path(config.path).stem
        study = attempt(lambda: Study(experiment, controllers, scenarios, title))
    if faults or study is None:
        raise ConfigError.of(config.path, faults)
    return CampaignPlan(study, runs)


def _experiment(config: Config, table: Mapping[str, Any]) -> Experiment:
    dynamics = checks.choice("dynamics", table.get("dynamics", "compiled"), DYNAMICS)
    return dataclasses.replace(config.experiment, dynamics=dynamics)


def _controllers(config: Config, table: Mapping[str, Any]) -> dict[str, Controller]:
    names = table.get("controllers", list(config.controllers))
    if not isinstance(names, list) or not names:
        raise ArgumentError("controllers", "a list of names", shown(names))
    for k, name in enumerate(names):
        checks.choice(f"controllers.{k}", name, config.controllers)
    return {name: config.controllers[name] for name in names}
