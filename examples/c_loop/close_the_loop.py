"""The exported C in the loop: the paper's arm, driven by the library that a robot would run.

Wants a C compiler. Prints how far the C loop is from the simulation: nothing at all.
"""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import fpid_pin as fp

experiment = fp.paper_experiment(duration=5.0)
controller = fp.paper_controller()
run = fp.simulate(experiment, controller)

folder = fp.export_c(
    controller, experiment.arm, experiment.step, Path(tempfile.mkdtemp()) / "c",
    experiment=experiment,
)  # fmt: skip
sources = [Path(__file__).parent / "shim.c", folder / "fpid.c", folder / "fpid_parameters.c"]
command = ["cc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{folder}"]
subprocess.run([*command, *map(str, sources), "-o", str(folder / "fpid.so"), "-lm"], check=True)
library = ctypes.CDLL(str(folder / "fpid.so"))
pointer = ctypes.POINTER(ctypes.c_double)


def pointer_to(array):
    return array.ctypes.data_as(pointer)


arm, h = experiment.arm, experiment.step
q, v, torque = run.q[0].copy(), run.v[0].copy(), np.zeros(arm.n)
a_ref = experiment.reference.sample(run.t)[2]
push = experiment.plant.disturbance.sample(run.t)
furthest = 0.0
library.begin()
for k in range(len(run.t) - 1):
    given = np.concatenate([q, v, run.q_ref[k], run.v_ref[k], a_ref[k]])
    if library.tick(pointer_to(given), pointer_to(torque)) != 0:
        raise SystemExit("the controller stopped")
    # Semi-implicit Euler, as in the simulation.
    v += h * arm.forward_dynamics(q, v, torque + push[k])
    q += h * v
    furthest = max(furthest, np.abs(q - run.q[k + 1]).max())

print(f"{folder.name}: largest difference of joint angles from the simulation {furthest:.1e} rad")
