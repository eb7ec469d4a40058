"""Compiles an exported folder where there is a compiler, and says in its README what it does."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export.law import template

if TYPE_CHECKING:
    from fpid_pin.control.state import State

#: How the suite and `export_c` compile: what a careful project would ask for.
FLAGS = (
    "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Werror",
    "-ffp-contract=off", "-O2",
)  # fmt: skip
_SECONDS = 300
#: Horizon, in steps, from which float32 spoils a fractional integral by more than 0.1 %: its 24
#: bits hold 1 - p h of a slow mode, and sums that grow by less than 6e-8 of themselves stand still.
MOST_SINGLE_STEPS = 500_000

_EXACT = """In `double`, with `-ffp-contract=off`, the torques are those of the simulation to the
last bit: sums and products only, in the same order."""
_CLOSE = """In `double` the torques are those of the simulation to within 1e-12 of the largest:
sines, cosines and exponentials differ in last bits."""

#: Measured over the horizon, orders 0.1 to 0.99 (benchmarks/exported_float.py).
_SINGLE = """`float` {verdict}: the horizon is {steps} steps. It costs a long memory, as a part of
the largest value, of I^lambda e 5e-05 over 20,000 steps, 2e-04 over 200,000, 6e-03 over 3,600,000;
of D^mu e 2e-05 at most. So it is not advised with lambda below 1 from {most} steps on: slow modes
decay by less a tick than 24 bits can say."""


def compiler() -> str | None:
    """Return a C compiler that knows gcc's flags; None: there is none."""
    return next((found for name in ("gcc", "clang", "cc") if (found := shutil.which(name))), None)


def compile_check(folder: Path, to: Path, flags: Sequence[str] = ()) -> Path:
    """Compile an exported folder and its check to the program `to`."""
    names = ("fpid.c", "fpid_parameters.c", "fpid_check.c")
    return _compile(folder, [str(folder / name) for name in names], to, (*flags, "-lm"))


def _compile(folder: Path, sources: Sequence[str], to: Path, flags: Sequence[str]) -> Path:
    """Call the compiler; its first complaint is an ExportError."""
    command = [compiler() or "cc", *FLAGS, *sources, "-o", str(to), *flags]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ExportError(f"{command[0]}: cannot compile ({type(error).__name__})") from None
    if done.returncode:
        complaint = next((line for line in done.stderr.splitlines() if "error" in line), "failed")
        raise ExportError(f"{Path(command[0]).name}: {complaint.replace(str(folder), folder.name)}")
    return to


def check(folder: Path, flags: Sequence[str] = (), torques: Path | None = None) -> str:
    """Return what ``fpid_check`` says of the vectors; `torques` receives its own, as doubles."""
    with tempfile.TemporaryDirectory() as there:
        program = compile_check(folder, Path(there) / "check", flags)
        command = [str(x) for x in (program, folder / "vectors.bin", torques) if x]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    if done.stderr or not done.stdout:
        raise ExportError(f"fpid_check: {done.stderr.strip()[:200]}")
    return done.stdout.strip()


def _size(folder: Path, source: str, flags: Sequence[str]) -> str:
    """Return how many bytes a file is, compiled at -Os here; a dash where nobody knows."""
    if (tool := shutil.which("size")) is None:
        return "–"
    with tempfile.TemporaryDirectory() as there:
        path = str(folder / source)
        target = _compile(folder, [path], Path(there) / "fpid.o", (*flags, "-Os", "-c"))
        listed = subprocess.run([tool, str(target)], capture_output=True, text=True, check=True)
    return listed.stdout.split("\n")[1].split()[0]


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
    if compiler() is None:
        return "", "Not measured here, for want of a compiler: `fpid_check vectors.bin` prints it."
    rows, lines = [], []
    for what, flags in (("double", []), ("float", ["-DFPID_SINGLE"])):
        try:
            found, state = check(folder, flags).split("; a state takes ")
            constants, code = (_size(folder, x, flags) for x in ("fpid_parameters.c", "fpid.c"))
        except ExportError as error:
            lines.append(f"- `{what}`: {error}")
            continue
        rows.append(f"| {what} | {state.split()[0]} | {constants} | {code} |")
        lines.append(f"- `{what}`: {found}.")
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
