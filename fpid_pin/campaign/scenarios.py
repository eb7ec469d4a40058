"""Which plants a campaign goes through: run k's depend on the seed and on k, on nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin.campaign.distributions import Distribution
from fpid_pin.campaign.quantities import QUANTITIES, require_possible, varied
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.simulation import Experiment
from fpid_pin.text import shown

SAMPLINGS = ("sobol", "latin_hypercube")
#: Points that are made at once, from run 0 on: a hypercube of so many runs, whatever is asked for.
BLOCK = 256


@dataclass(frozen=True, eq=False)
class Scenarios:
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

    uncertain: Mapping[str, Distribution]
    sampling: str = "sobol"
    seed: int = 0
    points: ArrayLike | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.uncertain, Mapping) or not self.uncertain:
            raise ArgumentError("uncertain", "at least one quantity with its distribution", "none")
        for key, spread in self.uncertain.items():
            _require_possible(key, spread)
        object.__setattr__(self, "uncertain", dict(self.uncertain))
        checks.choice("sampling", self.sampling, SAMPLINGS)
        object.__setattr__(self, "seed", checks.integer("seed", self.seed, low=0))
        if self.points is not None:
            points = checks.floats("points", self.points, low=0.0, high=1.0)
            if points.ndim != 2:
                raise ArgumentError("points", "shape (runs, numbers)", f"shape {points.shape}")
            object.__setattr__(self, "points", points)

    def bind(self, experiment: Experiment) -> BoundScenarios:
        """Return the scenarios of an experiment.

        Raises
        ------
        ArgumentError
            A quantity that it does not have; numbers for another number of joints.
        """
        return BoundScenarios(self, experiment)

    def to_dict(self) -> dict[str, Any]:
        """Return a plain table, for `from_table`."""
        spreads = {key: descriptions.to_dict(value) for key, value in self.uncertain.items()}
        table = {"sampling": self.sampling, "seed": self.seed, "uncertain": spreads}
        return (
            table if self.points is None else table | {"points": np.asarray(self.points).tolist()}
        )

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: str, faults: list[FpidError]) -> Any:
        """Return the scenarios that a table holds, or None with every fault in `faults`."""
        before, spreads = len(faults), {}
        uncertain = table.get("uncertain", {})
        if not isinstance(uncertain, Mapping):
            faults.append(ArgumentError(f"{path}.uncertain", "a table", shown(uncertain)))
            return None

        def attempt(action: Callable[[], Any]) -> Any:
            try:
                return action()
            except ArgumentError as error:
                faults.append(ArgumentError(f"{path}.{error.name}", error.expected, error.got))
                return None

        for key, value in uncertain.items():
            where = f"{path}.uncertain.{key}"
            spread = descriptions.build(value, Distribution, where, faults)
            if spread is not None:
                attempt(partial(_require_possible, key, spread))
            spreads[key] = spread
        if len(faults) > before:
            return None
        given = {key: table[key] for key in ("sampling", "seed", "points") if key in table}
        return attempt(lambda: cls(spreads, **given))


def _require_possible(key: str, spread: Distribution) -> None:
    """Refuse a distribution with values that its quantity cannot have."""
    path = f"uncertain.{key}"
    quantity = QUANTITIES[checks.choice(path, key, QUANTITIES)]
    checks.instance(path, spread, Distribution, "a distribution")
    limits: dict[str, Any] = {}
    if np.isfinite(quantity.above):
        limits["above"] = quantity.above
    elif np.isfinite(quantity.low):
        limits["low"] = quantity.low
    for name, numbers in spread.numbers().items():
        checks.floats(f"{path}.{name}", numbers, **limits)
        if quantity.whole and name == "values" and (numbers != np.round(numbers)).any():
            raise ArgumentError(f"{path}.{name}", "whole numbers", numbers.tolist())
        if not quantity.each and name != "values" and numbers.ndim:
            raise ArgumentError(f"{path}.{name}", "one number", f"shape {numbers.shape}")
    if not quantity.each and spread.shared:
        raise ArgumentError(f"{path}.shared", "false, as there is one number", "true")


@dataclass(frozen=True, eq=False)
class BoundScenarios:
    """Scenarios of one experiment: run k's sample, and the experiment that it is."""

    scenarios: Scenarios
    nominal: Experiment

    def __post_init__(self) -> None:
        n = self.nominal.arm.n
        for key, spread in self.scenarios.uncertain.items():
            try:
                require_possible(self.nominal, key)
                for name, numbers in spread.numbers().items():
                    if name != "values" and not spread.shared:
                        checks.spread(f"{key}.{name}", numbers, n)
                    elif name != "values" and numbers.ndim:
                        expected = "one number, as it is shared"
                        raise ArgumentError(f"{key}.{name}", expected, f"shape {numbers.shape}")
            except ArgumentError as error:
                raise ArgumentError(f"uncertain.{error.name}", error.expected, error.got) from None
        points, size = self.scenarios.points, len(self.parameters)
        if points is not None and np.shape(points)[1] != size:
            raise ArgumentError("points", f"shape (runs, {size})", f"shape {np.shape(points)}")

    @cached_property
    def _columns(self) -> dict[str, slice]:
        """Return the columns of each quantity in a sample."""
        columns, start = {}, 0
        for key, spread in self.scenarios.uncertain.items():
            alone = spread.shared or not QUANTITIES[key].each
            stop = start + (1 if alone else self.nominal.arm.n)
            columns[key] = slice(start, stop)
            start = stop
        return columns

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Labels of a sample's numbers: ``"payload"``, ``"viscous_friction.0"``."""
        labels: list[str] = []
        for key, place in self._columns.items():
            spread = self.scenarios.uncertain[key]
            alone = spread.shared or not QUANTITIES[key].each
            labels += [key] if alone else [f"{key}.{j}" for j in range(place.stop - place.start)]
        return tuple(labels)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of a sample's numbers."""
        return tuple(QUANTITIES[label.split(".")[0]].unit for label in self.parameters)

    def samples(self, first: int, last: int) -> FloatArray:
        """Return the values of runs `first` to `last` - 1, (runs, parameters)."""
        return self.values(self._points(first, last))

    def values(self, points: FloatArray) -> FloatArray:
        """Return the values at points of the unit cube, (runs, parameters)."""
        values = np.empty(points.shape)
        for key, place in self._columns.items():
            quantity = QUANTITIES[key]
            low = quantity.above if np.isfinite(quantity.above) else quantity.low
            found = self.scenarios.uncertain[key].quantile(points[:, place], low, np.inf)
            values[:, place] = np.round(found) if quantity.whole else found
        return values

    def experiment(self, run: int, sample: FloatArray) -> Experiment:
        """Return the experiment of a run from its sample, (parameters,)."""
        values = {key: sample[place] for key, place in self._columns.items()}
        # Points are compared, and found again under another number.
        index = run if self.scenarios.points is None else 0
        noise = np.random.SeedSequence([self.scenarios.seed, index]).generate_state(1, np.uint64)
        return varied(self.nominal, values, int(noise[0]))

    def _points(self, first: int, last: int) -> FloatArray:
        given = self.scenarios.points
        if given is not None:
            if last > len(np.asarray(given)):
                raise ArgumentError("runs", f"at most {len(np.asarray(given))} (points)", last)
            return np.asarray(given)[first:last]
        blocks = range(first // BLOCK, (last - 1) // BLOCK + 1)
        how = self.scenarios.sampling, self.scenarios.seed, len(self.parameters)
        points = np.concatenate([_block(*how, k) for k in blocks])
        skipped = blocks.start * BLOCK
        return np.asarray(points[first - skipped : last - skipped])


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
