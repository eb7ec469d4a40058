"""The plant that hurts a controller most: a search over the box that sampling goes through."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from fpid_pin import checks, own_code
from fpid_pin.campaign.chunk import Ended, Job
from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.driver import run, workers_of
from fpid_pin.campaign.execution import carry_out, pieces
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.entry import executor_of

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
        See `run`; each generation's plants are dealt out to them.
    progress
        Called now and then.
    """
    checks.integer("population", population, low=5)
    checks.integer("generations", generations, low=1)
    with executor_of(executor, workers, [study.experiment], study.laws) as pool:
        points = []
        for k, name in enumerate(study.names):

            def told(part: float, k: int = k) -> None:
                if progress is not None:
                    progress(Progress((k + part) / len(study.names)))

            alone = dataclasses.replace(study, controllers={name: study.controllers[name]})
            points.append(_worst(alone, population, generations, pool, told))
        found = dataclasses.replace(study.scenarios, points=np.array(points))
        worst = dataclasses.replace(study, scenarios=found, title=f"{study.title}: worst plants")
        return run(worst, ledger, len(points), executor=pool)


def _worst(
    study: Study,
    population: int,
    generations: int,
    executor: Executor | None,
    told: Callable[[float], None],
) -> FloatArray:
    """Return the point of the unit cube at which the study's one controller does worst."""
    # Imported late: scipy is heavy.
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    size, seed = len(study.bound.parameters), study.scenarios.seed
    doublings = math.ceil(math.log2(population))
    start = qmc.Sobol(size, rng=np.random.default_rng(seed)).random_base2(doublings)[:population]
    parts = workers_of(executor)
    done = 0

    def harm(points: FloatArray) -> FloatArray:
        nonlocal done
        scenarios = dataclasses.replace(study.scenarios, points=np.atleast_2d(points.T))
        job = Job(dataclasses.replace(study, scenarios=scenarios), own=own_code.loaded())
        count = len(np.atleast_2d(points.T))
        todo = pieces(range(count), -(-count // parts))
        cost = np.empty(count)
        for part in carry_out(job, todo, executor, parts):
            cost[part.first :][: len(part.ends)] = [-_badness(end) for (end,) in part.ends]
        done += 1
        told(min(done / (generations + 1), 1.0))
        return cost

    best = differential_evolution(
        harm, [(0.0, 1.0)] * size, init=start, maxiter=generations, rng=np.random.default_rng(seed),
        polish=False, updating="deferred", vectorized=True, tol=0.0,
    )  # fmt: skip
    return np.asarray(np.clip(best.x, 0.0, 1.0))


def _badness(end: Ended) -> float:
    rms = end.figures[0]
    return rms if math.isfinite(rms) else _LOST
