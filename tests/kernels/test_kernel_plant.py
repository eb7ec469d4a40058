"""Sensors, drives, one step of motion, sums of figures of merit, and whole stretches of a run."""

import dataclasses

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fpid_pin as fp
from fpid_pin.kernels import functions, metrics, plant, rollout, sensors
from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.records import MEASURE, PLANT, SENSOR
from fpid_pin.references import Sinusoid

pytestmark = pytest.mark.kernels
numbers = st.floats(-1e6, 1e6)


def records(kind, n, **values):
    found = np.zeros(n, kind)
    for name, value in values.items():
        found[name] = value
    return found


# ---------------------------------------------------------------------- numbers


clip, winds_up, sign = map(kernel, (functions.clip, functions.winds_up, functions.sign))


@given(numbers, st.floats(0.0, 1e6))
def test_a_clipped_number_is_the_nearest_within(x, limit):
    assert clip(x, limit) == float(np.clip(x, -limit, limit))
    assert sign(x) == np.sign(x)


def test_what_is_not_finite_stays_and_inf_is_no_limit():
    for x, limit in ((np.nan, 1.0), (1e300, np.inf), (-np.inf, 2.0), (np.inf, 2.0)):
        assert np.array_equal(clip(x, limit), x, equal_nan=True)


@given(numbers, numbers)
def test_only_a_push_in_the_direction_of_the_cut_winds_up(cut, push):
    expected = np.sign(cut) * np.sign(push) > 0.0 and abs(cut * push) > 0.0
    assert winds_up(cut, push) == expected


@given(st.one_of(st.floats(-1e9, 1e9), st.integers(-1000, 1000).map(lambda k: k + 0.5)))
def test_numbers_are_rounded_as_numpy_does(x):
    assert sensors.rounded(x) == np.rint(x)


# ---------------------------------------------------------------------- sensors


def test_delay_noise_bias_steps_and_filter_come_in_this_order():
    joints = records(
        SENSOR, 2, delay=[2, 0], noise_q=0.1, noise_v=0.2, bias=0.3, resolution=[0.0, 0.25],
        derived=[0, 1], keep=0.5, gain=50.0,
    )  # fmt: skip
    history, noise = np.zeros((3, 2, 2)), np.random.default_rng(0).normal(size=(4, 2, 2))
    inputs, kept, last = np.zeros((5, 2)), 0.0, None
    q, v = np.random.default_rng(1).normal(size=(2, 6, 2))
    for tick in range(6):
        sensors.measure(joints, history, noise, q[tick], v[tick], tick, inputs)
        # Before t = 0 the arm is taken to have been where it starts.
        late, own = max(tick - 2, 0), noise[tick % 4]
        assert inputs[0, 0] == pytest.approx(q[late, 0] + 0.1 * own[0, 0], rel=1e-15)
        assert inputs[1, 0] == pytest.approx(v[late, 0] + 0.2 * own[1, 0] + 0.3, rel=1e-15)
        angle = np.rint((q[tick, 1] + 0.1 * own[0, 1]) / 0.25) * 0.25
        kept = 0.5 * kept + 50.0 * (angle - (angle if last is None else last))
        last = angle
        assert inputs[0, 1] == pytest.approx(angle)
        assert inputs[1, 1] == pytest.approx(kept)


def test_no_sensors_and_perfect_ones_tell_the_truth():
    q, v = np.random.default_rng(2).normal(size=(2, 2))
    for n in (0, 2):
        inputs = np.zeros((5, 2))
        sensors.measure(
            np.zeros(n, SENSOR), np.zeros((1, 2, 2)), np.zeros((0, 2, 2)), q, v, 0, inputs
        )
        assert (inputs[:2] == [q, v]).all()


# ---------------------------------------------------------------------- figures of merit


