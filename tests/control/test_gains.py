"""Suggested gains suit arms that nobody tuned, in boxes that are stable; ceilings are where loops
break. Judged by simulations and by closed forms."""

import dataclasses
import itertools
import logging
import re
import warnings

import numpy as np
import pinocchio as pin
import pytest

import fpid_pin as fp
from fpid_pin.control import Safeguards, explain_gains, gain_ceilings, suggest_gains
from fpid_pin.control.ceilings import DerivativeBound
from fpid_pin.control.poses import gravity_instability, heaviness
from fpid_pin.disturbances import Pulse
from fpid_pin.references import Hold
from fpid_pin.tuning.problem import Problem

TWO = fp.Arm.two_link()


def arm_named(name):
    return TWO if name == "two_link" else fp.Arm.from_example(name)


@pytest.fixture(scope="module")
def kinova():
    """An arm at a step at which much has to be lowered."""
    arm = fp.Arm.from_example("kinova")
    return arm, explain_gains(arm, step=2e-3)


@pytest.mark.parametrize(("name", "mu"), [("two_link", 0.8), ("panda", 0.95), ("ur10", 1.0)])
def test_the_loop_breaks_where_the_sampled_bound_says(name, mu):
    # No gravity, no friction, one pose: the derivative term alone, raised until it breaks.
    arm = arm_named(name).with_gravity(0.0).with_friction(viscous=0.0).with_limits(effort=0.0)
    law = fp.AdaptiveFpid(
        kp=0.0, ki=0.0, kd=1.0, derivative_order=mu, learning_rate=0.0, scale="inertia"
    )
    limit = gain_ceilings(arm, law, poses=1).kd_limit[0]
    experiment = fp.Experiment(
        arm, Hold(arm.home), v0=np.full(arm.n, 1e-7), duration=0.5, dynamics="compiled"
    )
    laws = [dataclasses.replace(law, kd=limit * x) for x in (0.9, 0.97, 1.03, 1.1)]
    # A loop that has broken throws the arm about until it finds a pose that it can bear.
    peaks = [np.abs(r.v).max() for r in fp.simulate(experiment, laws)]
    assert max(peaks[:2]) < 1e-5
    assert min(peaks[2:]) > 1e-3


def test_the_last_bits_of_gains_do_not_move_the_limit_of_an_arm_that_is_nearly_singular(kinova):
    arm, found = kinova
    rng, kd = np.random.default_rng(0), np.asarray(found.controller.kd)
    changes = [1e-12 * rng.normal(size=arm.n) for _ in range(8)]
    laws = [dataclasses.replace(found.controller, kd=kd * (1.0 + x), learning_rate=0.0,
                                safeguards=None) for x in changes]  # fmt: skip
    limits = [gain_ceilings(arm, law, step=2e-3).kd_limit for law in laws]
    # Nor does it matter which poses a search starts from.
    limits += [gain_ceilings(arm, laws[0], step=2e-3, seed=seed).kd_limit for seed in (1, 2)]
    assert (np.ptp(limits, axis=0) < 0.01 * np.min(limits, axis=0)).all()


@pytest.mark.parametrize("name", ["kinova", "z1"])
def test_the_derivatives_that_worst_poses_are_searched_by_are_those_of_the_measures(name):
    arm, step = arm_named(name).with_friction(viscous=0.1), 1e-5
    law = suggest_gains(arm, adaptive=False)
    bound = DerivativeBound(arm, law, step=1e-3, horizon=20.0)
    measures = (
        lambda q: bound.load_at(np.asarray(law.kd), q)[::2],
        lambda q: heaviness(arm, law.scale, q),
        lambda q: gravity_instability(arm, law.scale, q),
    )
    for measure, q in itertools.product(measures, bound.poses[1:4]):
        value, slope = measure(q)
        sides = [[measure(q + sign * x)[0] for x in step * np.eye(arm.n)] for sign in (1.0, -1.0)]
        assert slope == pytest.approx(np.subtract(*sides) / (2.0 * step), abs=1e-5 * value)


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_a_joint_that_friction_stops_within_a_step_bears_half_of_two_over_the_step(step):
    arm = fp.Arm.planar(lengths=(0.3,), masses=(0.1,), gravity=0.0).with_friction(viscous=1e3)
    law = fp.AdaptiveFpid(
        kp=0.0, ki=0.0, kd=1.0, derivative_order=1.0, learning_rate=0.0, scale="inertia"
    )
    inertia = arm.mass_matrix(arm.home)[0, 0]
    limit = gain_ceilings(arm, law, step=step).kd_limit[0] * inertia  # N m s/rad
    assert limit == pytest.approx(2.0 * inertia / step + 1e3, rel=1e-9)
    # q'+ = q' - h (Kd + F_v) q'/(M + h F_v)
    factors = [
        1.0 - step * (part * limit + 1e3) / (inertia + step * 1e3) for part in (0.999, 1.001)
    ]
    assert factors[1] < -1.0 < factors[0]


