"""Fractional derivatives of order 0 to 1, streaming and of recorded signals."""

from fpid_pin.fractional.bank import Bank
from fpid_pin.fractional.crone import Crone, RefinedOustaloup
from fpid_pin.fractional.definitions import caputo, grunwald_letnikov, riemann_liouville
from fpid_pin.fractional.design import Design
from fpid_pin.fractional.exponential_sum import ExponentialSum
from fpid_pin.fractional.history import L1, GrunwaldLetnikov
from fpid_pin.fractional.interop import (
    fpid_state_space,
    state_space,
    to_control,
    zeros_poles_gain,
)
from fpid_pin.fractional.measure import report
from fpid_pin.fractional.modes import Modes
from fpid_pin.fractional.operator_report import OperatorReport
from fpid_pin.fractional.response import frequency_response, kernel_error, noise_gains

__all__ = [
    "L1",
    "Bank",
    "Crone",
    "Design",
    "ExponentialSum",
    "GrunwaldLetnikov",
    "Modes",
    "OperatorReport",
    "RefinedOustaloup",
    "caputo",
    "fpid_state_space",
    "frequency_response",
    "grunwald_letnikov",
    "kernel_error",
    "noise_gains",
    "report",
    "riemann_liouville",
    "state_space",
    "to_control",
    "zeros_poles_gain",
]