@pytest.mark.parametrize("first", [(1.0, -0.5), (-1.0, 0.02)])
def test_the_sums_are_those_of_the_whole_record(first):
    """In blocks of one row and of five, with a reference and without."""
    q, q_ref, torque = np.random.default_rng(0).normal(size=(3, 9, 2))
    torque = np.clip(torque, -0.8, 0.8)
    q[0] = q_ref[0] - first
    q[6:, 1] = q_ref[6:, 1] + 0.01
    e, u, t = q_ref - q, torque, 0.1 * np.arange(9)[:, np.newaxis]
    expected = {
        "square": (e**2).sum(0), "late": (e[4:] ** 2).sum(0), "absolute": np.abs(e).sum(0),
        "aged": (t * np.abs(e)).sum(0), "effort": (u**2).sum(0), "peak": np.abs(u).max(0),
        "changes": np.abs(np.diff(u, axis=0)).sum(0), "jumps": (np.diff(u, axis=0) ** 2).sum(0),
        "start": e[0], "worst": np.abs(e).max(0), "last": u[-1],
        "beyond": np.maximum((-np.sign(e[0]) * e).max(0), 0.0),
        "at_limit": (np.abs(u) >= 0.8).sum(0), "rows": 9, "late_rows": 5,
        "settled": [1 + np.flatnonzero(np.abs(column) > 0.1).max() for column in e.T],
    }  # fmt: skip
    whole, parts = (records(MEASURE, 2, limit=0.8, band=0.1) for _ in range(2))
    motion = np.stack([q, 0 * q, torque])
    metrics.measure_rows(whole, q_ref[np.newaxis], motion, 4, 0.1)
    for k in range(9):
        metrics.measure_joints(parts, q_ref[np.newaxis, k:], motion[:, k:], 0, k, 4, 0.1)
    assert (whole == parts).all()
    for name, value in expected.items():
        assert whole[name] == pytest.approx(np.broadcast_to(value, 2), rel=1e-13), name


# ---------------------------------------------------------------------- drives and motion


def test_drives_clip_and_friction_brakes_and_all_is_recorded():
    joints = records(PLANT, 2, limit=[5.0, np.inf], viscous=0.5, push=[0.0, 1.0])
    q, v = np.random.default_rng(0).normal(size=(2, 2))
    torque, forces = np.array([9.0, -7.0]), np.arange(8.0).reshape(1, 4, 2)
    motion, tau = np.zeros((3, 4, 2)), np.zeros(2)
    assert not plant.apply_actuators(joints, q, v, torque, forces, motion, 2, tau)
    assert motion[2, 2].tolist() == [5.0, -7.0]
    assert (motion[:2, 2] == [q, v]).all()
    assert tau == pytest.approx([5.0, -6.0] - 0.5 * v + forces[0, 2], rel=1e-14)
    for bad in (np.nan, np.inf):
        torque[0] = bad
        assert plant.apply_actuators(joints, q, v, torque, forces, motion, 3, tau)
        assert not np.isfinite(motion[2, 3, 0])


def test_semi_implicit_euler_uses_the_new_rate():
    q, v, a = np.random.default_rng(1).normal(size=(3, 2))
    expected = q + 0.1 * (v + 0.1 * a)
    plant.integrate_velocity(v, a, 0.1)
    plant.integrate_position(q, v, 0.1)
    assert (q == expected).all()


def test_runge_kutta_integrates_a_cubic_exactly():
    """q'' = 6 t has q = t^3; its stages look at t = 0, h/2, h/2, h."""
    h, q, v = 0.3, np.zeros(1), np.zeros(1)
    forces = 6.0 * np.array([0.0, h / 2, h]).reshape(3, 1, 1)
    stages = np.zeros((11, 1))
    for i in range(1, 4):
        plant.runge_kutta_stage(np.zeros(1, PLANT), q, v, np.zeros(1), stages, forces, 0, i, h)
        stages[4 + 2 * i] = stages[2]
    plant.finish_runge_kutta(q, v, stages, h)
    assert v[0] == pytest.approx(3.0 * h**2, rel=1e-14)
    assert q[0] == pytest.approx(h**3, rel=1e-14)


def test_a_stage_brakes_by_its_own_rate():
    stages = np.zeros((11, 1))
    stages[3:5] = 2.0
    joints = records(PLANT, 1, viscous=3.0)
    args = np.ones(1), np.ones(1), np.full(1, 10.0), stages, np.zeros((3, 1, 1))
    plant.runge_kutta_stage(joints, *args, 0, 1, 1.0)
    assert stages[:3, 0].tolist() == [2.0, 2.0, 10.0 - 3.0 * (2.0 - 1.0)]


def test_a_joint_that_runs_away_or_loses_its_numbers_is_found():
    joints = records(PLANT, 2, runaway=10.0)
    assert not plant.has_diverged(joints, np.zeros(2), np.array([10.0, -10.0]))
    for q, v in ((0.0, 10.1), (0.0, -10.1), (0.0, np.nan), (np.inf, 0.0), (np.nan, 0.0)):
        assert plant.has_diverged(joints, np.array([0.0, q]), np.array([0.0, v]))


