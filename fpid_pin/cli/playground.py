"""`playground`: a configuration as a page with sliders."""

from __future__ import annotations

import sys
from pathlib import Path

from fpid_pin.cli.choice import pick
from fpid_pin.cli.config import load
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.screen import say, screen
from fpid_pin.exceptions import ConfigError, FpidError
from fpid_pin.files import require_file
from fpid_pin.text import visible
from fpid_pin.view.document import Page
from fpid_pin.view.playground_page import playground


def run_playground(path: Path, html: Path, name: str | None) -> None:
    """Write the page of a configuration's controllers, or of one of them."""
    require_file(html)
    config = load(path)
    if name is not None:
        pick(config, name)
    page, left = make(config, html, name)
    for line in left:
        sys.stderr.write(f"fpid-pin: left out: {visible(line)}\n")
    say(screen(), f"Written to {html} ({len(page.text.encode()) / 1e6:.1f} MB): open it")


def make(config: Config, html: Path, name: str | None = None) -> tuple[Page, list[str]]:
    """Write a page of what it can hold; return it, and a line for each controller that it cannot.

    Raises
    ------
    FpidError
        It can hold none of them.
    """
    from fpid_pin.view.playground_law import Law

    kept: list[Law] = []
    left: list[str] = []
    for label, controller in config.controllers.items():
        if name not in (None, label):
            continue
        try:
            kept.append(Law(controller, config.experiment, kept))
        except FpidError as error:
            left.append(f"{label}: {error}")
    if not kept:
        raise ConfigError.of(config.path, left)
    laws = [law.controller for law in kept]
    return playground(config.experiment, laws, html, title=config.title), left
