"""What does float32 cost an exported law's long memories? Double against float, by horizon.

Wants gcc. Prints, for each horizon at 1 ms, the largest difference of I^lambda e and of D^mu e
between both precisions, as a part of the largest value, over all orders. Half a minute.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

import fpid_pin as fp
from fpid_pin.export.c_source import CSource
from fpid_pin.export.folder import write_sources
from fpid_pin.export.law import start

ORDERS = (0.1, 0.3, 0.5, 0.7, 0.9, 0.99)
DRIVE = r"""
#include <math.h>
#include <stdio.h>
#include "fpid.h"
static fpid_state state;
int main(void)
{
    fpid_input in = {{0}, {0}, {0}, {0}, {0}};
    fpid_output out;
    fpid_reset(&state);
    for (long k = 0; k < TICKS; ++k) {
        const double t = k * FPID_STEP;
        for (int j = 0; j < FPID_JOINTS; ++j) {
            const double w = 0.7 + 0.3 * j;
            in.q[j] = (real_t)-(0.1 * sin(w * t) + 0.05 * sin(13 * w * t) + 0.02);
            in.v[j] = (real_t)-(0.1 * w * cos(w * t) + 0.65 * w * cos(13 * w * t));
        }
        (void)fpid_step(&state, &in, &out);
        for (int j = 0; (k % 997 == 0) && (j < FPID_JOINTS); ++j) {
            const double terms[2] = {state.joints[j].i_e, state.joints[j].d_e};
            fwrite(terms, sizeof(double), 2, stdout);
        }
    }
    return 0;
}
"""

arm = fp.Arm.planar(lengths=(1.0,) * len(ORDERS), masses=(1.0,) * len(ORDERS))
law = fp.AdaptiveFpid(
    kp=1.0, ki=1.0, kd=1.0, integral_order=ORDERS, derivative_order=ORDERS, learning_rate=0.0
)
for horizon in (20, 200, 600, 3600):
    with tempfile.TemporaryDirectory() as there:
        folder = Path(there)
        write_sources(CSource(start(law, arm, 1e-3, float(horizon))), folder)
        (folder / "drive.c").write_text(DRIVE)
        found = []
        for flag in ("-UFPID_SINGLE", "-DFPID_SINGLE"):
            command = ["gcc", "-O2", "-ffp-contract=off", flag, f"-DTICKS={horizon * 1000}L"]
            sources = ["drive.c", "fpid.c", "fpid_parameters.c"]
            subprocess.run([*command, *sources, "-o", "drive", "-lm"], cwd=folder, check=True)
            said = subprocess.run(["./drive"], cwd=folder, capture_output=True, check=True).stdout
            found.append(np.frombuffer(said).reshape(-1, len(ORDERS), 2))
    double, single = found
    error = (np.abs(double - single).max(axis=0) / np.abs(double).max(axis=0)).max(axis=0)
    print(f"{horizon:5d} s: I^lambda e {error[0]:.1e}, D^mu e {error[1]:.1e}")
