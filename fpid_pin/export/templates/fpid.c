/* The kernels of fpid_pin $version, printed; what each is for stands above it. Compile with
 * -ffp-contract=off (and without -ffast-math) for the bits of the simulation. */
#include <string.h>
#include <tgmath.h>

#include "fpid.h"

$helpers
$functions
void fpid_reset(fpid_state *state)
{
    /* All bits zero is the number zero. */
    memset(state, 0, sizeof *state);
    state->stamp = FPID_STAMP;
$reset
}

static int all_finite(const real_t *numbers, int count)
{
    for (int i = 0; i < count; ++i) {
        if (isfinite(numbers[i]) == 0) {
            return 0;
        }
    }
    return 1;
}

int fpid_step(fpid_state *state, const fpid_input *input, fpid_output *output)
{
    /* q, v, q_ref, v_ref, a_ref: fpid_input has them one after the other. */
    real_t inputs[5 * FPID_JOINTS];
    memcpy(inputs, input, sizeof inputs);
    if (all_finite(inputs, 5 * FPID_JOINTS) == 0) {
        return FPID_BAD_INPUT;
    }
$tick
    return (all_finite(output->torque, FPID_JOINTS) != 0) ? FPID_OK : FPID_BAD_TORQUE;
}

int fpid_restore(fpid_state *state, const fpid_state *saved)
{
    if (saved->stamp != FPID_STAMP) {
        return FPID_FOREIGN_STATE;
    }
    *state = *saved;
    return FPID_OK;
}