# ---------------------------------------------------------------------- stretches of a run

ARM = fp.Arm.planar((0.5, 0.4, 0.3), (1.0, 0.8, 0.5)).with_friction(viscous=0.1)
#: Without compilation (test_line_by_line) a few ticks go through every branch.
DURATION = 0.012 if numba.config.DISABLE_JIT else 0.03
BASE = fp.Experiment(ARM, Sinusoid(0.4, 3.0), q0=0.05, v0=1.1, duration=DURATION)
NOISE = fp.Sensors(position_resolution=1e-3, velocity_noise=0.05, delay=2)
RUBS = fp.Plant(ARM.with_payload(0.3), dry_friction=(0.5, 0.2, 0.1), effort_limit=(40.0, 20.0, 5.0))
FPID = fp.AdaptiveFpid(40.0, 20.0, 4.0, 0.8, 0.7, design=fp.fractional.ExponentialSum(8))


@dataclasses.dataclass(frozen=True, eq=False)
class OfItsSurface(fp.Controller):
    """Joint by joint, with operators of a signal of its own."""

    order: float = 0.5
    operators = {
        "i_s": fp.control.Integral("order", of="s"), "d_s": fp.control.Derivative(0.5, of="s"),
    }  # fmt: skip

    @staticmethod
    def surface(c):
        c.s = c.e_dot + 5.0 * c.e

    @staticmethod
    def torque(c):
        return 4.0 * c.s + 10.0 * c.i_s + 0.1 * c.d_s


STRETCHES = {
    "FPID": (BASE, FPID),
    "FPID, adaptive orders, Runge-Kutta": (
        dataclasses.replace(BASE, integrator="rk4"),
        dataclasses.replace(FPID, order_learning_rate=0.1),
    ),
    "FPID, noise and friction": (
        dataclasses.replace(BASE, sensors=NOISE, plant=RUBS),
        dataclasses.replace(FPID, feedforward=True, supervisor=fp.Supervisor.quiet(0.8, 0.7)),
    ),
    "Slotine-Li": (dataclasses.replace(BASE, plant=RUBS), fp.SlotineLi(5.0, 5.0)),
    "operators of its own signal": (BASE, OfItsSurface()),
    "weight": (BASE, fp.GravityOnly()),
    "computed torque": (BASE, fp.ComputedTorque(60.0, 15.0)),
}


@pytest.mark.parametrize("name", STRETCHES)
def test_a_stretch_is_the_run_that_pinocchio_and_python_make_tick_by_tick(name):
    experiment, law = STRETCHES[name]
    runs = [
        fp.simulate(dataclasses.replace(experiment, dynamics=dynamics), law)
        for dynamics in ("compiled", "pinocchio")
    ]
    for array in ("q", "v", "torque", *runs[0].signals):
        found, expected = (getattr(run, array) for run in runs)
        assert np.abs(found - expected).max() < 1e-11 * max(1.0, np.abs(expected).max()), array
    assert np.abs(np.diff(runs[0].torque, axis=0)).min(axis=1).max() > 0.0


@pytest.mark.parametrize(("torque", "speed"), [(1.7e308, 1e3), (50.0, 3.0)])
def test_a_stretch_ends_where_a_number_is_lost_or_a_joint_runs_away(torque, speed):
    law = fp.Pid(torque, 0.0, 0.0)
    experiment = dataclasses.replace(BASE, q0=1.5, dynamics="compiled", runaway_speed=speed)
    run = fp.simulate(experiment, law)
    other = fp.simulate(dataclasses.replace(experiment, dynamics="pinocchio"), law)
    assert not run.outcome.completed
    assert run.outcome == other.outcome
    assert len(run.t) == round(run.outcome.time / run.step) <= round(DURATION / run.step)


def test_rows_are_loaded_and_kept_by_their_numbers():
    reference, inputs = np.arange(24.0).reshape(3, 4, 2), np.zeros((5, 2))
    rollout.load_reference(reference, 2, inputs)
    assert (inputs[2:] == reference[:, 2]).all()
    own, kept = np.arange(10.0).reshape(2, 5), np.zeros((2, 3, 2))
    rollout.keep_signals(own, np.array([4, 1]), kept, 1)
    assert (kept[:, 1] == own[:, [4, 1]].T).all()
