"""The plant that hurts a controller most: a search over the box that sampling goes through."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.campaign.chunk import Ended, Job, run_chunk
from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.driver import run
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray
from fpid_pin.progress import Progress, ProgressCallback

#: Worse than any error of a run that came to its end [rad].
_LOST = 1e6


def attack(
    study: Study,
    ledger: str | Path,
    *,
    population: int = 32,
    generations: int = 40,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> CampaignData:
    """Search each controller's worst plant by differential evolution, and record what was found.

    The search is over the unit cube of the scenarios, by ``scipy.optimize``: a run that does not
    come to its end is worse than one that does, and else the larger RMS error.

    Parameters
    ----------
    study
        The campaign; its scenarios' seed is that of the search too.
    ledger
        A new file: run k is the worst plant of controller k, under every controller; it can be
        replayed, as it is a campaign of those points.
    population, generations
        Of the search: plants that are tried for each controller are at most their product.
    executor, workers
        See `run`; for the recording. The search is in this process.
    progress
        Called now and then.
    """
    checks.integer("population", population, low=5)
    checks.integer("generations", generations, low=1)
    points = []
    for k, name in enumerate(study.names):

        def told(part: float, k: int = k) -> None:
            if progress is not None:
                progress(Progress((k + part) / len(study.names)))

        points.append(_worst(study, name, population, generations, told))
    found = dataclasses.replace(study.scenarios, points=np.array(points))
    worst = dataclasses.replace(study, scenarios=found, title=f"{study.title}: worst plants")
    return run(worst, ledger, len(points), executor=executor, workers=workers)


def _worst(study: Study, name, population, generations, told) -> FloatArray:
    """Return the point of the unit cube at which a controller does worst."""
    # Imported late: scipy is heavy.
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    alone = dataclasses.replace(study, controllers={name: study.controllers[name]})
    size, seed = len(study.bound.parameters), study.scenarios.seed
    start = qmc.Sobol(size, rng=np.random.default_rng(seed)).random_base2(
        math.ceil(math.log2(population))
    )[:population]
    done = 0

    def harm(points: FloatArray) -> FloatArray:
        nonlocal done
        scenarios = dataclasses.replace(study.scenarios, points=np.atleast_2d(points.T))
        job = Job(dataclasses.replace(alone, scenarios=scenarios))
        ends = run_chunk(job, 0, len(np.atleast_2d(points.T))).ends
        done += 1
        told(min(done / (generations + 1), 1.0))
        return -np.array([_badness(end) for (end,) in ends])

    best = differential_evolution(
        harm, [(0.0, 1.0)] * size, init=start, maxiter=generations, rng=np.random.default_rng(seed),
        polish=False, updating="deferred", vectorized=True, tol=0.0,
    )  # fmt: skip
    return np.clip(best.x, 0.0, 1.0)


def _badness(end: Ended) -> float:
    rms = end.figures[0]
    return rms if math.isfinite(rms) else _LOST
