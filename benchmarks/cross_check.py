"""Another optimiser on the same problem: if it finds something better, the first one failed."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import differential_evolution

import fpid_pin as fp
from fpid_pin.costs import Cost
from fpid_pin.tuning import SearchSettings, Space


def cross_check(
    experiment: fp.Experiment,
    controller: fp.Controller,
    space: Space,
    cost: Cost,
    settings: SearchSettings,
) -> tuple[fp.Controller, float, int]:
    """Search by SciPy's differential evolution (Storn and Price 1997); see `fp.tune`.

    Returns the best controller of all seeds, its cost, and how many candidates there were.
    """
    bound = space.bind(controller, experiment.arm.n)
    multiple = math.ceil(settings.population / bound.size)

    def costs(columns: np.ndarray) -> np.ndarray:
        laws = [bound.controller(point, "differential evolution") for point in columns.T]
        return fp.evaluate(experiment, laws, cost, workers=settings.workers)

    ends = [
        differential_evolution(
            costs, [(0.0, 1.0)] * bound.size, popsize=multiple, maxiter=settings.generations - 1,
            tol=0.0, rng=np.random.default_rng(seed), polish=False, vectorized=True,
            updating="deferred",
        )
        for seed in settings.seeds
    ]  # fmt: skip
    best = min(ends, key=lambda end: end.fun)
    return bound.controller(best.x), float(best.fun), sum(end.nfev for end in ends)
