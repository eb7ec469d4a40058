"""The C files of a law: header, printed kernels, constants."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.export.c99 import C99, HELPERS
from fpid_pin.export.kinds import INT, REAL, Number, Record
from fpid_pin.export.language import product
from fpid_pin.export.parts import INPUTS, Law, Part
from fpid_pin.export.printer import Program

_LANGUAGE = C99()
_WIDTH = 100


class CSource:
    """The text of a law's C files.

    Parameters
    ----------
    law
        See `parts.law_of`.
    step
        Sampling period [s].

    Attributes
    ----------
    header, source, parameters
        Of ``fpid.h``, ``fpid.c`` and ``fpid_parameters.c``.
    """

    def __init__(self, law: Law, step: float) -> None:
        self._law, self._step = law, step
        program = Program(_LANGUAGE)
        self._tick = [
            f"    {program.add(call.kernel, [law.kind(a) for a in call.arguments])}"
            f"({', '.join(self._argument(a) for a in call.arguments)});"
            for call in law.calls
        ]
        # What is only given on is no argument's type.
        for part in law.parts:
            if isinstance(part.element, Record):
                program.records.setdefault(part.element.name, part.element)
        self._program = program
        self.parameters = self._parameters()
        self.stamp = zlib.crc32((self.parameters + program.text).encode()) & 0x7FFFFFFF
        self.header, self.source = self._header(), self._source()

    @property
    def records(self) -> Iterable[Record]:
        """The structs."""
        return self._program.records.values()

    def _argument(self, argument: str | float) -> str:
        if not isinstance(argument, str):
            return _LANGUAGE.number(argument).text
        name, _, row = argument.partition("[")
        if name == "inputs":
            place = product((int(row[:-1]), "FPID_JOINTS")).text if row else ""
            return f"&inputs[{place}]" if place and row != "0]" else "inputs"
        if name == "torque":
            return "output->torque"
        part = self._law.part(name)
        if part.fixed:
            return f"&fpid_{name}" if not part.shape else f"fpid_{name}"
        return f"state->{name}"

    # ------------------------------------------------------------------ files

    def _header(self) -> str:
        law = self._law
        extents = "\n".join(f"#define {name} {value}" for name, value in law.extents.items())
        moving = "\n".join(
            f"    {_type(part)} {part.name}{_extent(part)};" for part in law.parts if not part.fixed
        )
        constants = "\n".join(
            f"extern const {_type(part)} {_constant(part)}{_extent(part)};"
            for part in law.parts
            if part.values is not None
        )
        return _HEADER.format(
            version=__version__, step=repr(float(self._step)), extents=extents, stamp=self.stamp,
            structs=_LANGUAGE.structs(self.records), moving=moving, constants=constants,
        )  # fmt: skip

    def _source(self) -> str:
        reset = [line for part in self._law.parts if not part.fixed for line in _reset(part)]
        return _SOURCE.format(
            version=__version__, helpers=HELPERS, functions=self._program.text,
            reset="\n".join(reset), tick="\n".join(self._tick), inputs=INPUTS,
        )  # fmt: skip

    def _parameters(self) -> str:
        parts = [
            f"const {_type(part)} {_constant(part)}{_extent(part)} = {_values(part)};\n"
            for part in self._law.parts
            if part.values is not None
        ]
        return _PARAMETERS.format(version=__version__, constants="\n".join(parts))


def _type(part: Part) -> str:
    return _LANGUAGE.type_of(part.element)


def _constant(part: Part) -> str:
    return f"fpid_{part.name}" if part.fixed else f"fpid_{part.name}_0"


def _extent(part: Part) -> str:
    return f"[{product(part.shape).text}]" if part.shape else ""


def _reset(part: Part) -> list[str]:
    """Return the lines that set a part of the state to what it is at t = 0."""
    loop = f"    for (int i = 0; i < {product(part.shape).text}; ++i) {{"
    if part.values is not None:
        return [loop, f"        state->{part.name}[i] = {_constant(part)}[i];", "    }"]
    if isinstance(part.element, Record):
        none = f"none_{part.element.name}"
        before = f"    static const {_type(part)} {none} = {{0}};"
        return [before, loop, f"        state->{part.name}[i] = {none};", "    }"]
    return [loop, f"        state->{part.name}[i] = {_LANGUAGE.real(0.0).text};", "    }"]


def _values(part: Part) -> str:
    """Return the initial values of a constant, an element a line."""
    flat = np.asarray(part.values).reshape(-1)
    if isinstance(part.element, Record):
        rows = [_row([_number(one[name], kind) for name, kind in part.element.fields])
                for one in flat]  # fmt: skip
    else:
        numbers = [_number(one, part.element) for one in flat]
        return "{\n" + _wrapped(numbers, "    ") + "\n}"
    return rows[0] if not part.shape else "{\n" + ",\n".join(rows) + "\n}"


def _row(numbers: list[str]) -> str:
    line = "{" + ", ".join(numbers) + "}"
    return f"    {line}" if len(line) < _WIDTH else "    {\n" + _wrapped(numbers, "        ") + "}"


def _wrapped(numbers: list[str], indent: str) -> str:
    lines, line = [], indent
    for number in numbers:
        if len(line) + len(number) + 2 > _WIDTH and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += f"{number}, "
    return "\n".join([*lines, line.rstrip(", ")])


def _number(value: Any, kind: Number) -> str:
    if kind != REAL:
        assert kind == INT or value in (0, 1)
        return str(int(value))
    value = float(value)
    if np.isfinite(value):
        return f"R({value!r})"
    return "R(NAN)" if np.isnan(value) else f"R({'-' * (value < 0.0)}INFINITY)"


_HEADER = """\
/* A controller exported by fpid_pin {version}. Generated: change what made it, not this.
 *
 * Units: m, kg, s, rad, N m. Call fpid_step() every FPID_STEP seconds, with what was measured just
 * now, and apply the torque until the next call. No memory is allocated, nothing is global but
 * constants: several robots are several states.
 */
