"""How to search."""

from __future__ import annotations

from dataclasses import dataclass

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError


@dataclass(frozen=True)
class Settings:
    """How to search; see `tune`."""

    population: int = 60
    generations: int = 80
    crossover: float = 0.75
    mutation: float = 0.03
    seeds: tuple[int, ...] = (0,)
    reuse: bool = True

    def __post_init__(self) -> None:
        checks.integer("population", self.population, low=4)
        checks.integer("generations", self.generations, low=1)
        checks.number("crossover", self.crossover, low=0.0, high=1.0)
        checks.number("mutation", self.mutation, low=0.0, high=1.0)
        if not self.seeds:
            raise ArgumentError("seeds", "at least one", "none")
        for k, seed in enumerate(self.seeds):
            checks.integer(f"seeds.{k}", seed, low=0)
        if len(set(self.seeds)) < len(self.seeds):
            raise ArgumentError("seeds", "each seed once", list(self.seeds))
