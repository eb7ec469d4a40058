/* One robot behind one function, for ctypes. */
#include <string.h>

#include "fpid.h"

static fpid_state state;

void begin(void) { fpid_reset(&state); }

/* `given` is q, v, q_ref, v_ref, a_ref, one after the other. */
int tick(const double *given, double *torque)
{
    fpid_input input;
    fpid_output output;
    int status;
    memcpy(&input, given, sizeof input);
    status = fpid_step(&state, &input, &output);
    memcpy(torque, output.torque, sizeof output.torque);
    return status;
}
