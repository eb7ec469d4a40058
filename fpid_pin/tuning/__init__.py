"""Tuning of controllers: costs, genetic algorithms, Pareto fronts, checkpoints."""

from fpid_pin.simulation.workers import WorkerPool
from fpid_pin.tuning.differential_evolution import CrossCheck, cross_check
from fpid_pin.tuning.gene import Gene
from fpid_pin.tuning.history import History, ParetoResult, TuningResult
from fpid_pin.tuning.lowest_cost import tune
from fpid_pin.tuning.one_at_a_time import Profile, profile
from fpid_pin.tuning.order_grid import CostMap, cost_map
from fpid_pin.tuning.pareto_front import pareto
from fpid_pin.tuning.robust import RobustCost, scenarios
from fpid_pin.tuning.search_progress import SearchProgress
from fpid_pin.tuning.settings import SearchSettings
from fpid_pin.tuning.space import Space

__all__ = [
    "CostMap",
    "CrossCheck",
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
    "cross_check",
    "pareto",
    "profile",
    "scenarios",
    "tune",
]
