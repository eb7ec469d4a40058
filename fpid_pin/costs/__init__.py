"""What a run is worth: its metrics, costs made of them, eq. (33) and its kin, and of its rows."""

from fpid_pin.costs.cost import (
    METRICS,
    REDUCTIONS,
    SETTLING_BAND,
    Cost,
    FromRows,
    Metric,
    MetricCost,
    Metrics,
    QuadraticCost,
    RowCost,
    Rows,
    SettlingCost,
    ToolCost,
    TrackingCost,
    over_joints,
    tool_distance,
)

__all__ = [
    "METRICS", "REDUCTIONS", "SETTLING_BAND", "Cost", "FromRows", "Metric", "MetricCost", "Metrics",
    "QuadraticCost", "RowCost", "Rows", "SettlingCost", "ToolCost", "TrackingCost", "over_joints",
    "tool_distance",
]  # fmt: skip
