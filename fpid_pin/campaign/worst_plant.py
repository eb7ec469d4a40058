"""The plant that hurts a controller most: a search over the box that sampling goes through."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.driver import run, run_chunk
from fpid_pin.campaign.ledger import COLUMNS
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray
from fpid_pin.control import Controller
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.workers import distribute, executor_of, workers_of


def attack(
    study: Study, ledger: str | Path, *, population: int = 32, generations: int = 40,
    executor: Executor | None = None, workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> CampaignData:  # fmt: skip
    """Search each controller's worst plant, by SciPy's differential evolution, and record it.

    A run that does not come to its end is worse than one that does, and else the larger RMS error.

    Parameters
    ----------
    study
        The campaign; its scenarios' seed is that of the search too.
    ledger
        A new file: run k is the worst plant of controller k, under every controller; it can be
        replayed, as it is a campaign of those points.
    population, generations
        Plants tried at once for each controller, and how often.
    executor, workers, progress
        See `run`; each generation's plants are dealt out.
    """
    # Imported late: scipy is heavy.
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    checks.integer("population", population, low=5)
    checks.integer("generations", generations, low=1)
    size, seed, calls = len(study.parameters), study.scenarios.seed, 0
    start = qmc.Sobol(size, rng=np.random.default_rng(seed))
    first = start.random_base2(math.ceil(math.log2(population)))[:population]

    with executor_of(executor, workers, [study.experiment], study.laws) as pool:

        def cost(columns: FloatArray, law: Controller) -> FloatArray:
            nonlocal calls
            points, errors = np.atleast_2d(columns.T), np.empty(columns.size // size)
            scenarios = replace(study.scenarios, points=points)
            alone = replace(study, controllers={"searched": law}, scenarios=scenarios)
            cuts = np.array_split(np.arange(len(errors)), min(workers_of(pool), len(errors)))
            for k, rows in distribute(run_chunk, [(alone, cut.tolist()) for cut in cuts], pool):
                errors[cuts[k]] = [row[COLUMNS.index("rms")] for row in rows]
            calls += 1
            if progress is not None:
                progress(Progress(min(calls / len(study.laws) / (generations + 1), 1.0)))
            return -np.where(np.isfinite(errors), errors, 1e6)  # no run that ends is as bad

        worst = [
            differential_evolution(
                cost, [(0.0, 1.0)] * size, (law,), init=first, maxiter=generations, tol=0.0,
                rng=np.random.default_rng(seed), polish=False, updating="deferred", vectorized=True,
            ).x.clip(0.0, 1.0)
            for law in study.laws
        ]  # fmt: skip
        scenarios = replace(study.scenarios, points=np.array(worst))
        found = replace(study, scenarios=scenarios, title=f"{study.title}: worst plants")
        return run(found, ledger, len(worst), executor=pool)
