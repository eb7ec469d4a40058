"""`fpid-pin live`: the control loop of a configuration in real time, to be seen and pushed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.cli.config import load
from fpid_pin.cli.screen import say, screen
from fpid_pin.exceptions import ArgumentError, ConfigError

if TYPE_CHECKING:
    from rich.console import Console


def run_live(
    config_path: Path,
    *,
    controller: str | None = None,
    duration: float | None = None,
    fps: float = 40.0,
    browser: bool = True,
    port: int | None = None,
    joint: str | None = None,
    push: float | None = None,
    priority: bool = True,
    baseline: float = 0.0,
    console: Console | None = None,
) -> None:
    """Run one controller of a configuration in real time and show it.

    Parameters
    ----------
    config_path
        A configuration as `fpid-pin run` takes it.
    controller
        Which one, by name; None: the first.
    duration
        How long [s]; None: until Ctrl-C or ``q``.
    fps, browser, port, priority
        As for `fpid_pin.view.live`.
    joint, push
        Which joint + and - push at first, and by how much [N m].
    baseline
        How long to run without the view first [s], so that the period can be compared; 0: not.
    console
        Where to print.
    """
    from fpid_pin.view.live_session import HELP, live

    console = console or screen()
    config = load(config_path)
    try:
        chosen = controller or next(iter(config.controllers))
        law = config.controllers[checks.choice("--controller", chosen, config.controllers)]
        wait = checks.number("--baseline", baseline, low=0.0)
    except ArgumentError as error:
        raise ConfigError.of(config_path, [error]) from None

    def tell(text: str) -> None:
        say(console, text)

    if wait:
        tell(f"{wait:g} s without the view, to compare ...")
        alone = live(config.experiment, law, duration=wait, view=False, priority=priority)
        tell(f"without the view: {alone.timing}")
    tell(HELP)
    report = live(
        config.experiment, law, duration=duration, fps=fps, open_browser=browser, port=port,
        push_joint=joint or 0, push_torque=push, priority=priority, announce=tell,
    )  # fmt: skip
    tell(f"with the view:    {report.timing}")
    if report.send_times.size:
        median = 1e3 * float(np.median(report.send_times))
        tell(
            f"{report.send_times.size} frames sent, median {median:.3f} ms each, "
            f"{report.dropped} dropped"
        )
    if report.fault:
        tell(report.fault)
