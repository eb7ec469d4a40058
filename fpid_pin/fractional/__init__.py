"""Fractional derivatives of order 0 to 1, streaming and of recorded signals."""

from fpid_pin.fractional.bank import Bank
from fpid_pin.fractional.crone import Crone
from fpid_pin.fractional.definitions import (
    L1,
    GrunwaldLetnikov,
    caputo,
    grunwald_letnikov,
    riemann_liouville,
)
from fpid_pin.fractional.design import Design, Modes
from fpid_pin.fractional.exponential_sum import ExponentialSum
from fpid_pin.fractional.operator_report import OperatorReport, report, state_space

__all__ = [
    "L1", "Bank", "Crone", "Design", "ExponentialSum", "GrunwaldLetnikov", "Modes",
    "OperatorReport", "caputo", "grunwald_letnikov", "report", "riemann_liouville", "state_space",
]  # fmt: skip
