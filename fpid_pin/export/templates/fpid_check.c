/* Compares the controller with vectors.bin, tick by tick: fpid_check vectors.bin [torques.bin]
 *
 * In double precision the torques of vectors.bin are those of the simulation; in single precision
 * (-DFPID_SINGLE) the difference is that precision's error. Wants a little-endian machine. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "fpid.h"

static fpid_state state, saved;

int main(int argc, char **argv)
{
    char magic[8];
    int32_t sizes[2] = {0, 0};
    double row[6 * FPID_JOINTS];
    double largest = 0.0, peak = 0.0;
    long equal = 0, total = 0;
    int status = FPID_OK;
    FILE *out = NULL;
    FILE *in = (argc > 1) ? fopen(argv[1], "rb") : NULL;
    if ((in == NULL) || (fread(magic, 1, 8, in) != 8) || (fread(sizes, 4, 2, in) != 2)
        || (memcmp(magic, "FPIDVEC1", 8) != 0) || (sizes[0] != FPID_JOINTS)) {
        fprintf(stderr, "fpid_check: expected vectors.bin of this export\n");
        return 2;
    }
    if (argc > 2) {
        out = fopen(argv[2], "wb");
    }
    fpid_reset(&state);
    for (int32_t k = 0; (k < sizes[1]) && (status == FPID_OK); ++k) {
        fpid_input input;
        fpid_output output;
        if (fread(row, sizeof(double), 6 * FPID_JOINTS, in) != 6 * FPID_JOINTS) {
            fprintf(stderr, "fpid_check: vectors.bin is cut short\n");
            return 2;
        }
        for (int j = 0; j < FPID_JOINTS; ++j) {
            input.q[j] = (real_t)row[j];
            input.v[j] = (real_t)row[FPID_JOINTS + j];
            input.q_ref[j] = (real_t)row[2 * FPID_JOINTS + j];
            input.v_ref[j] = (real_t)row[3 * FPID_JOINTS + j];
            input.a_ref[j] = (real_t)row[4 * FPID_JOINTS + j];
        }
        if (k == sizes[1] / 2) {
            /* A restart half way: nothing of it may be seen. */
            saved = state;
            memset(&state, 0, sizeof state);
            status = fpid_restore(&state, &saved);
        }
        if (status == FPID_OK) {
            status = fpid_step(&state, &input, &output);
        }
        for (int j = 0; j < FPID_JOINTS; ++j) {
            const double want = row[5 * FPID_JOINTS + j];
            const double got = (double)output.torque[j];
            largest = fmax(largest, fabs(got - want));
            peak = fmax(peak, fabs(want));
            equal += (memcmp(&got, &want, sizeof(double)) == 0) ? 1 : 0;
            ++total;
            if (out != NULL) {
                (void)fwrite(&got, sizeof(double), 1, out);
            }
        }
    }
    (void)fclose(in);
    if (out != NULL) {
        (void)fclose(out);
    }
    printf("%ld of %ld torques equal to the last bit; largest difference %.2e, %.1e of the largest "
           "torque or force (%.3g N m or N), over %ld ticks; a state takes %lu bytes\n",
           equal, total, largest, (peak > 0.0) ? largest / peak : 0.0, peak, (long)sizes[1],
           (unsigned long)sizeof(fpid_state));
    if (status != FPID_OK) {
        fprintf(stderr, "fpid_check: fpid_step() returned %d\n", status);
        return 1;
    }
    if (sizeof(real_t) < sizeof(double)) {
        return 0;
    }
    return (largest <= FPID_TOLERANCE * peak) ? 0 : 1;
}
