"""The plants' motion against closed forms and a well-kept ODE solver."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fpid_pin as fp
from fpid_pin.disturbances import Cosine
from fpid_pin.exceptions import SimulationError
from fpid_pin.references import Hold


class Free(fp.Controller):
    """No torque at all."""

    @staticmethod
    def torque(c):
        return 0.0


def swing(integrator, step, plant=None, duration=1.0, arm=None):
    experiment = fp.Experiment(
        arm or fp.Arm.two_link(), Hold(), q0=(0.3, -0.4), v0=(0.5, 1.0), plant=plant,
        step=step, duration=duration, integrator=integrator, dynamics="compiled",
    )  # fmt: skip
    return fp.simulate(experiment, Free())


def exact(t, viscous=(0.0, 0.0), disturbance=None):
    arm = fp.Arm.two_link()

    def slope(time, x):
        d = np.zeros(2) if disturbance is None else disturbance.sample(np.array([time]))[0]
        return np.concatenate([x[2:], arm.forward_dynamics(x[:2], x[2:], d - viscous * x[2:])])

    solution = solve_ivp(
        slope, (0, t), [0.3, -0.4, 0.5, 1.0], method="DOP853", rtol=1e-12, atol=1e-12
    )
    return solution.y[:2, -1]


@pytest.mark.parametrize(("integrator", "order"), [("semi_implicit_euler", 1), ("rk4", 4)])
def test_the_error_falls_with_the_step_at_the_rule_s_order(integrator, order):
    viscous = np.array([0.3, 0.1])
    plant = fp.Plant(viscous_friction=viscous, disturbance=Cosine((0.4, 0.6)))
    truth = exact(1.0, viscous, plant.disturbance)
    steps = (4e-3, 2e-3) if order == 1 else (2.5e-3, 1.25e-3)
    errors = [np.abs(swing(integrator, h, plant).q[-1] - truth).max() for h in steps]
    assert errors[0] / errors[1] == pytest.approx(2.0**order, rel=0.15)
    assert errors[1] < (2e-2 if order == 1 else 1e-9)


def test_implicit_viscous_friction_is_stable_where_the_explicit_rule_is_not():
    """One joint of inertia 1e-3 and F_v = 10: the explicit factor would be 1 - 10."""
    arm = fp.Arm.planar([0.1], [0.1], gravity=0.0).with_friction(viscous=10.0)
    run = fp.simulate(fp.Experiment(arm, Hold(), v0=1.0, duration=0.02), Free())
    inertia = arm.mass_matrix(np.zeros(1))[0, 0]
    decay = inertia / (inertia + 1e-3 * 10.0)
    assert np.allclose(run.v[:, 0], decay ** np.arange(len(run.t)), rtol=1e-12)


def test_rk4_refuses_what_it_cannot_follow_and_says_why():
    with pytest.raises(SimulationError, match=r"rk4: dry friction on joint \w+ jumps"):
        swing("rk4", 1e-3, fp.Plant(dry_friction=(0.0, 0.1)))
    with pytest.raises(SimulationError, match=r"too stiff for a step of 0.001 s .at most"):
        swing("rk4", 1e-3, fp.Plant(viscous_friction=1e3))


def test_the_drives_clip_at_the_plant_s_limits():
    experiment = dataclasses.replace(
        fp.paper_experiment(duration=0.5), plant=fp.Plant(effort_limit=(15.0, 4.0))
    )
    run = fp.simulate(experiment, fp.paper_controller())
    assert (np.abs(run.torque).max(axis=0) == [15.0, 4.0]).all()
    assert (run.torque == np.clip(run.u_fpid + run.u_s, [-15.0, -4.0], [15.0, 4.0])).all()
