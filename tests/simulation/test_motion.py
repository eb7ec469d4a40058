"""The plants' motion against closed forms and a well-kept ODE solver; dry friction; sensors.

That each step solves the box problem of dry friction is in tests/kernels/test_kernel_rigid_body.py.
"""

import dataclasses

import numpy as np
import pytest
import scipy.optimize
from scipy.integrate import solve_ivp

import fpid_pin as fp
from fpid_pin.disturbances import Cosine
from fpid_pin.exceptions import SimulationError
from fpid_pin.kernels.rollout import measure
from fpid_pin.references import Hold
from fpid_pin.simulation.engine import SensorState


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


RUBBING = ("xarm7", "z1", "talos_arm")
SIDE = np.array([1, -1, 1, 1, -1, 1, -1])


@dataclasses.dataclass
class Push:
    """A torque beside gravity's, a function of time."""

    torque: object

    def sample(self, t):
        return np.array([np.atleast_1d(self.torque(time)) for time in t])


def moved(arm, torque, duration, step=1e-3, v0=None):
    """Let an arm whose gravity is compensated move under a torque."""
    experiment = fp.Experiment(
        arm, Hold(arm.home), v0=v0, duration=duration, step=step,
        plant=fp.Plant(disturbance=Push(torque)), dynamics="compiled",
    )  # fmt: skip
    return fp.simulate(experiment, fp.GravityOnly())


def bar(inertia, viscous=0.0):
    """One joint with this inertia, horizontal, F_d = 1 N m."""
    return fp.Arm.planar(1.0, inertia, gravity=0.0).with_friction(viscous, 1.0)


@pytest.mark.parametrize(("step", "v0"), [(1e-3, None), (2e-3, None), (1e-3, 0.05)])
@pytest.mark.parametrize("name", RUBBING)
def test_joints_rest_below_breakaway_and_come_to_rest_from_motion(name, step, v0):
    arm = fp.Arm.from_example(name)
    side = -1.0 if v0 else SIDE[: arm.n]
    run = moved(arm, lambda t: 0.9 * side * arm.dry_friction, 0.5, step, v0)
    assert np.abs(run.v[-1]).max() < 1e-9


@pytest.mark.parametrize("inertia", [1e-4, 1.0])
def test_a_sliding_joint_follows_the_closed_form(inertia):
    """M v' = tau - F_d - F_v v at twice the breakaway torque: v = F_d t/M where F_v is 0."""
    run = moved(bar(inertia), lambda t: 2.0, 0.05)
    assert run.v[:, 0] == pytest.approx(run.t / inertia, rel=1e-12)
    braked = moved(bar(10.0, viscous=2.0), lambda t: 2.0, 0.05)
    exact = 0.5 * -np.expm1(-2.0 * 0.05 / 10.0)
    assert braked.v[-1, 0] == pytest.approx(exact, rel=1e-2)


def test_light_joints_neither_chatter_nor_creep():
    """M = 1e-4, F_d = 1: a torque that swings inside the breakaway never moves the joint."""
    inside = moved(bar(1e-4), lambda t: 0.99 * np.sin(300 * t), 0.2)
    assert (inside.v == 0.0).all()
    # And one that swings past it: the speed turns twice a period, not every step.
    run = moved(bar(1e-4), lambda t: 1.5 * np.sin(20 * np.pi * t), 1.0)
    side = np.sign(run.v[1:, 0])
    turns = np.count_nonzero(np.diff(side[side != 0.0]))
    assert turns == 19
    # It starts where 1.5 sin a = 1, stops at b where the impulse is spent, starts again at a + pi.
    a = np.arcsin(1 / 1.5)
    b = scipy.optimize.brentq(lambda x: 1.5 * (np.cos(a) - np.cos(x)) - (x - a), 2.0, 4.0)
    assert np.mean(side[200:] == 0.0) == pytest.approx((a + np.pi - b) / np.pi, abs=0.02)


def test_a_stopping_joint_stops_where_it_should():
    """Sliding from v0 under F_d alone: the way to rest is M v0^2 / (2 F_d)."""
    run = moved(bar(0.5), lambda t: 0.0, 0.6, v0=1.0)
    assert run.v[-1, 0] == 0.0
    assert run.q[-1, 0] == pytest.approx(0.25, rel=3e-3)


STEP = 1e-3


def measured(sensors, q, v=None, seed=0):
    """Pass signals (K, n) through the sensors of a robot, (K, 2, n)."""
    rows, n = q.shape
    state, v = SensorState(sensors, seed, n, STEP), np.zeros_like(q) if v is None else v
    inputs, found = np.zeros((5, n)), np.zeros((rows, 2, n))
    for k in range(rows):
        measure(*state.records(k, 1), q[k], v[k], k, inputs)
        found[k] = inputs[:2]
    return found


def ramp(rows, slope=1.0):
    return slope * STEP * np.arange(rows)[:, np.newaxis]


def test_noise_has_its_standard_deviation_is_white_and_depends_on_the_seed():
    q = np.zeros((20_000, 2))
    sensors = fp.Sensors(position_noise=(1e-3, 0.0), velocity_noise=0.05)
    found = measured(sensors, q)
    assert found[:, 0, 0].std() == pytest.approx(1e-3, rel=0.03)
    assert (found[:, 0, 1] == 0.0).all()
    speed = found[:, 1]
    assert speed.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.03)
    neighbours = np.corrcoef(speed[1:, 0], speed[:-1, 0])[0, 1]
    between = np.corrcoef(speed[:, 0], speed[:, 1])[0, 1]
    assert abs(neighbours) < 0.03
    assert abs(between) < 0.03
    assert (measured(sensors, q[:100], seed=1)[:, 1] != speed[:100]).all()


def test_angles_are_late_and_in_whole_steps_and_rates_have_a_bias():
    """Before t = 0 the arm was at rest where it starts."""
    q, v = ramp(50, slope=0.37) + 0.3, ramp(50, slope=-2.0)
    sensors = fp.Sensors(delay=7, position_resolution=1e-2, velocity_bias=0.02)
    found, late = measured(sensors, q, v), np.concatenate([q[:1].repeat(7, axis=0), q[:-7]])
    assert found[:, 0] == pytest.approx(1e-2 * np.rint(late / 1e-2), abs=1e-12)
    assert found[7:, 1] == pytest.approx(v[:-7] + 0.02)
    # Noise comes before the steps.
    noisy = measured(dataclasses.replace(sensors, position_noise=0.02), q, v)[:, 0] / 1e-2
    assert noisy == pytest.approx(np.rint(noisy), abs=1e-9)
    assert np.abs(noisy - found[:, 0] / 1e-2).max() > 1.5


def test_differentiation_finds_the_speed_of_a_ramp_with_the_filters_lag():
    cutoff = 50.0
    q = ramp(400, slope=2.0)
    found = measured(fp.Sensors(velocity="differentiated", velocity_cutoff=cutoff), q)[:, 1, 0]
    t = STEP * np.arange(400)
    assert found == pytest.approx(2.0 * (1.0 - np.exp(-cutoff * t)), abs=1e-9)
