"""One seed's evolution: pymoo's genetic algorithms, asked and told, with a state that is data."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray

# In place of +inf where several costs are compared: crowding distances of inf would be NaN.
_HUGE = 1e300


class Evolution:
    """A population of points in the unit cube, one generation after another.

    One cost: a genetic algorithm with binary tournaments and elitist survival. Several: NSGA-II
    (Deb, Pratap, Agarwal and Meyarivan 2002). Simulated binary crossover and polynomial mutation
    (Deb and Agrawal 1995) in both.

    Parameters
    ----------
    size, costs
        Coordinates of a point, and costs of each.
    population
        Points in a generation.
    crossover
        Probability that two parents are crossed at all.
    mutation
        Probability that a coordinate is mutated.
    seed
        Of every random choice.
    initial
        (k, size), k <= population: points that belong to the first generation.
    """

    def __init__(
        self,
        size: int,
        costs: int,
        *,
        population: int,
        crossover: float,
        mutation: float,
        seed: int,
        initial: FloatArray | None = None,
    ) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.config import Config
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM

        Config.warnings["not_compiled"] = False
        self._costs = costs
        self._initial = np.empty((0, size)) if initial is None else initial
        kind = GA if costs == 1 else NSGA2
        # prob_var = 1: a crossed pair is crossed in all coordinates; PM's own prob = 1: its
        # prob_var alone is then the probability for a coordinate.
        self._algorithm = kind(
            pop_size=population,
            crossover=SBX(prob=crossover, prob_var=1.0),
            mutation=PM(prob=1.0, prob_var=mutation),
            eliminate_duplicates=False,
        )
        self._algorithm.setup(
            Problem(n_var=size, n_obj=costs, xl=0.0, xu=1.0),
            termination=NoTermination(),
            seed=seed,
        )
        self._asked: Any = None

    def ask(self) -> FloatArray:
        """Return the points to be evaluated next, (population, size)."""
        first = not self._algorithm.is_initialized
        self._asked = self._algorithm.ask()
        if first and len(self._initial):
            points = self._asked.get("X")
            points[: len(self._initial)] = self._initial
            self._asked.set("X", points)
        return np.array(self._asked.get("X"), dtype=np.float64)

    def tell(self, costs: FloatArray) -> None:
        """Give the costs of what was asked for, (population, costs), +inf where diverged."""
        told = costs if self._costs == 1 else np.minimum(costs, _HUGE)
        self._asked.set("F", told)
        self._algorithm.tell(infills=self._asked)
        self._asked = None

    @property
    def points(self) -> FloatArray:
        """The population that survived, (population, size); empty before the first `tell`."""
        population = self._algorithm.pop
        if population is None or len(population) == 0:
            return np.empty((0, self._algorithm.problem.n_var))
        return np.array(population.get("X"), dtype=np.float64)

    @property
    def costs(self) -> FloatArray:
        """Its costs, (population, costs)."""
        population = self._algorithm.pop
        if population is None or len(population) == 0:
            return np.empty((0, self._costs))
        costs = np.array(population.get("F"), dtype=np.float64)
        return costs if self._costs == 1 else np.where(costs >= _HUGE, np.inf, costs)

    def state(self) -> dict[str, Any]:
        """Return all that the next generation depends on: arrays, and texts."""
        state: dict[str, Any] = {"points": self.points, "costs": self.costs}
        if self._costs > 1:
            population = self._algorithm.pop
            state["rank"] = np.array(population.get("rank"), dtype=np.int64)
            state["crowding"] = np.array(population.get("crowding"), dtype=np.float64)
        state["random"] = json.dumps(self._algorithm.random_state.bit_generator.state)
        state["generation"] = int(self._algorithm.n_iter)
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take up what `state` returned: everything after is the same to the last bit."""
        from pymoo.core.population import Population

        algorithm = self._algorithm
        costs = state["costs"] if self._costs == 1 else np.minimum(state["costs"], _HUGE)
        population = Population.new("X", state["points"], "F", costs)
        if self._costs > 1:
            population.set("rank", state["rank"].tolist())
            population.set("crowding", state["crowding"].tolist())
        algorithm.pop = population
        algorithm.is_initialized = True
        algorithm.n_iter = int(state["generation"])
        algorithm.start_time = 0.0
        algorithm.random_state.bit_generator.state = json.loads(str(state["random"]))
