"""A whole step of the adaptive FPID beside a bare step of MuJoCo, on the same arms.

    python benchmarks/against_mujoco.py

MuJoCo (extra `mujoco`) steps the arm alone, by semi-implicit Euler at 1 ms, without contacts,
limits or control, by `mujoco.rollout` on one thread; ours has the law with 24 modes a term, drives,
figures of merit and dynamics. Its model is written from Pinocchio's: both have the same bodies.
Processor time, best of some repeats, of a longer run less a shorter one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
import pinocchio as pin
from common import head, row
from mujoco import rollout
from speed import STEPS, experiment_of, laws, marginal, steps_of, turn_by_turn

import fpid_pin as fp


def mujoco_model(arm: fp.Arm) -> mujoco.MjModel:
    """Return the arm in MuJoCo: bodies, joints, inertias, rotor inertias."""
    model, spec = arm.model, mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 1e-3, model.gravity.linear
    off = mujoco.mjtDisableBit
    spec.option.disableflags = int(off.mjDSBL_CONTACT) | int(off.mjDSBL_LIMIT)
    data, parent = model.createData(), spec.worldbody
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k in range(1, model.njoints):
        place, body = model.jointPlacements[k], model.inertias[k]
        turn = pin.Quaternion(place.rotation).coeffs()  # x, y, z, w
        six = np.asarray(body.inertia)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        six[:3] += 0.0 if six[:3].all() else 1e-12  # MuJoCo has no point masses
        parent = parent.add_body(
            pos=place.translation, quat=turn[[3, 0, 1, 2]], mass=body.mass, ipos=body.lever,
            fullinertia=six, explicitinertial=True,
        )  # fmt: skip
        axis = np.reshape(pin.getJointJacobian(model, data, k, pin.LOCAL), (6, -1))[:, k - 1]
        slides = bool(np.abs(axis[:3]).max() > 0.5)
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        parent.add_joint(
            type=kind, axis=axis[:3] if slides else axis[3:], armature=model.armature[k - 1]
        )
    return spec.compile()


def mujoco_steps(arm: fp.Arm) -> list[Callable[[], object]]:
    """Return a shorter and a longer run of bare steps; both have the same mass matrix as ours."""
    model = mujoco_model(arm)
    data = mujoco.MjData(model)
    data.qpos[:] = arm.home
    mujoco.mj_forward(model, data)
    mass = np.zeros((arm.n, arm.n))
    mujoco.mj_fullM(model, data, mass)
    assert np.allclose(mass, arm.mass_matrix(arm.home), rtol=1e-9, atol=1e-9)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.zeros((1, size))
    mujoco.mj_getState(model, data, state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return [partial(rollout.rollout, model, data, state, nstep=steps) for steps in STEPS[1]]


def main() -> None:
    law = laws()["adaptive FPID, 24 modes"]
    heads = ["arm", "MuJoCo, a bare step [us]", "ours, the whole step, one / sixty", "of MuJoCo's"]
    print("\n".join(head(heads)))
    for name in ("ur5", "panda"):
        arm = fp.Arm.from_example(name)
        fp.evaluate(experiment_of(arm, 2), law)
        works = [*mujoco_steps(arm), *steps_of(arm, law, 1), *steps_of(arm, law, 60)]
        times = turn_by_turn(works, 25)
        bare, *ours = (marginal(times[k : k + 2], runs) for k, runs in ((0, 1), (2, 1), (4, 60)))
        cells = " / ".join(f"{1e6 * x:.2f}" for x in ours)
        parts = " / ".join(f"{x / bare:.2f}" for x in ours)
        print(row([name, f"{1e6 * bare:.2f}", cells, parts]))


if __name__ == "__main__":
    main()
