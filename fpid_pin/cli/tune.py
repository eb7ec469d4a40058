"""The body of ``fpid-pin tune``: search, and write what was found."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from fpid_pin.cli import summary
from fpid_pin.cli.config import load
from fpid_pin.cli.output import OutputFolder
from fpid_pin.cli.screen import say, screen
from fpid_pin.cli.search_bar import search_bar
from fpid_pin.cli.summary import Row
from fpid_pin.cli.tune_plan import Plan, read_plan
from fpid_pin.cli.tune_results import compare, draw, write
from fpid_pin.exceptions import FileFormatError
from fpid_pin.tuning import TuningResult, WorkerPool, tune


def run_tuning(
    path: Path, out: Path, resume: bool = False, workers: int | None = None
) -> TuningResult:
    """Search as a configuration says, and write the folder `out`.

    The search's checkpoint lies beside `out` until the folder is written, then in it.

    Raises
    ------
    ConfigError, FileFormatError, TuningError
        What is wrong, `out` cannot be written (before the search starts), or see `tune`.
    """
    config = load(path)
    plan = read_plan(config)
    _check_writable(out)
    checkpoint = out.with_name(f"{out.name}.checkpoint.npz")
    kept = out / "checkpoint.npz"
    if resume and kept.exists() and not checkpoint.exists():
        shutil.copyfile(kept, checkpoint)
    with ExitStack() as stack:
        pool = None if workers is None else stack.enter_context(WorkerPool(workers))
        try:
            result = _search(plan, pool, checkpoint, resume)
        except KeyboardInterrupt:
            say(screen(error=True), f"{checkpoint}: --resume goes on from here")
            raise
        figures = draw(plan, result, pool)
    with OutputFolder(out) as folder:
        entries = compare(plan, result)
        rows = write(folder, out, config, plan, result, entries, figures)
    os.replace(checkpoint, kept)
    _show(rows, result, out)
    return result


def _search(plan: Plan, pool: Executor | None, checkpoint: Path, resume: bool) -> TuningResult:
    settings = dataclasses.replace(
        plan.settings, executor=pool, checkpoint=checkpoint, resume=resume
    )
    with search_bar() as told:
        return tune(
            list(plan.experiments.values()),
            plan.controller,
            plan.space,
            plan.cost,
            settings,
            progress=told,
        )


def _check_writable(out: Path) -> None:
    """Say that results cannot be written before hours are spent on them."""
    folder = OutputFolder(out)
    folder.__enter__()
    # As after an error: the trial folder goes, and nothing takes the place of `out`.
    folder.__exit__(FileFormatError)


def _show(rows: Sequence[Row], result: TuningResult, out: Path) -> None:
    console = screen()
    console.print(summary.rich_table(rows, "Tuned"))
    say(console, str(result))
    for name, value in result.parameters.items():
        shown = ", ".join(f"{v:.4g}" for v in np.atleast_1d(value))
        say(console, f"  {name}: {shown}")
    say(console, f"{out}: tuned.toml, report.html, figures, history.csv, summary, runs (.npz)")
