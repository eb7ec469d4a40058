"""Which plants a campaign goes through: run k's depend on the seed and on k, on nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.campaign.distributions import Distribution
from fpid_pin.campaign.quantities import require_values
from fpid_pin.checks import Array, Check, FloatArray, OneOf, Whole
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError

#: Points that are made at once, from run 0 on: a hypercube of so many runs, whatever is asked for.
BLOCK = 256


@described("scenarios")
@dataclass(frozen=True, eq=False)
class Scenarios(Description):
    """What is uncertain, and how it is sampled.

    Parameters
    ----------
    uncertain
        Distributions by quantity: masses and inertias of the links, payload, friction, ... (see
        `quantities.QUANTITIES`). One of joints is drawn for each by itself, or ``shared``.
    sampling
        ``"sobol"``: one scrambled Sobol sequence (Owen, 1998); ``"latin_hypercube"``: one of every
        256 runs. Both by ``scipy.stats.qmc``.
    seed
        What the samples derive from, noise included.
    points
        Runs' points of the unit cube, (runs, numbers), in place of samples: run k has the
        quantiles at ``points[k]``; all have the same noise.

    Notes
    -----
    Run k has the same sample however many runs there are, and whoever computes it; all controllers
    meet it. A quantity more or less is another cube, and other samples.

    Raises
    ------
    ArgumentError
        An unknown quantity, an impossible value (a negative mass), naming the key.
    """

    uncertain: Annotated[Mapping[str, Distribution], Check(require_values)]
    sampling: Annotated[str, OneOf("sobol", "latin_hypercube")] = "sobol"
    seed: Annotated[int, Whole(low=0)] = 0
    points: Annotated[ArrayLike | None, Array(low=0.0, high=1.0, shape=(None, None))] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.uncertain:
            raise ArgumentError("uncertain", "at least one quantity with its distribution", "none")

    def cube(self, first: int, last: int, size: int) -> FloatArray:
        """Return the points of runs `first` to `last` - 1 in the unit cube, (runs, size)."""
        if self.points is not None:
            return np.asarray(self.points)[first:last]
        blocks = range(first // BLOCK, (last - 1) // BLOCK + 1)
        points = np.concatenate([_block(self.sampling, self.seed, size, k) for k in blocks])
        skipped = blocks.start * BLOCK
        return np.asarray(points[first - skipped : last - skipped])

    def noise_seed(self, run: int) -> int:
        """Return the seed of a run's noise."""
        # Points are compared, and found again under another number.
        index = run if self.points is None else 0
        return int(np.random.SeedSequence([self.seed, index]).generate_state(1, np.uint64)[0])


@lru_cache(4)
def _block(sampling: str, seed: int, size: int, k: int) -> FloatArray:
    """Return the points of block `k`, (BLOCK, size); a few are kept, as chunks come in order."""
    # Imported late: scipy is heavy.
    from scipy.stats import qmc

    if sampling == "sobol":
        sobol = qmc.Sobol(size, rng=np.random.default_rng(seed))
        if k:
            sobol.fast_forward(k * BLOCK)
        return np.asarray(sobol.random(BLOCK))
    rng = np.random.default_rng(np.random.SeedSequence([seed, k]))
    return np.asarray(qmc.LatinHypercube(size, rng=rng).random(BLOCK))
