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
    initial
        (k, size), k <= population: points that belong to the first generation.
    costs
        How many each point has.
    population, crossover, mutation, seed
        See `SearchSettings`.
    """

    def __init__(
        self,
        initial: FloatArray,
        costs: int,
        *,
        population: int,
        crossover: float,
        mutation: float,
        seed: int,
    ) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.config import Config
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM

        Config.warnings["not_compiled"] = False
        self._initial, self._costs = initial, costs
        #: The population that survived, and its costs: (population, size), (population, costs).
        self.points, self.costs = np.empty((0, initial.shape[1])), np.empty((0, costs))
        kind = GA if costs == 1 else NSGA2
        # prob_var = 1: a crossed pair is crossed in all coordinates; PM's own prob = 1: its
        # prob_var alone is then the probability for a coordinate.
        self._algorithm = kind(
            pop_size=population,
            crossover=SBX(prob=crossover, prob_var=1.0),
            mutation=PM(prob=1.0, prob_var=mutation),
            eliminate_duplicates=False,
        )
        problem = Problem(n_var=initial.shape[1], n_obj=costs, xl=0.0, xu=1.0)
        self._algorithm.setup(problem, termination=NoTermination(), seed=seed)
        self._asked: Any = None

    def ask(self) -> FloatArray:
        """Return the points to be evaluated next, (population, size)."""
        first = not self._algorithm.is_initialized
        self._asked = self._algorithm.ask()
        points = np.array(self._asked.get("X"), dtype=np.float64)
        if first:
            points[: len(self._initial)] = self._initial
            self._asked.set("X", points)
        return points.copy()

    def tell(self, costs: FloatArray) -> None:
        """Give the costs of what was asked for, (population, costs), +inf where diverged."""
        self._asked.set("F", costs if self._costs == 1 else np.minimum(costs, _HUGE))
        self._algorithm.tell(infills=self._asked)
        self._look()

    def _look(self) -> None:
        population = self._algorithm.pop
        costs = np.array(population.get("F"), dtype=np.float64)
        self.points = np.array(population.get("X"), dtype=np.float64)
        self.costs = np.where(costs >= _HUGE, np.inf, costs)

    def state(self) -> dict[str, Any]:
        """Return all that the next generation depends on: arrays, and a text."""
        algorithm, state = self._algorithm, {"points": self.points, "costs": self.costs}
        if self._costs > 1:
            state["rank"] = np.array(algorithm.pop.get("rank"), dtype=np.int64)
            state["crowding"] = np.array(algorithm.pop.get("crowding"), dtype=np.float64)
        state["random"] = np.array(json.dumps(algorithm.random_state.bit_generator.state))
        state["generation"] = np.array(algorithm.n_iter)
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take up what `state` returned: everything after is the same to the last bit."""
        from pymoo.core.population import Population

        algorithm, costs = self._algorithm, state["costs"]
        told = costs if self._costs == 1 else np.minimum(costs, _HUGE)
        algorithm.pop = Population.new("X", state["points"], "F", told)
        for name in ("rank", "crowding") if self._costs > 1 else ():
            algorithm.pop.set(name, state[name].tolist())
        algorithm.is_initialized = True
        algorithm.n_iter = int(state["generation"])
        algorithm.start_time = 0.0
        algorithm.random_state.bit_generator.state = json.loads(str(state["random"]))
        self._look()
