"""What a run is worth: its metrics, costs made of them, eq. (33) and its kin, and of its rows."""

from fpid_pin.costs.cost import (
    Cost,
    FromRows,
    MetricCost,
    QuadraticCost,
    RowCost,
    Rows,
    SettlingCost,
    ToolCost,
    TrackingCost,
    tool_distance,
)
from fpid_pin.costs.metrics import (
    METRICS,
    REDUCTIONS,
    SETTLING_BAND,
    Metric,
    Metrics,
    over_joints,
)

__all__ = [
    "METRICS", "REDUCTIONS", "SETTLING_BAND", "Cost", "FromRows", "Metric", "MetricCost", "Metrics",
    "QuadraticCost", "RowCost", "Rows", "SettlingCost", "ToolCost", "TrackingCost", "over_joints",
    "tool_distance",
]  # fmt: skip
