"""The README of an exported controller: what it is, what it takes, how exact it is."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export import build
from fpid_pin.export.c_source import CSource
from fpid_pin.export.kinds import INT, Record
from fpid_pin.export.parts import Law, Part

#: Decay per step, E = exp(-p h), is 1 - p h for a slow mode: float32 keeps 6e-8 of it. Where that
#: spoils the slowest mode's p by more than this, the memory of the past is wrong.
_SPOILED = 0.02


def size_of(law: Law, part: Part, real: int) -> int:
    """Return the bytes of a part, numbers having `real` bytes and integers 4."""
    one = real
    if isinstance(part.element, Record):
        integers = sum(kind == INT for _, kind in part.element.fields)
        one = real * (len(part.element.fields) - integers) + 4 * integers
        one += -one % real
    elif part.element == INT:
        one = 4
    return one * law.size(part)


def sizes(law: Law, real: int) -> tuple[int, int]:
    """Return bytes of a state (RAM) and of constants (flash)."""
    ram = sum(size_of(law, part, real) for part in law.parts if not part.fixed)
    flash = sum(size_of(law, part, real) for part in law.parts if part.values is not None)
    return ram + real, flash


def slowest_spoiled(law: Law) -> float:
    """Return by what part float32 changes the decay rate of the mode that it changes most."""
    poles = next((part.values for part in law.parts if part.name == "poles"), None)
    if poles is None:
        return 0.0
    decay = np.asarray(poles["decay"], dtype=float)
    rate, single = 1.0 - decay, 1.0 - decay.astype(np.float32).astype(float)
    lives = (rate > 0.0) & (decay > 0.5)
    return float(np.max(np.abs(single / np.where(lives, rate, 1.0) - 1.0), where=lives, initial=0.0))


def readme(
    law: Law, folder: Path, step: float, horizon: float, operations: int, made_by: str
) -> str:
    """Return the README; where there is a compiler, with what it says."""
    rows = [f"| {what} | {double} | {single} |" for what, double, single in _table(law, folder)]
    return _README.format(
        version=__version__, name=type(law.controller).__name__, n=law.n, step=f"{step:g}",
        horizon=f"{horizon:g}", rows="\n".join(rows), operations=operations,
        exactness=_EXACT if law.exact else _CLOSE, proof=_proof(folder), single=_single(law),
        made_by=made_by, gains=_gains(law),
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
                f"- `{what}`: {found.equal} of {found.total} torques equal to the last bit; largest "
                f"difference {found.difference:.2e} N m, {part:.1e} of the largest torque "
                f"({found.peak:.3g} N m), over {found.ticks} ticks."
            )
    return "\n".join(lines)


def _single(law: Law) -> str:
    spoiled = slowest_spoiled(law)
    if spoiled == 0.0:
        return "Without slow modes in it, this law may run in `float`."
    verdict = "is **not advised**" if spoiled > _SPOILED else "may do"
    return (
        f"`float` {verdict} for this step and horizon: it changes the decay of the slowest mode by "
        f"{100.0 * spoiled:.2g} % (its 24 bits hold 1 - p h; more than {100.0 * _SPOILED:.0f} % is "
        "taken to be too much, which comes at about 600,000 steps of horizon). A fractional "
        "integral of a long past suffers most, the more the nearer its order is to 1; int e, too, "
        "stops growing by less than 6e-8 of itself a tick. A shorter horizon, or `double`, helps."
    )


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
_CLOSE = """In `double` the torques are those of the simulation to within 1e-12 of the largest: sines
and cosines, and Pinocchio's recursions against these kernels, differ in last bits."""

_README = """\
# {name}, {n} joints, every {step} s

Exported by fpid_pin {version} from `{made_by}`. C99, only `<math.h>`; no allocation, no globals but
constants, no recursion, no arrays of variable length; every loop ends after a count that is fixed
here. Sampling at any other period than {step} s is another controller: export it anew.

    cmake -B build && cmake --build build && ctest --test-dir build

or, without CMake,

    cc -std=c99 -O2 -ffp-contract=off fpid.c fpid_parameters.c fpid_check.c -o fpid_check -lm
    ./fpid_check vectors.bin

`example.c` shows the calls: `fpid_reset(&state)`, then `fpid_step(&state, &input, &output)` once a
tick. `fpid_step` returns `FPID_BAD_INPUT` and changes nothing where an input is NaN or infinite, and
`FPID_BAD_TORQUE` where a torque is: stop the drives then. Fractional memories are fitted for
{horizon} s; after that they forget too much, and `fpid_reset` begins again.

## Gains and state

A state is a plain struct: {gains}
may be read between two ticks, and gains written. A copy of the whole, kept in a file by this very
build, goes on without a bump: `fpid_restore(&state, &copy)`; it refuses the state of another export.

## What it takes

| | double | float (`-DFPID_SINGLE`) |
| --- | --- | --- |
{rows}

At most {operations} additions, products, quotients and roots a tick, counted over the first vectors.

## How exact it is

{exactness} Measured with `vectors.bin`, what a tick is given and what the simulation answers:

{proof}

{single}
"""
