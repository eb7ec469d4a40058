"""The frames of the C files; `c_source` fills them in."""

from __future__ import annotations

HEADER = """\
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
#define FPID_JOINTS {n}

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

SOURCE = """\
/* The kernels of fpid_pin {version}, printed; what each is for stands above it. Compile with
 * -ffp-contract=off (and without -ffast-math) for the bits of the simulation. */
#include <string.h>
#include <tgmath.h>

#include "fpid.h"

{helpers}
{functions}
void fpid_reset(fpid_state *state)
{{
    /* All bits zero is the number zero. */
    memset(state, 0, sizeof *state);
    state->stamp = FPID_STAMP;
{reset}
}}

static int all_finite(const real_t *numbers, int count)
{{
    for (int i = 0; i < count; ++i) {{
        if (isfinite(numbers[i]) == 0) {{
            return 0;
        }}
    }}
    return 1;
}}

int fpid_step(fpid_state *state, const fpid_input *input, fpid_output *output)
{{
    real_t inputs[{inputs} * FPID_JOINTS];
    for (int j = 0; j < FPID_JOINTS; ++j) {{
        inputs[j] = input->q[j];
        inputs[FPID_JOINTS + j] = input->v[j];
        inputs[2 * FPID_JOINTS + j] = input->q_ref[j];
        inputs[3 * FPID_JOINTS + j] = input->v_ref[j];
        inputs[4 * FPID_JOINTS + j] = input->a_ref[j];
    }}
    if (all_finite(inputs, {inputs} * FPID_JOINTS) == 0) {{
        return FPID_BAD_INPUT;
    }}
{tick}
    return (all_finite(output->torque, FPID_JOINTS) != 0) ? FPID_OK : FPID_BAD_TORQUE;
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

PARAMETERS = """\
/* Constants of a controller exported by fpid_pin {version}. Generated. */
#include <math.h>

#include "fpid.h"

#define R(x) ((real_t)(x))

{constants}"""
