"""A law of one's own: parameters and a `torque` in NumPy; the base owns the rest.

What the base owns: scalars for all joints, (runs, n) stacks, the scale, the effort limits with
anti-windup, and that a law's fault ends the run that has it and no other.
"""

import dataclasses
import re
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike

import fpid_pin as fp

STEP = 1e-3
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [None, (28.0, 8.0)], ids=["unlimited", "saturated"])


@dataclass(frozen=True, eq=False)
class MyPd(fp.Controller):
    kp: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "my PD"

    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        return self.scale * (self.kp * (q_ref - q) + self.kd * (v_ref - v))


@dataclass(frozen=True, eq=False)
class MyPdGravity(MyPd):
    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        return super().torque(state, q, v, q_ref, v_ref, a_ref) + state.gravity(q)


@dataclass(frozen=True, eq=False)
class MyPid(fp.Controller):
    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "my PID"

    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        e, e_dot = q_ref - q, v_ref - v
        total = state.integral(e, e_dot)
        return self.scale * (self.kp * e + self.ki * total + self.kd * e_dot)


def two_link(limit=None):
    arm = fp.Arm.two_link()
    return arm if limit is None else arm.with_limits(effort=limit)


def paper(duration=1.0, limit=None):
    return dataclasses.replace(fp.paper_experiment(duration=duration), arm=two_link(limit))


def signals(count=500, seed=0):
    """Return q, v, q_ref, v_ref, a_ref, (count, 5, 2)."""
    return np.random.default_rng(seed).normal(0.0, 1.0, (count, 5, 2))


def factor(scale, arm):
    if scale == "none":
        return np.ones(arm.n)
    return np.diag(arm.mass_matrix(arm.home)) if scale == "inertia" else np.array(scale)


def same_run(one, other):
    assert one.outcome == other.outcome
    for name in ("t", "q", "v", "torque"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


# ---------------------------------------------------------------------- the law itself


@LIMITS
@SCALES
def test_a_pd_is_its_own_line_of_numpy_scaled_and_clipped(scale, limit):
    """The same operations in the same order: no tolerance."""
    arm = two_link(limit)
    kp, kd = np.array([30.0, 20.0]), np.array([7.0, 3.0])
    loop, s = MyPd(kp, kd, scale).start(arm, step=STEP), factor(scale, arm)
    cut = 0
    for q, v, q_ref, v_ref, a_ref in signals():
        u = s * (kp * (q_ref - q) + kd * (v_ref - v))
        cut += int((np.abs(u) > arm.effort_limit).any())
        torque = loop.torque(q, v, q_ref, v_ref, a_ref)
        assert np.array_equal(torque, np.clip(u, -arm.effort_limit, arm.effort_limit))
    assert (cut > 50) == (limit is not None)


@LIMITS
@SCALES
def test_its_integral_is_the_pid_s_with_anti_windup(scale, limit):
    gains = {"kp": (40.0, 30.0), "ki": (25.0, 20.0), "kd": (20.0, 5.0), "scale": scale}
    mine, theirs = MyPid(**gains), fp.Pid(**gains)
    arm = two_link(limit)
    loops = [law.start(arm, step=STEP) for law in (mine, theirs)]
    for row in signals(1000, seed=1):
        one, other = (loop.torque(*row) for loop in loops)
        assert np.array_equal(one, other)
    one, other = (fp.simulate(paper(2.0, limit), law) for law in (mine, theirs))
    if limit is not None:
        assert (np.abs(one.torque) == limit).any()
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.torque, other.torque)


@SCALES
def test_its_gravity_is_that_of_pd_with_gravity(scale):
    gains = {"kp": (40.0, 30.0), "kd": (20.0, 5.0), "scale": scale}
    one, other = (fp.simulate(paper(), law(**gains)) for law in (MyPdGravity, fp.PdGravity))
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.torque, other.torque)


@dataclass(frozen=True, eq=False)
class Model(fp.Controller):
    """Returns one of the models that a state offers."""

    what: str = "gravity"

    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        if self.what == "gravity":
            return state.gravity(q)
        if self.what == "coriolis":
            return state.coriolis(q, v)
        if self.what == "inverse_dynamics":
            return state.inverse_dynamics(q, v, a_ref)
        return np.full_like(q, state.step * state.arm.n)


