"""What a run is worth: its metrics, costs made of them, eq. (33) and its kin, and of its rows."""

from fpid_pin.costs.cost import Cost, FromRows, RowCost, Rows
from fpid_pin.costs.figures import (
    METRIC_NAMES,
    REDUCTIONS,
    SETTLING_BAND,
    Metrics,
    over_joints,
)
from fpid_pin.costs.metric import MetricCost, QuadraticCost
from fpid_pin.costs.path import SettlingCost, ToolCost, tool_distance

__all__ = [
    "METRIC_NAMES",
    "REDUCTIONS",
    "SETTLING_BAND",
    "Cost",
    "FromRows",
    "MetricCost",
    "Metrics",
    "QuadraticCost",
    "RowCost",
    "Rows",
    "SettlingCost",
    "ToolCost",
    "over_joints",
    "tool_distance",
]
