"""The README of an exported controller: what it is, what it takes, how exact it is."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export import build
from fpid_pin.export.kinds import INT, REAL, Record
from fpid_pin.export.parts import Law, Part

#: Horizon, in steps, from which float32 spoils a fractional integral by more than 0.1 %: its 24
#: bits hold 1 - p h of a slow mode, and sums that grow by less than 6e-8 of themselves stand still.
MOST_SINGLE_STEPS = 500_000
#: Measured over the horizon, orders 0.1 to 0.99 (benchmarks/exported_float.py): steps, error of
#: I^lambda e and of D^mu e, parts of the largest.
SINGLE_ERRORS = ((20_000, 5e-5, 4e-6), (200_000, 2e-4, 7e-6), (600_000, 2e-3, 2e-5),
                 (3_600_000, 6e-3, 1e-5))  # fmt: skip


def size_of(law: Law, part: Part, real: int) -> int:
    """Return the bytes of a part, numbers having `real` bytes and integers 4."""
    one = real
    if isinstance(part.element, Record):
        integers = sum(kind == INT for _, kind in part.element.fields)
        one = real * (len(part.element.fields) - integers) + 4 * integers
        one += -one % real
    elif part.element != REAL:
        one = 4
    return one * law.size(part)


def sizes(law: Law, real: int) -> tuple[int, int]:
    """Return bytes of a state (RAM) and of constants (flash)."""
    ram = sum(size_of(law, part, real) for part in law.parts if not part.fixed)
    flash = sum(size_of(law, part, real) for part in law.parts if part.values is not None)
    return ram + real, flash


def readme(
    law: Law, folder: Path, step: float, horizon: float, operations: int, exact: bool
) -> str:
    """Return the README; where there is a compiler, with what it says."""
    rows = [f"| {what} | {double} | {single} |" for what, double, single in _table(law, folder)]
    single = _single(law, round(horizon / step))
    return _README.format(
        version=__version__, name=type(law.controller).__name__, n=law.n, step=f"{step:g}",
        horizon=f"{horizon:g}", rows="\n".join(rows), operations=operations,
        exactness=_EXACT if exact else _CLOSE, proof=_proof(folder), single=single,
        gains=_gains(law),
    )  # fmt: skip


def _table(law: Law, folder: Path) -> list[tuple[str, Any, Any]]:
    (ram, flash), (ram_single, flash_single) = sizes(law, 8), sizes(law, 4)
    rows = [
        ("RAM, a state [bytes]", ram, ram_single),
        ("flash, constants [bytes]", flash, flash_single),
    ]
    code = build.code_size(folder)
    if code is not None:
        rows.append((f"flash, code [bytes] ({_machine()}, -Os)", code, ""))  # type: ignore[arg-type]
    return rows


def _machine() -> str:
    import platform

    return platform.machine()


def _proof(folder: Path) -> str:
    """Return what the check says in both precisions, or how to ask it."""
    if build.compiler() is None:
        return "Not measured here, for want of a compiler: `fpid_check vectors.bin` prints it."
    lines = []
    with tempfile.TemporaryDirectory() as there:
        for what, flags in (("double", []), ("float", ["-DFPID_SINGLE"])):
            try:
                program = build.compile_check(folder, Path(there) / what, flags)
                found = build.compare(program, folder / "vectors.bin")
            except ExportError as error:
                lines.append(f"- `{what}`: {error}")
                continue
            part = found.difference / found.peak if found.peak else 0.0
            lines.append(
                f"- `{what}`: {found.equal} of {found.total} torques equal to the last bit; "
                f"largest difference {found.difference:.2e} N m, {part:.1e} of the largest torque "
                f"({found.peak:.3g} N m), over {found.ticks} ticks."
            )
    return "\n".join(lines)


def _single(law: Law, steps: int) -> str:
    orders = np.asarray(getattr(law.controller, "integral_order", 1.0), dtype=float)
    if not hasattr(law.controller, "integral_order"):
        return ""
    fractional = bool(((orders > 0.0) & (orders < 1.0)).any())
    poor = steps > MOST_SINGLE_STEPS and fractional
    rows = "\n".join(f"| {k:,} | {i:.0e} | {d:.0e} |" for k, i, d in SINGLE_ERRORS)
    return _SINGLE.format(
        verdict="is **not advised** here" if poor else "may do here", steps=f"{steps:,}",
        most=f"{MOST_SINGLE_STEPS:,}", rows=rows,
    )  # fmt: skip


def _gains(law: Law) -> str:
    part = law.part("joints")
    assert isinstance(part.element, Record)
    joint = "state.joints[j]"
    names = [name for name, _ in part.element.fields]
    if "kp" in names and "mu" in names:
        return f"`{joint}.kp`, `.ki`, `.kd`, `.lam`, `.mu`, `.s`, `.int_e`, `.u_fpid`"
    return f"`{joint}`: " + ", ".join(f"`.{name}`" for name in names)


_EXACT = """In `double`, with `-ffp-contract=off`, the torques are those of the simulation to the
last bit: sums and products only, in the same order."""
_CLOSE = """In `double` the torques are those of the simulation to within 1e-12 of the largest:
sines and cosines, and Pinocchio's recursions against these kernels, differ in last bits."""

_SINGLE = """`float` {verdict}: the horizon is {steps} steps. What `float` costs a long memory, as a
part of the largest value, orders 0.1 to 0.99, measured over

| steps of horizon | I^lambda e | D^mu e |
| --- | --- | --- |
{rows}

so it is not advised with lambda below 1 from {most} steps on: slow modes decay by less a tick than
24 bits can say. D^mu e bears it at any order."""

_README = """\
# {name}, {n} joints, every {step} s

Exported by fpid_pin {version} from `controller.toml`. C99, only `<math.h>`; no allocation, no
globals but constants, no recursion, no arrays of variable length; every loop ends after a count
that is fixed here. Sampling at any other period than {step} s is another controller: export it
anew.

    cmake -B build && cmake --build build && ctest --test-dir build

or, without CMake,

    cc -std=c99 -O2 -ffp-contract=off fpid.c fpid_parameters.c fpid_check.c -o fpid_check -lm
    ./fpid_check vectors.bin

`example.c` shows the calls: `fpid_reset(&state)`, then `fpid_step(&state, &input, &output)` once a
tick. `fpid_step` returns `FPID_BAD_INPUT` and changes nothing where an input is NaN or infinite,
and `FPID_BAD_TORQUE` where a torque is: stop the drives then. Fractional memories are fitted for
{horizon} s; after that they forget too much, and `fpid_reset` begins again.

## Gains and state

A state is a plain struct: {gains}
may be read between two ticks, and gains written. A copy of the whole, kept in a file by this very
build, goes on without a bump: `fpid_restore(&state, &copy)`; it refuses another export's state.

## What it takes

| | double | float (`-DFPID_SINGLE`) |
| --- | --- | --- |
{rows}

At most {operations} additions, products, quotients and roots a tick, over the first vectors.

## How exact it is

{exactness} Measured with `vectors.bin`, what a tick is given and what the simulation answers:

{proof}

{single}
"""