def test_the_models_of_a_state_are_equation_35():
    """By hand, m3 = 0, masses 1 kg, links 1 and 0.8 m; Pinocchio rounds at some 50 N m."""

    def asked(what, row):
        return Model(what).start(fp.Arm.two_link(), step=STEP).torque(*row)

    for row in signals(20, seed=2):
        (q1, q2), (v1, v2), a = row[0], row[1], row[4]
        k = 0.8 * np.sin(q2)
        coriolis = np.array([-2.0 * k * v1 * v2 - k * v2**2, k * v1**2])
        g2 = 9.8 * 0.8 * np.cos(q1 + q2)
        gravity = np.array([9.8 * 2.0 * np.cos(q1) + g2, g2])
        m12 = 0.64 + 0.8 * np.cos(q2)
        mass = np.array([[2.64 + 1.6 * np.cos(q2), m12], [m12, 0.64]])
        assert np.abs(asked("coriolis", row) - coriolis).max() < 1e-12
        assert np.abs(asked("gravity", row) - gravity).max() < 1e-12
        whole = mass @ a + coriolis + gravity
        assert np.abs(asked("inverse_dynamics", row) - whole).max() < 1e-12
        assert (asked("step and arm", row) == 2.0 * STEP).all()


# ---------------------------------------------------------------------- parameters


def test_a_scalar_field_holds_for_every_joint():
    experiment = paper()
    one = fp.simulate(experiment, MyPd(30.0, 7.0))
    other = fp.simulate(experiment, MyPd((30.0, 30.0), [7.0, 7.0], (1.0, 1.0)))
    same_run(one, other)


def test_the_law_sees_a_row_a_run_and_its_description_stays_as_it_was():
    seen = []

    @dataclass(frozen=True, eq=False)
    class Watching(MyPd):
        def torque(self, state, q, v, q_ref, v_ref, a_ref):
            arrays = self.kp, self.kd, self.scale, v, q_ref, v_ref, a_ref
            seen.extend((np.shape(array), q.shape) for array in arrays)
            return super().torque(state, q, v, q_ref, v_ref, a_ref)

    laws = [Watching(30.0, (7.0, 3.0), "inertia"), Watching((10.0, 20.0), 7.0)]
    runs = fp.simulate(paper(0.01), laws)
    assert all(run.outcome.completed for run in runs)
    assert all(shape == expected for shape, expected in seen)
    assert {shape[1] for shape, _ in seen} == {2}
    assert np.array_equal(laws[0].kp, 30.0)
    assert np.array_equal(laws[0].kd, [7.0, 3.0])
    assert laws[0].scale == "inertia"
    assert runs[0].name == "my PD"


@pytest.mark.parametrize(
    "start",
    [
        lambda law: law.start(fp.Arm.two_link(), step=STEP),
        lambda law: fp.simulate(paper(), law),
        lambda law: fp.evaluate(paper(), [MyPd(1.0, 1.0), law]),
    ],
    ids=["loop", "simulation", "population"],
)
def test_a_field_of_the_wrong_length_is_named(start):
    with pytest.raises(
        fp.exceptions.ArgumentError, match=r"kp: expected shape \(2,\).* got .*3"
    ) as caught:
        start(MyPd((1.0, 2.0, 3.0), 1.0))
    assert "\n" not in str(caught.value)


def test_an_unknown_scale_is_named():
    with pytest.raises(fp.exceptions.ArgumentError, match="scale: expected one of none, inertia"):
        MyPd(1.0, 1.0, "inertial").start(fp.Arm.two_link(), step=STEP)


# ---------------------------------------------------------------------- populations


def population():
    scales = ["none", "inertia", (0.7, 1.9), 2.0, "none"]
    return [
        MyPid(20.0 + 5.0 * k, (10.0, 3.0 * k), 4.0 + k, scale) for k, scale in enumerate(scales)
    ]


@LIMITS
def test_a_population_has_the_bits_of_its_members_alone(limit):
    experiment, laws = paper(1.0, limit), population()
    for run, law in zip(fp.simulate(experiment, laws), laws, strict=True):
        same_run(run, fp.simulate(experiment, law))
    alone = [fp.evaluate(experiment, law)[0] for law in laws]
    assert np.isfinite(alone).all()
    assert np.array_equal(fp.evaluate(experiment, laws), alone)


def test_own_laws_and_the_package_s_run_side_by_side():
    experiment = paper(0.3)
    laws = [MyPd(30.0, 7.0), fp.paper_controller(), MyPid(30.0, 5.0, 7.0)]
    for run, law in zip(fp.simulate(experiment, laws), laws, strict=True):
        same_run(run, fp.simulate(experiment, law))


# ---------------------------------------------------------------------- faults

NEVER = 10.0  # rad; the reference is sin t


@dataclass(frozen=True, eq=False)
class Faulty(MyPid):
    """A PID that breaks where the reference is beyond `breaks_at`, after its integral has moved."""

    breaks_at: ArrayLike = NEVER
    how: str = "raises"

    def torque(self, state, q, v, q_ref, v_ref, a_ref):
        u = super().torque(state, q, v, q_ref, v_ref, a_ref)
        broken = q_ref > self.breaks_at
        if not broken.any():
            return u
        if self.how == "raises":
            raise ZeroDivisionError("thirteen is an unlucky number")
        if self.how == "shape":
            return np.zeros((len(q), 3))
        if self.how == "nothing":
            return None
        return np.where(broken, np.nan, u)