def grows(arm, law, gains, q, step):
    """Kick the arm, at rest at q with its weight held, under a law whose gains stand still."""
    fixed = dataclasses.replace(
        law, kp=gains[0], ki=gains[1], kd=gains[2], learning_rate=0.0, safeguards=None
    )
    rng = np.random.default_rng(0)
    experiment = fp.Experiment(
        arm.with_limits(effort=0.0), Hold(q), q0=q, v0=1e-7 * rng.normal(size=arm.n),
        plant=fp.Plant(disturbance=Pulse(arm.gravity_vector(q))), step=step, duration=5.0,
        dynamics="compiled",
    )  # fmt: skip
    moved = np.abs(fp.simulate(experiment, fixed).q - q).max(axis=1)
    half = len(moved) // 2
    # What breaks away may come to rest at a pose that it can bear.
    return moved.max() > 1e-3 or moved[half:].max() > 0.9 * moved[:half].max()


def some_gains(low, high, count, rng):
    """Yield some corners at which joints are alike, random corners, and random gains inside."""
    for corner in itertools.product((0.0, 1.0), repeat=3):
        yield low + np.array(corner)[:, np.newaxis] * (high - low)
    for k in range(count):
        part = rng.random(low.shape)
        yield low + (part if k % 2 else np.round(part)) * (high - low)


@pytest.mark.parametrize(("name", "step"), [("ur5", 4e-3), ("kinova", 2e-3), ("finger_edu", 4e-3)])
def test_no_gains_of_the_suggested_box_are_unstable_where_they_stand_still(name, step, kinova):
    rng, arm = np.random.default_rng(3), arm_named(name)
    law = kinova[1].controller if name == "kinova" else suggest_gains(arm, step=step)
    low, high = Safeguards.bounds_of(law.safeguards, arm.n)
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    ceilings = gain_ceilings(arm, law, step=step, seed=5)
    for k, gains in enumerate(some_gains(low, high, 6, rng)):
        q = (ceilings.pose, arm.home, rng.uniform(lower, upper))[k % 3]
        assert not grows(arm, law, gains, q, step), (k, gains)
    # And the check itself finds what is unstable.
    assert grows(arm, law, np.stack([low[0], low[1], 1.1 * ceilings.kd_limit]), ceilings.pose, step)


def zeros_within(arm, law, ratio, largest):
    """Count zeros of det(M s^2 + F s + G' + s (Kp + Ki s^-lambda + Kd s^mu)) by their argument.

    In continuous time and without modes, in the sector of damping ratios below `ratio`.
    """
    q, n = arm.home, arm.n
    stiffness = pin.computeGeneralizedGravityDerivatives(arm.model, arm.model.createData(), q)
    turn = np.pi - np.arccos(ratio)
    radius = np.geomspace(0.05, largest, 2000)
    angle = np.linspace(-turn, turn, 1000)
    path = np.concatenate([
        largest * np.exp(1j * angle), radius[::-1] * np.exp(1j * turn),
        0.05 * np.exp(1j * angle[::-1]), radius * np.exp(-1j * turn),
    ])  # fmt: skip
    lam, mu = float(np.mean(law.integral_order)), float(np.mean(law.derivative_order))
    scaled = [law.scale_on(arm) * np.asarray(k) for k in (law.kp, law.ki, law.kd)]
    s = path[:, np.newaxis]
    own = arm.viscous_friction * s + scaled[0] + scaled[1] * s**-lam + scaled[2] * s**mu
    whole = arm.mass_matrix(q) * s[:, :, np.newaxis] ** 2 + stiffness
    signs, _ = np.linalg.slogdet(whole + own[:, :, np.newaxis] * np.eye(n))
    return round(np.ptp(np.unwrap(np.angle(signs))[[0, -1]]) / (2.0 * np.pi))


