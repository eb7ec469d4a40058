"""The README of an exported controller: what it is, what it takes, how exact it is."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export import build

if TYPE_CHECKING:
    from fpid_pin.control.state import State

#: Horizon, in steps, from which float32 spoils a fractional integral by more than 0.1 %: its 24
#: bits hold 1 - p h of a slow mode, and sums that grow by less than 6e-8 of themselves stand still.
MOST_SINGLE_STEPS = 500_000


def readme(state: State, folder: Path, exact: bool) -> str:
    """Return the README; where there is a compiler, with what it says."""
    table, proof = _measured(folder)
    return _README.format(
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
_SINGLE = """`float` {verdict}: the horizon is {steps} steps. What `float` costs a long memory, as a
part of the largest value, orders 0.1 to 0.99, measured over

| steps of horizon | I^lambda e | D^mu e |
| --- | --- | --- |
| 20,000 | 5e-05 | 4e-06 |
| 200,000 | 2e-04 | 7e-06 |
| 600,000 | 2e-03 | 2e-05 |
| 3,600,000 | 6e-03 | 1e-05 |

so it is not advised with lambda below 1 from {most} steps on: slow modes decay by less a tick than
24 bits can say. D^mu e bears it at any order."""

_README = """\
# {name}, {n} joints, every {step} s

Exported by fpid_pin {version} from `controller.toml`. C99, only `<tgmath.h>` and `<string.h>`; no
allocation, no globals but constants, no recursion, no arrays of variable length; every loop ends
after a count that is fixed here. Sampling at any other period than {step} s is another controller:
export it anew.

    cmake -B build && cmake --build build && ctest --test-dir build

or, without CMake,

    cc -std=c99 -O2 -ffp-contract=off fpid.c fpid_parameters.c fpid_check.c -o fpid_check -lm
    ./fpid_check vectors.bin

`example.c` shows the calls: `fpid_reset(&state)`, then `fpid_step(&state, &input, &output)` once a
tick. `fpid_step` returns `FPID_BAD_INPUT` and changes nothing where an input is NaN or infinite,
and `FPID_BAD_TORQUE` where a torque is: stop the drives then. Fractional memories are fitted for
{horizon} s; after that they forget too much, and `fpid_reset` begins again.

## State

A state is a plain struct; `state.joints[j]` has what the law knows of a joint: {fields}. It may be
read between two ticks, and gains written. A copy of the whole, kept in a file by this very build,
goes on without a bump: `fpid_restore(&state, &copy)`; it refuses another export's state.

## What it takes

| bytes, -Os on the machine that exported | RAM, a state | flash, constants | flash, code |
| --- | --- | --- | --- |
{table}

`float` is `-DFPID_SINGLE`.

## How exact it is

{exactness} Measured with `vectors.bin`, what a tick is given and what the simulation answers:

{proof}

{single}
"""