CAUSES = {
    "raises": r"ZeroDivisionError.*thirteen is an unlucky number",
    "shape": r"\((\d, )?2,?\).*\((\d, )?3,?\)",  # expected (1, 2), got (1, 3), or without the run
    "nothing": r"None|shape",
    "nan": r"not finite",
}
FAULTS = pytest.mark.parametrize("how", CAUSES)


def first_tick_beyond(angle):
    return int(np.flatnonzero(np.sin(STEP * np.arange(1001)) > angle)[0])


@FAULTS
def test_a_fault_ends_its_run_and_says_when_and_why(how):
    run = fp.simulate(paper(), Faulty(30.0, 5.0, 7.0, breaks_at=0.1, how=how))
    tick = first_tick_beyond(0.1)
    assert not run.outcome.completed
    assert run.outcome.time == pytest.approx(tick * STEP, abs=1e-12)
    assert re.search(CAUSES[how], run.outcome.cause)
    assert "\n" not in run.outcome.cause
    # What came before is on record, as it would have been without the fault to come.
    assert len(run.t) == tick
    whole = fp.simulate(paper(), MyPid(30.0, 5.0, 7.0))
    assert np.array_equal(run.q, whole.q[:tick])
    assert np.array_equal(run.torque, whole.torque[:tick])


@FAULTS
@pytest.mark.parametrize("limit", [None, (28.0, 8.0)], ids=["unlimited", "saturated"])
def test_the_other_runs_complete_with_the_bits_that_they_have_alone(how, limit):
    """Above all the integrals: whatever was tried to find the culprit, a tick counts once."""
    experiment = paper(1.0, limit)
    thresholds = [NEVER, 0.1, NEVER, 0.3, 0.1]
    laws = [
        Faulty(30.0 + 5.0 * k, (15.0, 4.0 * k), 7.0 + k, breaks_at=angle, how=how)
        for k, angle in enumerate(thresholds)
    ]
    runs = fp.simulate(experiment, laws)
    assert [run.outcome.completed for run in runs] == [True, False, True, False, False]
    for run, law in zip(runs, laws, strict=True):
        alone = fp.simulate(experiment, law)
        for name in ("t", "q", "v", "torque"):
            assert np.array_equal(getattr(run, name), getattr(alone, name)), name
        assert run.outcome.time == alone.outcome.time
    for run, angle in zip(runs, thresholds, strict=True):
        if angle < NEVER:
            assert len(run.t) == first_tick_beyond(angle)
            assert re.search(CAUSES[how], run.outcome.cause)


@FAULTS
def test_it_costs_infinity_and_the_others_what_they_cost_alone(how):
    laws = [
        Faulty(30.0 + 5.0 * k, 15.0, 7.0, breaks_at=angle, how=how)
        for k, angle in enumerate([NEVER, 0.1, NEVER])
    ]
    costs = fp.evaluate(paper(), laws)
    assert costs[1] == np.inf
    for k in (0, 2):
        assert costs[k] == fp.evaluate(paper(), laws[k])[0]
        assert np.isfinite(costs[k])


def test_a_fault_in_the_first_tick_leaves_an_empty_run():
    laws = [Faulty(30.0, 5.0, 7.0, breaks_at=angle) for angle in (-1.0, NEVER)]
    broken, sound = fp.simulate(paper(0.1), laws)
    assert not broken.outcome.completed
    assert broken.outcome.time == 0.0
    assert len(broken.t) == 0
    same_run(sound, fp.simulate(paper(0.1), laws[1]))


@pytest.mark.parametrize("shape", [(1, 3), (3,), (2,), (), (2, 2), (1, 1)])
def test_a_wrong_shape_in_single_use_is_one_clear_line(shape):
    """Also those that NumPy would stretch to (1, 2): a scalar torque is a mistake, not a wish."""

    @dataclass(frozen=True, eq=False)
    class Shaped(fp.Controller):
        def torque(self, state, q, v, q_ref, v_ref, a_ref):
            return np.zeros(shape)

    loop = Shaped().start(fp.Arm.two_link(), step=STEP)
    with pytest.raises(fp.FpidError) as caught:
        loop.torque(*np.zeros((4, 2)))
    line = str(caught.value)
    assert "\n" not in line
    # Expected and got, with the axis of runs (here one) or without.
    assert "(1, 2)" in line or "(2,)" in line
    assert str(shape) in line or str(shape[1:]) in line
