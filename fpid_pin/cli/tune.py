"""The body of ``fpid-pin tune``: search, and write what was found."""

from __future__ import annotations

import dataclasses
import filecmp
import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from fpid_pin.cli import summary
from fpid_pin.cli.config import load
from fpid_pin.cli.executors import executor_for
from fpid_pin.cli.keep import ALL, Keep
from fpid_pin.cli.output import output_folder
from fpid_pin.cli.screen import print_table, say, screen
from fpid_pin.cli.search_bar import search_bar
from fpid_pin.cli.summary import Row
from fpid_pin.cli.tune_parameters import explore, what_mattered
from fpid_pin.cli.tune_plan import Plan, read_plan
from fpid_pin.cli.tune_results import compare, draw, write
from fpid_pin.exceptions import FpidError
from fpid_pin.files import discard, replacing
from fpid_pin.tuning import TuningResult, tune

#: The checkpoint within the folder of results.
KEPT = "checkpoint.npz"


def run_tuning(
    path: Path,
    out: Path,
    resume: bool = False,
    workers: int | None = None,
    keep: Keep = ALL,
    dask: str | None = None,
) -> TuningResult:
    """Search as a configuration says, and write the folder `out`.

    The search's checkpoint lies beside `out` until the folder is written, with it inside.

    Raises
    ------
    ConfigError, FileFormatError, TuningError
        What is wrong, `out` cannot be written (before the search starts), or see `tune`.
    """
    config = load(path)
    plan = read_plan(config)
    experiments = list(plan.experiments.values())
    checkpoint = out.with_name(f"{out.name}.checkpoint.npz")
    # Entered before hours are spent: what cannot be written is told now.
    with output_folder(out) as folder:
        _take_up(checkpoint, out / KEPT, resume)
        with ExitStack() as stack:
            pool = stack.enter_context(executor_for(workers, dask, experiments, [plan.controller]))
            try:
                result = _search(plan, pool, checkpoint, resume)
            except KeyboardInterrupt:
                say(screen(error=True), f"{checkpoint}: --resume goes on from here")
                raise
            except FpidError:
                # Refused before it went on, a search has not touched what it took up.
                _drop_copy(checkpoint, out / KEPT)
                raise
            along = explore(plan, result, pool)
            figures = draw(plan, result, along, pool)
        entries = compare(plan, result)
        rows = write(folder, out, config, plan, result, entries, figures, along, keep)
        # In the folder before this takes its place: at no moment is there one without it.
        shutil.copyfile(checkpoint, folder / KEPT)
    discard(checkpoint)
    _show(rows, result, what_mattered(along), out)
    return result


def _take_up(checkpoint: Path, kept: Path, resume: bool) -> None:
    """Find the checkpoint to go on from where the last search has left it.

    While a search goes on its checkpoint lies beside the folder, at its end in it; killed in
    between, a search leaves two that are equal.
    """
    _drop_copy(checkpoint, kept)
    if resume and kept.is_file() and not checkpoint.exists():
        with replacing(checkpoint) as temporary:
            shutil.copyfile(kept, temporary)


def _drop_copy(checkpoint: Path, kept: Path) -> None:
    both = checkpoint.is_file() and kept.is_file()
    if both and filecmp.cmp(checkpoint, kept, shallow=False):
        discard(checkpoint)


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


def _show(rows: Sequence[Row], result: TuningResult, more: Sequence[str], out: Path) -> None:
    console = screen()
    for line in (*result.advice, *more):
        say(console, line)
    print_table(console, summary.rich_table(rows, "Tuned"))
    say(console, str(result))
    for name, value in result.parameters.items():
        shown = ", ".join(f"{v:.4g}" for v in np.atleast_1d(value))
        say(console, f"  {name}: {shown}")
    say(console, f"{out}: tuned.toml, report.html, figures, history.csv, summary, runs (.npz)")
