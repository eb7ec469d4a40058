"""The body of ``fpid-pin tune``: search, and write what was found."""

from __future__ import annotations

import dataclasses
import filecmp
import shutil
from pathlib import Path

import numpy as np

from fpid_pin.cli.campaign import executor_of
from fpid_pin.cli.comparison import simulate_pairs
from fpid_pin.cli.configuration import load
from fpid_pin.cli.output import output_folder
from fpid_pin.cli.plans import read_plan
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.results import OutputOptions
from fpid_pin.cli.table import print_table, say
from fpid_pin.cli.tuned import (
    cost_rows,
    explore,
    rivals,
    search_figures,
    what_mattered,
    write_tuned,
)
from fpid_pin.exceptions import FpidError
from fpid_pin.files import discard, replacing
from fpid_pin.simulation import entry
from fpid_pin.tuning import TuningResult, tune

#: The checkpoint within the folder of results.
KEPT = "checkpoint.npz"


def run_tuning(
    path: Path,
    out: Path,
    resume: bool = False,
    workers: int | None = None,
    options: OutputOptions | None = None,
    dask: str | None = None,
) -> TuningResult:
    """Search as a configuration says, and write the folder `out`.

    The search's checkpoint lies beside `out` until the folder is written, with it inside.

    Raises
    ------
    ConfigError, FileFormatError, TuningError
        What is wrong, `out` cannot be written (before the search starts), or see `tune`.
    """
    scheduler = executor_of(workers, dask)
    config = load(path)
    plan = read_plan(config)
    experiments = list(plan.experiments.values())
    checkpoint = out.with_name(f"{out.name}.checkpoint.npz")
    # Entered before hours are spent: what cannot be written is told now.
    with output_folder(out) as folder:
        _take_up(checkpoint, out / KEPT, resume)
        with (
            scheduler as far,
            entry.executor_of(far, workers, experiments, [plan.controller]) as pool,
        ):
            settings = dataclasses.replace(
                plan.settings, executor=pool, checkpoint=checkpoint, resume=resume
            )
            try:
                with progress_bar("search") as bar:
                    result = tune(
                        experiments, plan.controller, plan.space, plan.cost, settings, progress=bar
                    )
            except KeyboardInterrupt:
                if checkpoint.exists():
                    say(f"{checkpoint}: --resume goes on from here", error=True)
                raise
            except FpidError:
                # Refused before it went on, a search has not touched what it took up.
                _drop_copy(checkpoint, out / KEPT)
                raise
            along = explore(plan, result, pool)
            figures = search_figures(plan, result, along, pool)
        entries = simulate_pairs(plan.experiments, rivals(plan, result), taken=["checkpoint"])
        options = options or OutputOptions()
        write_tuned(folder, out, config, plan, result, entries, figures, along, options)
        # In the folder before this takes its place: at no moment is there one without it.
        shutil.copyfile(checkpoint, folder / KEPT)
    discard(checkpoint)
    say(*result.advice, *what_mattered(along))
    print_table(cost_rows(plan, entries), "Tuned")
    say(str(result))
    for name, value in result.parameters.items():
        say(f"  {name}: {', '.join(f'{v:.4g}' for v in np.atleast_1d(value))}")
    say(f"{out}: tuned.toml, report.html, figures, history.csv, summary, runs (.npz)")
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
