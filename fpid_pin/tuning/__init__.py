"""Tuning of controllers: costs, genetic algorithms, Pareto fronts, checkpoints."""

from fpid_pin.simulation.workers import WorkerPool
from fpid_pin.tuning.entry import cost_map, pareto, profile, tune
from fpid_pin.tuning.problem import RobustCost, SearchSettings, scenarios
from fpid_pin.tuning.results import CostMap, History, ParetoResult, Profile, TuningResult
from fpid_pin.tuning.search import SearchProgress
from fpid_pin.tuning.space import Gene, Space

__all__ = [
    "CostMap",
    "Gene",
    "History",
    "ParetoResult",
    "Profile",
    "RobustCost",
    "SearchProgress",
    "SearchSettings",
    "Space",
    "TuningResult",
    "WorkerPool",
    "cost_map",
    "pareto",
    "profile",
    "scenarios",
    "tune",
]