@pytest.mark.parametrize(("name", "bandwidth"), [("two_link", 10.0), ("ur10", 20.0)])
def test_the_damping_ratio_at_home_is_that_of_the_fractional_loop(name, bandwidth):
    arm = arm_named(name)
    found = explain_gains(arm, bandwidth, adaptive=False)
    low, high = 0.0, 1.0
    for _ in range(10):
        middle = 0.5 * (low + high)
        empty = zeros_within(arm, found.controller, middle, 0.25 * np.pi / 1e-3) == 0
        low, high = (middle, high) if empty else (low, middle)
    # Six modes and a step of 1 ms on the one side, neither on the other.
    assert found.damping_ratio == pytest.approx(low, abs=0.05)
    assert found.damping_ratio >= found.least_damping_ratio
    assert found.damping_ratio > 0.38
    assert found.notes == () if name == "two_link" else found.notes


def test_what_is_lowered_is_said_and_logged(kinova, caplog):
    arm, found = kinova
    kp = np.asarray(found.controller.kp)
    text = str(found)
    assert "derivative order 0.6 instead of 0.95: at a step of 2 ms" in text
    for joint, k in zip(arm.joint_names, kp, strict=True):
        assert (f"joint {joint}: Kp at" in text) == (k < 95.0)
    assert kp.min() < 95.0 < kp.max()
    assert found.bandwidth == pytest.approx(np.sqrt(kp))
    arm = fp.Arm.from_example("asr_twodof")
    with caplog.at_level(logging.INFO, logger="fpid_pin"):
        suggest_gains(arm, 40.0, step=4e-3, adaptive=False)
    notes = explain_gains(arm, 40.0, step=4e-3, adaptive=False).notes
    assert notes
    assert [record.getMessage() for record in caplog.records] == [
        f"asr_twodof: {note}" for note in notes
    ]


def test_a_search_that_gets_stuck_begins_again_at_less_bandwidth():
    # From the full bandwidth it ends at gains that are unstable.
    found = explain_gains(
        fp.Arm.from_example("finger_edu"), step=4e-3, derivative_order=0.95, adaptive=False
    )
    assert float(found.controller.derivative_order) == 0.95
    assert found.least_damping_ratio > 0.05
    assert found.damping_ratio > 0.25


def test_an_arm_for_which_no_stable_gains_are_found_is_warned_of():
    # Upright, it falls over within a sample.
    arm = fp.Arm.planar(lengths=(0.1,), masses=(1.0,))
    with pytest.warns(fp.FpidWarning, match="at a step of 500 ms no gains are found"):
        suggest_gains(arm, step=0.5, adaptive=False)


def test_friction_counts_in_the_scale_and_the_effort_limit_bounds_it():
    rough = TWO.with_friction(viscous=1.0, dry=1.0)
    found = [np.asarray(suggest_gains(arm, adaptive=False).scale) for arm in (rough, TWO)]
    added = found[0] - found[1]
    assert added == pytest.approx(np.full(2, 1.0 / 10.0 + 1.0 / (0.09 * 100.0)))
    weak = TWO.with_gravity(0.0).with_limits(effort=2.0)
    assert (np.asarray(suggest_gains(weak).scale) * 100.0 * 0.05 <= 2.0 + 1e-12).all()


