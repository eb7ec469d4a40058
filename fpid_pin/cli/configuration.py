"""What a configuration file describes, once it is read."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from fpid_pin.control import Controller
from fpid_pin.simulation import Experiment


@dataclasses.dataclass(frozen=True, eq=False)
class Config:
    """What a configuration file describes.

    Attributes
    ----------
    path, text
        Where it came from, and all of it.
    title
        For reports.
    experiment
        The nominal one.
    controllers
        By name, in the file's order.
    conditions
        Experiments by name; only the nominal one where the file has no ``[[condition]]``.
    tune, campaign
        The tables of these names as they stand.
    """

    path: str
    text: str
    title: str
    experiment: Experiment
    controllers: dict[str, Controller]
    conditions: dict[str, Experiment]
    tune: Mapping[str, Any]
    campaign: Mapping[str, Any]
