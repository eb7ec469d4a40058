"""Torques of every law over some ticks, for processes to be compared; written as JSON."""

import dataclasses
import json
import sys

import numpy as np
from own_laws import JointPid, Many, Mit, PythonPid, RobotComputedTorque, RobotPd

import fpid_pin as fp

ARM = fp.Arm.from_example("ur5")
FPID = fp.AdaptiveFpid(100.0, 200.0, 20.0, 0.9, 0.8, learning_rate=50.0, scale="inertia")
LAWS = {
    "PID": fp.Pid(100.0, 200.0, 20.0, scale="inertia"),
    "PD + gravity": fp.PdGravity(100.0, 20.0, ki=50.0, scale="inertia"),
    "gravity only": fp.GravityOnly(),
    "computed torque": fp.ComputedTorque(100.0, 20.0, ki=50.0, observer=40.0),
    "sliding mode": fp.SlidingMode(10.0, 20.0, 0.2, scale="inertia"),
    "Slotine-Li": fp.SlotineLi(10.0, 20.0, 2.0, 0.7, scale="inertia", leakage=0.1),
    "FPID": FPID,
    "FPID with everything": dataclasses.replace(
        FPID, feedforward=True, observer=100.0, order_learning_rate=0.05,
        supervisor=fp.Supervisor.quiet(0.9, 0.8), safeguards=fp.Safeguards(10.0, 300.0, 0.1, 0.1),
    ),
    "the paper's supervisor": dataclasses.replace(
        FPID, supervisor=fp.Supervisor(0.5, 0.45, 1.0, kind="paper", boundary_layer=5.0)
    ),
    "CRONE": dataclasses.replace(FPID, design=fp.fractional.Crone()),
    "own, joint by joint": JointPid(100.0, 20.0, 50.0),
    "own, whole robot": RobotPd(100.0, 20.0),
    "own, whole robot, with the model": RobotComputedTorque(),
    "own, Python": PythonPid(100.0, 20.0, 50.0),
    "own, adapting": Mit(),
    "own, operators": Many(mu=0.7),
}  # fmt: skip


def torques(ticks=20):
    """Return the torques of each law, (ticks, n), where an arm wobbles about its reference."""
    found = {}
    for name, law in LAWS.items():
        loop, rng, rows = law.start(ARM, step=1e-3, horizon=1.0), np.random.default_rng(1), []
        for k in range(ticks):
            q, v = ARM.home + 0.05 * np.sin(0.1 * k + np.arange(6.0)), 0.3 * rng.normal(size=6)
            rows.append(loop.torque(q, v, ARM.home, np.full(6, 0.2), np.full(6, 1.0)).tolist())
        found[name] = rows
    return found


if __name__ == "__main__":
    sys.stdout.write(json.dumps(torques()))