#ifndef FPID_H
#define FPID_H

#ifdef __cplusplus
extern "C" {{
#endif

/* The one precision of everything: double, or float with -DFPID_SINGLE. */
#ifdef FPID_SINGLE
typedef float real_t;
#else
typedef double real_t;
#endif

#define FPID_STEP {step} /* [s] */
{extents}

#define FPID_OK 0
/* An input is NaN or infinite: state and output are as before. */
#define FPID_BAD_INPUT 1
/* A torque is NaN or infinite: stop the drives; the state is of no use any more. */
#define FPID_BAD_TORQUE 2
/* The saved state is of another export. */
#define FPID_FOREIGN_STATE 3

{structs}
typedef struct {{
    int stamp;
{moving}
}} fpid_state;

/* Measured, and to be followed. */
typedef struct {{
    real_t q[FPID_JOINTS];     /* [rad] */
    real_t v[FPID_JOINTS];     /* [rad/s] */
    real_t q_ref[FPID_JOINTS]; /* [rad] */
    real_t v_ref[FPID_JOINTS]; /* [rad/s] */
    real_t a_ref[FPID_JOINTS]; /* [rad/s^2] */
}} fpid_input;

typedef struct {{
    real_t torque[FPID_JOINTS]; /* within the effort limits [N m] */
}} fpid_output;

/* Begin at t = 0. */
void fpid_reset(fpid_state *state);

/* Make one tick; returns FPID_OK, FPID_BAD_INPUT or FPID_BAD_TORQUE. */
int fpid_step(fpid_state *state, const fpid_input *input, fpid_output *output);

/* Go on from a copy of a state, gains and all, without a bump; it may have come from a file that
 * this build wrote. Returns FPID_OK, or FPID_FOREIGN_STATE: `state` is as before. */
int fpid_restore(fpid_state *state, const fpid_state *saved);

/* Which export this is: state.stamp must be it. */
#define FPID_STAMP {stamp}

/* Constants, and states at t = 0: fpid_parameters.c. */
{constants}

#ifdef __cplusplus
}}
#endif

#endif
"""

_SOURCE = """\
/* The kernels of fpid_pin {version}, printed; what each is for stands above it. Compile with
 * -ffp-contract=off (and without -ffast-math) for the bits of the simulation. */
#include <math.h>

#include "fpid.h"

{helpers}
{functions}
void fpid_reset(fpid_state *state)
{{
    state->stamp = FPID_STAMP;
{reset}
}}

int fpid_step(fpid_state *state, const fpid_input *input, fpid_output *output)
{{
    real_t inputs[{inputs} * FPID_JOINTS];
    int sound = 1;
    for (int j = 0; j < FPID_JOINTS; ++j) {{
        inputs[j] = input->q[j];
        inputs[FPID_JOINTS + j] = input->v[j];
        inputs[2 * FPID_JOINTS + j] = input->q_ref[j];
        inputs[3 * FPID_JOINTS + j] = input->v_ref[j];
        inputs[4 * FPID_JOINTS + j] = input->a_ref[j];
    }}
    for (int i = 0; i < {inputs} * FPID_JOINTS; ++i) {{
        sound = (sound != 0) && (isfinite(inputs[i]) != 0);
    }}
    if (sound == 0) {{
        return FPID_BAD_INPUT;
    }}
{tick}
    for (int j = 0; j < FPID_JOINTS; ++j) {{
        sound = (sound != 0) && (isfinite(output->torque[j]) != 0);
    }}
    return (sound != 0) ? FPID_OK : FPID_BAD_TORQUE;
}}

int fpid_restore(fpid_state *state, const fpid_state *saved)
{{
    if (saved->stamp != FPID_STAMP) {{
        return FPID_FOREIGN_STATE;
    }}
    *state = *saved;
    return FPID_OK;
}}
"""

_PARAMETERS = """\
/* Constants of a controller exported by fpid_pin {version}. Generated. */
#include <math.h>

#include "fpid.h"

#define R(x) ((real_t)(x))

{constants}"""
