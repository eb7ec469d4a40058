"""The README of an exported controller: what it is, what it takes, how exact it is."""

from __future__ import annotations

import tempfile
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export import build
from fpid_pin.export.c_source import template

if TYPE_CHECKING:
    from fpid_pin.control.state import State

#: Horizon, in steps, from which float32 spoils a fractional integral by more than 0.1 %: its 24
#: bits hold 1 - p h of a slow mode, and sums that grow by less than 6e-8 of themselves stand still.
MOST_SINGLE_STEPS = 500_000


def readme(state: State, folder: Path, exact: bool) -> str:
    """Return the README; where there is a compiler, with what it says."""
    table, proof = _measured(folder)
    return Template(template("README.md")).substitute(
        version=__version__, name=type(state.controller).__name__, n=state.n,
        step=f"{state.step:g}", horizon=f"{state.horizon:g}", table=table, proof=proof,
        exactness=_EXACT if exact else _CLOSE, single=_single(state),
        fields=", ".join(f"`.{name}`" for name in state.record.names),
    )  # fmt: skip


def _measured(folder: Path) -> tuple[str, str]:
    """Return what it takes, and how far its torques are from the vectors', in both precisions."""
    if build.compiler() is None:
        return "", "Not measured here, for want of a compiler: `fpid_check vectors.bin` prints it."
    rows, lines = [], []
    for what, flags in (("double", []), ("float", ["-DFPID_SINGLE"])):
        try:
            with tempfile.TemporaryDirectory() as there:
                program = build.compile_check(folder, Path(there) / what, flags)
                found = build.compare(program, folder / "vectors.bin")
        except ExportError as error:
            lines.append(f"- `{what}`: {error}")
            continue
        code, constants = build.sizes(folder, flags)
        rows.append(f"| {what} | {found.state} | {constants} | {code} |")
        part = found.difference / found.peak if found.peak else 0.0
        lines.append(
            f"- `{what}`: {found.equal} of {found.total} torques equal to the last bit; "
            f"largest difference {found.difference:.2e} N m, {part:.1e} of the largest torque "
            f"({found.peak:.3g} N m), over {found.ticks} ticks."
        )
    return "\n".join(rows), "\n".join(lines)


def _single(state: State) -> str:
    orders, steps = state.orders, round(state.horizon / state.step)
    if not orders.size:
        return ""
    fractional = bool(np.any((orders > 0.0) & (orders < 1.0)))
    poor = steps > MOST_SINGLE_STEPS and fractional
    return _SINGLE.format(
        verdict="is **not advised** here" if poor else "may do here", steps=f"{steps:,}",
        most=f"{MOST_SINGLE_STEPS:,}",
    )  # fmt: skip


_EXACT = """In `double`, with `-ffp-contract=off`, the torques are those of the simulation to the
last bit: sums and products only, in the same order."""
_CLOSE = """In `double` the torques are those of the simulation to within 1e-12 of the largest:
sines, cosines and exponentials differ in last bits."""

#: Measured over the horizon, orders 0.1 to 0.99 (benchmarks/exported_float.py).
_SINGLE = """`float` {verdict}: the horizon is {steps} steps. It costs a long memory, as a part of
the largest value, of I^lambda e 5e-05 over 20,000 steps, 2e-04 over 200,000, 6e-03 over 3,600,000;
of D^mu e 2e-05 at most. So it is not advised with lambda below 1 from {most} steps on: slow modes
decay by less a tick than 24 bits can say."""