def test_a_description_and_the_function_make_the_same_law_with_all_that_was_asked_for():
    options = {"adaptive": False, "feedforward": True, "order_learning_rate": 0.1,
               "supervisor": fp.Supervisor.quiet(3.0, 1.0), "name": "mine"}  # fmt: skip
    law = suggest_gains(TWO, 8.0, step=2e-3, **options)
    same = fp.SuggestedFpid(8.0, **options).on(TWO, step=2e-3)
    assert fp.to_toml(fp.paper_experiment(), law) == fp.to_toml(fp.paper_experiment(), same)
    asked = [getattr(law, name) for name in list(options)[1:]]
    assert asked == list(options.values())[1:]


def test_they_are_found_once_for_an_arm_and_a_step_whatever_a_run_s_or_a_search_s_length(
    monkeypatch,
):
    asked, found, explained = fp.SuggestedFpid(8.0), [], fp.SuggestedFpid.explained
    monkeypatch.setattr(
        fp.SuggestedFpid, "explained", lambda *given: found.append(given) or explained(*given)
    )
    short, long = (fp.paper_experiment(duration=d, step=5e-3) for d in (0.01, 20.5))
    runs = fp.simulate([short, long], asked)
    base = Problem(short, asked, fp.tuning.Space(kp=(1.0, 2.0)), None).space.base
    assert len(found) == 1
    law = suggest_gains(TWO, 8.0, step=5e-3, name=asked.name)
    assert fp.to_toml(short, base) == fp.to_toml(short, law)
    for run in runs:
        assert run.kp[0] == pytest.approx(np.broadcast_to(law.kp, 2))


def test_only_what_there_is_to_warn_of_is_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        suggest_gains(TWO)
    weak = TWO.with_limits(effort=(5.0, 100.0))
    rough = TWO.with_friction(dry=(0.0, 30.0)).with_limits(effort=(100.0, 30.0))
    for arm, words in (
        (weak, r"joint1: gravity at home is 27.4 N m, beyond its effort limit of 5 N m; it cannot"),
        (rough, "joint2: dry friction of 30 N m is not below its effort limit of 30 N m; it cann"),
    ):
        with pytest.warns(fp.FpidWarning, match=words):
            suggest_gains(arm, adaptive=False)


def test_the_ceiling_of_ki_is_that_of_the_least_kp_and_kd_that_projection_allows():
    """By Routh it is in proportion to both, where nothing but Kd damps: (1/2)(1/3)."""
    free = fp.AdaptiveFpid(90.0, 5.0, 6.0, learning_rate=1.0)
    least = [np.full(2, x) for x in (45.0, 0.0, 2.0)]
    bound = dataclasses.replace(free, safeguards=Safeguards(minimum=np.stack(least)))
    ratio = gain_ceilings(TWO, bound).ki / gain_ceilings(TWO, free).ki
    assert ratio == pytest.approx(1.0 / 6.0, rel=1e-12)


def test_where_all_of_the_box_is_damped_gains_may_go_from_seven_tenths_to_four_times():
    found = explain_gains(TWO)
    assert not any("projection" in note for note in found.notes)
    law = found.controller
    start = np.stack([law.kp, law.ki, law.kd])
    low, high = Safeguards.bounds_of(law.safeguards, 2)
    ceilings = gain_ceilings(TWO, dataclasses.replace(law, safeguards=Safeguards(minimum=low)))
    most = np.minimum(4.0 * start, np.stack([ceilings.kp, ceilings.ki, ceilings.kd]))
    assert low == pytest.approx(0.7 * start, rel=1e-12)
    assert high == pytest.approx(np.maximum(most, start), rel=1e-9)


def test_a_part_of_the_box_ends_at_its_square_below(kinova):
    arm, found = kinova
    law, share = found.controller, re.search(r"goes (\d+) % of the way", str(found))
    start = np.stack([law.kp, law.ki, law.kd])
    low, high = Safeguards.bounds_of(law.safeguards, arm.n)
    part = np.log((high / start).max()) / np.log(4.0)
    assert 0.0 < part < 1.0
    assert part == pytest.approx(float(share[1]) / 100.0, abs=0.005)
    assert low == pytest.approx(start * 0.7**part**2, rel=1e-9)
