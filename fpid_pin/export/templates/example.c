/* How the exported controller is called: every joint here is a mass of 1 kg m^2. */
#include <math.h>
#include <stdio.h>

#include "fpid.h"

/* A state is large for a small stack. */
static fpid_state state;

int main(void)
{
    fpid_input input = {{0}, {0}, {0}, {0}, {0}};
    fpid_output output = {{0}};
    int status = FPID_OK;
    fpid_reset(&state);
    for (int k = 0; (k < 2000) && (status == FPID_OK); ++k) {
        /* On a robot: read the encoders into q and v, the trajectory into q_ref, v_ref, a_ref.
           Neither angles nor references may jump by a turn where an encoder begins again. */
        for (int j = 0; j < FPID_JOINTS; ++j) {
            input.q_ref[j] = (real_t)0.1;
        }
        status = fpid_step(&state, &input, &output);
        /* On a robot: send the torques to the drives; stop them where status is not FPID_OK. */
        for (int j = 0; j < FPID_JOINTS; ++j) {
            input.v[j] += (real_t)FPID_STEP * output.torque[j];
            input.q[j] += (real_t)FPID_STEP * input.v[j];
        }
    }
    for (int j = 0; j < FPID_JOINTS; ++j) {
        printf("joint %d: q = %.6f rad\n", j, (double)input.q[j]);
    }
    return status;
}
