"""Tuning of controllers: costs, genetic algorithms, Pareto fronts, checkpoints."""

from fpid_pin.tuning.cost_map import CostMap, cost_map
from fpid_pin.tuning.cross_check import CrossCheck, cross_check
from fpid_pin.tuning.gene import Gene
from fpid_pin.tuning.history import History, ParetoResult, Report, TuningResult
from fpid_pin.tuning.pareto import pareto
from fpid_pin.tuning.robust import RobustCost, scenarios
from fpid_pin.tuning.space import Space
from fpid_pin.tuning.tune import tune
from fpid_pin.tuning.workers import WorkerPool

__all__ = [
    "CostMap",
    "CrossCheck",
    "Gene",
    "History",
    "ParetoResult",
    "Report",
    "RobustCost",
    "Space",
    "TuningResult",
    "WorkerPool",
    "cost_map",
    "cross_check",
    "pareto",
    "scenarios",
    "tune",
]
