"""Dry friction in simulations: rests below breakaway, slides as the closed form says.

That each step solves its box problem is in tests/kernels/test_kernel_rigid_body.py.
"""

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.optimize
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.kernels.functions import sign
from fpid_pin.references import Sinusoid

RUBBING = ("xarm7", "z1", "talos_arm")
SIDE = np.array([1, -1, 1, 1, -1, 1, -1])


@dataclass
class Push:
    """A torque beside gravity's, a function of time."""

    torque: object

    def sample(self, t):
        return np.array([np.atleast_1d(self.torque(time)) for time in t])


def moved(arm, torque, duration, step=1e-3, v0=None):
    """Let an arm whose gravity is compensated move under a torque."""
    experiment = fp.Experiment(
        arm, fp.references.Hold(arm.home), v0=v0, duration=duration, step=step,
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


@dataclass(frozen=True, eq=False)
class Tracking(fp.ComputedTorque):
    """Computed torque with the friction of the reference fed forward."""

    dry: ArrayLike = 0.0

    @staticmethod
    def torque(c):
        return c.viscous * c.v_ref + c.dry * sign(c.v_ref)


@pytest.mark.parametrize("name", RUBBING)
def test_stiff_friction_is_stable_at_one_and_two_milliseconds(name):
    arm = fp.Arm.from_example(name).with_limits(effort=np.inf)
    swing = Sinusoid(0.3, 2.0, offset=arm.home, phase=np.arange(arm.n))
    law, paths = Tracking(100.0, 20.0, dry=arm.dry_friction), []
    for step in (1e-3, 2e-3):
        experiment = fp.Experiment(
            arm, swing, q0=arm.home, duration=5.0, step=step, dynamics="compiled"
        )
        run = fp.simulate(experiment, law)
        assert np.abs(run.v).max() < 5.0
        # Every joint slides both ways and stops between; none flips from step to step.
        side = np.sign(run.v)
        assert ((side > 0).any(axis=0) & (side < 0).any(axis=0) & (side == 0).any(axis=0)).all()
        assert np.count_nonzero(side[1:] * side[:-1] < 0, axis=0).max() <= 10
        paths.append(run.q)
    # Twice the step, the same motion.
    assert np.abs(paths[0][::2] - paths[1]).max() < 5e-3
