"""`export`: a controller of a configuration as C99."""

from __future__ import annotations

from pathlib import Path

from fpid_pin.cli.choice import pick
from fpid_pin.cli.config import load
from fpid_pin.cli.screen import say, screen
from fpid_pin.export import export_c


def run_export(path: Path, out: Path, name: str | None, horizon: float, ticks: int) -> None:
    """Write the folder, and say what is in it."""
    config = load(path)
    chosen = pick(config, name)
    experiment = config.experiment
    options = f"--horizon {horizon:g} --ticks {ticks}"
    toml = f"# Exported: controller {chosen!r}, {options}.\n{config.text}"
    folder = export_c(
        config.controllers[chosen], experiment.arm, experiment.step, out,
        horizon=horizon, ticks=ticks, experiment=experiment, toml=toml,
    )  # fmt: skip
    say(screen(), f"{folder}: fpid.h, fpid.c, fpid_parameters.c, example, check, README.md")
