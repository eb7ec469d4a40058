"""A configuration as a page with sliders."""

from __future__ import annotations

from pathlib import Path

from fpid_pin.cli.configuration import Config
from fpid_pin.exceptions import ConfigError, FpidError
from fpid_pin.view.playground_law import Law
from fpid_pin.view.playground_page import playground


def write_playground(config: Config, html: Path, name: str | None = None) -> list[str]:
    """Write a page of what it can hold; return a line for each controller that it cannot.

    Raises
    ------
    FpidError
        It can hold none of them.
    """
    kept: list[Law] = []
    left: list[str] = []
    for label, controller in config.controllers.items():
        if name in (None, label):
            try:
                kept.append(Law(controller, config.experiment, kept))
            except FpidError as error:
                left.append(f"{label}: {error}")
    if not kept:
        raise ConfigError.of(config.path, left)
    laws = [law.controller for law in kept]
    playground(config.experiment, laws, html, title=config.title)
    return left
