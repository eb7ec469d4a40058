"""Which controller of a configuration a command is about."""

from __future__ import annotations

from fpid_pin import checks
from fpid_pin.cli.configuration import Config
from fpid_pin.exceptions import ArgumentError, ConfigError
from fpid_pin.text import named


def pick(config: Config, name: str | None) -> str:
    """Return which controller ``--controller`` chose, by its name; None: the only one.

    Raises
    ------
    ConfigError
        A name that is not there; none where there are several.
    """
    names = config.controllers
    if name is None and len(names) > 1:
        several = ", ".join(map(named, names))
        fault = f"expected one controller, or --controller NAME, got {several}"
        raise ConfigError.of(config.path, [fault])
    try:
        return checks.choice("--controller", name or next(iter(names)), names)
    except ArgumentError as error:
        raise ConfigError.of(config.path, [error]) from None
