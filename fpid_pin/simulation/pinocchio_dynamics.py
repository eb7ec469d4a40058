"""Dynamics by Pinocchio itself, one robot and one call at a time: the reference.

    M(q) q'' + C(q, q') q' + G(q) + F_v q' + F_d sgn(q') = u + d(t)                     (6)

`write_terms` asks the nominal model what a controller wants to know, `move` takes the true arm a
step further. All else of a tick is what the compiled dynamics have, too.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from fpid_pin.checks import FloatArray
from fpid_pin.control.state import State
from fpid_pin.kernels import records
from fpid_pin.kernels.friction import apply_dry_friction
from fpid_pin.kernels.plant import finish_runge_kutta, runge_kutta_stage
from fpid_pin.kernels.rigid_body import factor_symmetric
from fpid_pin.simulation.experiment import Experiment, ResolvedPlant


class PinocchioDynamics:
    """The nominal arm of an experiment, and its true one with friction."""

    def __init__(self, plant: ResolvedPlant, experiment: Experiment) -> None:
        self.step, self.euler = experiment.step, experiment.integrator != "rk4"
        self.nominal = experiment.arm.model
        self.nominal_data = self.nominal.createData()
        self.true = plant.arm.model.copy()
        if self.euler:
            # (M + h F_v) a = tau - F_v v - C v - G: viscous friction is implicit in the speed.
            extra = self.step * plant.viscous_friction
            self.true.armature = np.array(self.true.armature) + extra
        self.true_data = self.true.createData()

    def write_terms(self, state: State) -> None:
        """Write what the nominal model says of this sample, as `tick.evaluate_model` does."""
        model, data = self.nominal, self.nominal_data
        robot, terms, joints = state.c.robot[0], state.c.terms, state.joints
        q, v, q_ref, v_ref, a_ref = state.inputs
        if robot.uses_model:
            w, a = np.array(joints["w"]), np.array(joints["a"])
            # C(q, v) w is bilinear and symmetric: with c(x) = C(q, x) x it is
            # c((v + w)/2) - c((v - w)/2).
            terms[records.LAW_TERM] = pin.rnea(model, data, q, 0.5 * (v + w), a)
            if not np.array_equal(v, w):
                terms[records.LAW_TERM] -= self._coriolis(q, 0.5 * (v - w))
        if robot.feedforward:
            terms[records.FEEDFORWARD] = pin.rnea(model, data, q_ref, v_ref, a_ref)
        if robot.paper and robot.acting:
            terms[records.GRAVITY] = pin.computeGeneralizedGravity(model, data, q)
            terms[records.CORIOLIS] = self._coriolis(q, v)
            state.c.mass[:] = pin.crba(model, data, q).T  # its upper half is filled, ours the lower
        if robot.observes or robot.sampled:
            v_hat = np.array(joints["v_hat"])
            terms[records.BIAS] = pin.nonLinearEffects(model, data, q, v_hat)
            state.c.mass[:] = pin.crba(model, data, q).T

    def _coriolis(self, q: FloatArray, v: FloatArray) -> FloatArray:
        model, data = self.nominal, self.nominal_data
        bias = np.array(pin.nonLinearEffects(model, data, q, v))
        return np.asarray(bias - pin.computeGeneralizedGravity(model, data, q))

    def _acceleration(self, q: FloatArray, v: FloatArray, tau: FloatArray) -> FloatArray:
        return np.array(pin.aba(self.true, self.true_data, q, v, tau))

    def move(
        self, plant: records.Plant, has_dry_friction: bool, forces: FloatArray, k: int
    ) -> None:
        """Take the true arm one step further with `plant.tau` held: see `kernels.plant.move`."""
        plant.a[:] = self._acceleration(plant.q, plant.v, plant.tau)
        if self.euler:
            plant.v[:] += self.step * plant.a
            if has_dry_friction:
                plant.mass[:] = pin.crba(self.true, self.true_data, plant.q).T
                factor_symmetric(plant.mass)
                apply_dry_friction(plant.mass, plant.joints, plant.v, plant.workspace, self.step)
            plant.q[:] += self.step * plant.v
            return
        stages = plant.workspace[records.WORKSPACE + 2 * len(plant.q) :]
        stages[3], stages[4] = plant.v, plant.a
        for i in range(1, 4):
            runge_kutta_stage(
                plant.joints, plant.q, plant.v, plant.tau, stages, forces, k, i, self.step
            )
            stages[4 + 2 * i] = self._acceleration(stages[0], stages[1], stages[2])
        finish_runge_kutta(plant.q, plant.v, stages, self.step)
