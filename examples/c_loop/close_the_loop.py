"""The exported C in the loop: the paper's arm, driven by the library that a robot would run.

Wants a C compiler. Prints how far the C loop is from the simulation: nothing at all.
"""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import fpid_pin as fp
from fpid_pin.simulation.engine import horizon_of

experiment = fp.paper_experiment(duration=5.0)
controller = fp.paper_controller()
run = fp.simulate(experiment, controller)

folder = fp.export_c(
    controller, experiment.arm, experiment.step, Path(tempfile.mkdtemp()) / "c",
    experiment=experiment, horizon=horizon_of(experiment.duration),
)  # fmt: skip
sources = [Path(__file__).parent / "shim.c", folder / "fpid.c", folder / "fpid_parameters.c"]
command = ["cc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{folder}"]
subprocess.run([*command, *map(str, sources), "-o", str(folder / "fpid.so"), "-lm"], check=True)
library = ctypes.CDLL(str(folder / "fpid.so"))
library.begin()


class OnTheRobot(fp.Controller):
    """The library as a law: what it is told goes through C, tick by tick."""

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        given, torque = np.concatenate([q, v, q_ref, v_ref, a_ref]).ravel(), np.zeros_like(q)
        if library.tick(ctypes.c_void_p(given.ctypes.data), ctypes.c_void_p(torque.ctypes.data)):
            raise RuntimeError("the controller stopped")
        return torque


driven = fp.simulate(experiment, OnTheRobot())
furthest = np.abs(driven.q - run.q).max()
print(f"{len(run.t)} ticks in C: joint angles differ from the simulation by {furthest:g} rad")
