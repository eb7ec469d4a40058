"""What does `float` cost an exported law?

Double against float, by horizon, at 1 ms, orders 0.1 to 0.99: the largest difference of I^lambda e
and of D^mu e between both precisions, as a part of the largest value. Wants gcc.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from common import Bench, run

import fpid_pin as fp
from fpid_pin.export.law import CSource, start

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


def error(horizon: int) -> np.ndarray:
    """Return the difference of I^lambda e and of D^mu e over a horizon [s]."""
    arm = fp.Arm.planar(lengths=(1.0,) * len(ORDERS), masses=(1.0,) * len(ORDERS))
    law = fp.AdaptiveFpid(
        kp=1.0, ki=1.0, kd=1.0, integral_order=ORDERS, derivative_order=ORDERS, learning_rate=0.0
    )
    found = []
    with tempfile.TemporaryDirectory() as folder:
        CSource(start(law, arm, 1e-3, float(horizon))).write(Path(folder))
        Path(folder, "drive.c").write_text(DRIVE)
        for flag in ("-UFPID_SINGLE", "-DFPID_SINGLE"):
            command = ["gcc", "-O2", "-ffp-contract=off", flag, f"-DTICKS={horizon * 1000}L"]
            sources = ["drive.c", "fpid.c", "fpid_parameters.c"]
            subprocess.run([*command, *sources, "-o", "drive", "-lm"], cwd=folder, check=True)
            said = subprocess.check_output(["./drive"], cwd=folder)
            found.append(np.frombuffer(said).reshape(-1, len(ORDERS), 2))
    double, single = found
    return (np.abs(double - single).max(axis=0) / np.abs(double).max(axis=0)).max(axis=0)


def precision(bench: Bench) -> None:
    horizons = (20,) if bench.quick else (20, 200, 600, 3600)
    found = {horizon: error(horizon) for horizon in horizons}
    bench.say(f"In {horizons[-1]} s the terms lose {found[horizons[-1]].max():.1e} of their size.")
    rows = ([f"{horizon} s", *(f"{x:.1e}" for x in pair)] for horizon, pair in found.items())
    bench.table(["horizon", "I^lambda e", "D^mu e"], rows)


if __name__ == "__main__":
    run(__doc__, precision)
