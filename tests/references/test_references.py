"""Trajectories: rates are derivatives, points are passed on time, files are checked."""

import pickle
import types

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import (
    Hold,
    Quintic,
    RecordedMotion,
    Reference,
    Sinusoid,
    ToolCircle,
    Waypoints,
)

TIMES = (0.0, 1.0, 1.5, 3.0)
POSES = ((0.0, 0.1), (0.5, -0.2), (0.4, 0.3), (1.0, 0.0))


def circle(**others):
    arguments = {"radius": 0.2, "period": 4.0, "centre": (1.0, 0.0, 0.5), "ramp": 1.0}
    return ToolCircle(fp.Arm.two_link(), **(arguments | others))


def recorded():
    t = np.linspace(0.0, 3.0, 61)
    return RecordedMotion(t, np.stack([np.sin(t), 0.3 * np.cos(2.0 * t)], axis=1))


REFERENCES = {
    "sinusoid": Sinusoid((0.3, 0.2), (1.0, 2.0), (0.0, 0.5), (0.1, -0.1)),
    "hold": Hold((0.2, 0.4)),
    "quintic": Quintic((0.0, 0.5), (1.0, -0.5), duration=2.0, begin=0.5),
    "waypoints": Waypoints(TIMES, POSES),
    "waypoints, quintic": Waypoints(TIMES, POSES, method="quintic"),
    "recorded": recorded(),
    "tool_circle": circle(),
}
each = pytest.mark.parametrize("reference", REFERENCES.values(), ids=REFERENCES)


@each
def test_rates_and_accelerations_are_the_derivatives(reference):
    knots = np.array([0.0, 0.5, 1.0, 1.5, 2.5, 3.0])
    t = np.linspace(-0.3, 4.3, 400)
    t = t[np.abs(t[:, np.newaxis] - knots).min(axis=1) > 1e-3]
    width = 1e-5
    q, v, a = reference.sample(t)
    (ahead, faster, _), (behind, slower, _) = (
        reference.sample(t + side) for side in (width, -width)
    )
    assert q.shape[0] == len(t)
    assert v == pytest.approx((ahead - behind) / (2.0 * width), abs=1e-5)
    assert a == pytest.approx((faster - slower) / (2.0 * width), abs=1e-4)


@each
def test_tables_and_pickles_give_the_same_motion(reference):
    t = np.linspace(0.0, 4.0, 50)
    copies = (
        descriptions.from_dict(descriptions.to_dict(reference), Reference),
        pickle.loads(pickle.dumps(reference)),
    )
    for copy in copies:
        for one, other in zip(copy.sample(t), reference.sample(t), strict=True):
            assert (one == other).all()


def test_a_quintic_rests_at_its_ends_and_peaks_at_fifteen_eighths():
    move = Quintic(0.2, 1.0, duration=2.0, begin=1.0)
    q, v, a = move.sample(np.array([0.0, 1.0, 2.0, 3.0, 9.0]))
    assert q[:, 0] == pytest.approx([0.2, 0.2, 0.6, 1.0, 1.0])
    assert v[:, 0] == pytest.approx([0.0, 0.0, 15.0 / 8.0 * 0.8 / 2.0, 0.0, 0.0])
    assert a[:, 0] == pytest.approx(np.zeros(5), abs=1e-12)


@pytest.mark.parametrize("method", ["cubic", "quintic"])
def test_waypoints_are_passed_on_time_and_held_beyond(method):
    path = Waypoints(TIMES, POSES, method=method)
    q, v, a = path.sample(np.array([-1.0, *TIMES, 10.0]))
    assert q == pytest.approx(np.array([POSES[0], *POSES, POSES[-1]]), abs=1e-12)
    assert v[[0, 1, -2, -1]] == pytest.approx(np.zeros((4, 2)), abs=1e-12)
    assert (a[[0, -1]] == 0.0).all()
    if method == "quintic":
        assert a[[1, -2]] == pytest.approx(np.zeros((2, 2)), abs=1e-10)


def test_a_quintic_spline_between_two_points_is_the_quintic():
    t = np.linspace(0.0, 2.0, 30)
    spline = Waypoints((0.0, 2.0), ((0.1,), (0.9,)), method="quintic")
    move = Quintic(0.1, 0.9, duration=2.0)
    for one, other in zip(spline.sample(t), move.sample(t), strict=True):
        assert one == pytest.approx(other, abs=1e-10)


def test_a_recording_is_read_from_csv_with_or_without_names(tmp_path):
    lines = ["0.0, 0.1, 0.2", "0.1, 0.15, 0.1", "0.2, 0.3, 0.0", "0.3, 0.2, 0.1"]
    for head in ([], ["t, shoulder, elbow"]):
        path = tmp_path / "motion.csv"
        path.write_text("\n".join([*head, *lines, ""]))
        motion = RecordedMotion(path=str(path))
        q, _, _ = motion.sample(np.array([0.2, 0.3]))
        assert q == pytest.approx(np.array([[0.3, 0.0], [0.2, 0.1]]))
        table = {"kind": "recorded", "path": str(path)}
        same = descriptions.from_dict(table, Reference)
        assert (np.asarray(same.positions) == np.asarray(motion.positions)).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,1\n0.1,\n0.2,3\n", "expected a number in line 2, column 2, got an empty cell"),
        ("0,1,2\n0.1,1\n", "expected 3 cells in line 2, got 2"),
        ("0,1\n1,1\n2,1\n3,1\n50,1\n", "a gap of 47 s after t = 3 s"),
        ("0\n1\n", r"expected rows of t, q_1, ..., q_n, got an array of shape \(2, 1\)"),
    ],
)
def test_a_csv_with_gaps_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / "motion.csv"
    path.write_text(text)
    with pytest.raises(ArgumentError, match=message):
        RecordedMotion(path=str(path))


@pytest.mark.parametrize("orientation", [False, True])
def test_the_tool_follows_its_circle(orientation):
    arm = fp.Arm.from_example("kinova")
    path = ToolCircle(arm, radius=0.08, period=5.0, orientation=orientation)
    q, _, _ = path.sample(np.linspace(0.0, 7.0, 71))
    poses = np.array([arm.tool_pose(x) for x in q])
    home = arm.tool_pose(arm.home)
    assert poses[0] == pytest.approx(home, abs=1e-8)
    places = poses[:, :3, 3]
    assert places[:, 1] == pytest.approx(np.full(71, home[1, 3]), abs=1e-7)
    centre = places[:50].mean(axis=0)
    assert np.linalg.norm(places - centre, axis=1) == pytest.approx(np.full(71, 0.08), abs=1e-7)
    if orientation:
        assert np.abs(poses[:, :3, :3] - home[:3, :3]).max() < 1e-6
    assert q[50] == pytest.approx(q[0], abs=1e-7)


def test_a_circle_with_a_ramp_starts_at_rest_and_loses_half_of_it():
    smooth, plain = circle(ramp=1.0), circle(ramp=0.0)
    _, v, a = smooth.sample(np.zeros(1))
    assert (v == 0.0).all()
    assert a == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    t = np.linspace(1.0, 6.0, 20)
    for one, other in zip(smooth.sample(t), plain.sample(t - 0.5), strict=True):
        assert one == pytest.approx(other, abs=1e-9)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: circle(radius=5.0), r"a circle within reach of the tool, got \(.*which it misses"),
        (lambda: circle(normal=(0.0, 0.0, 0.0)), "reference.normal: expected a direction"),
        (
            lambda: ToolCircle(fp.Arm.from_example("z1"), radius=0.05, period=5.0),
            r"expected joint joint2 within \[0, 2.97\] rad",
        ),
        (lambda: Quintic((0.0, 1.0), (0.0, 1.0, 2.0), 1.0), "one length"),
        (
            lambda: Waypoints((0.0, 1.0, 1.0), ((0.0,), (1.0,), (2.0,))),
            r"reference.times.2: expected a time after the one before \(1 s\), got 1 s",
        ),
        (
            lambda: Waypoints((0.0, 1.0), ((0.0, 1.0), (1.0,))),
            "reference.positions.1: expected 2 angles, as in the first row, got 1",
        ),
        (
            lambda: RecordedMotion(path="no-such-file.csv"),
            "no-such-file.csv: expected a CSV file",
        ),
    ],
)
def test_bad_references_are_named(build, message):
    with pytest.raises(ArgumentError, match=message):
        build()


@pytest.mark.parametrize(
    ("sampled", "line"),
    [
        (lambda t: None, r"reference: expected three arrays \(.*\), got None$"),
        (lambda t: (np.zeros((len(t), 2)),) * 2, "reference: expected three arrays .*, got 2$"),
        (lambda t: ("a", "b", "c"), r"reference q: expected shape \(1, 2\) .*, got 'a'$"),
        (lambda t: (1j * np.zeros((len(t), 2)),) * 3, r"reference q: .* got array\(\[\["),
        (lambda t: ([[0.0], [0.0, 1.0]],) * 3, r"reference q: .* got \[\[0.0\], \[0.0, 1.0\]\]$"),
    ],
)
def test_what_a_reference_of_one_s_own_returns_is_checked(sampled, line):
    with pytest.raises(ArgumentError, match=f"^{line}"):
        fp.Experiment(fp.Arm.two_link(), types.SimpleNamespace(sample=sampled))


def test_a_disturbance_with_one_row_for_all_times_is_refused():
    late = types.SimpleNamespace(sample=lambda t: np.zeros((1, 2)))
    plant = fp.Plant(disturbance=late)
    experiment = fp.Experiment(fp.Arm.two_link(), Hold(), plant=plant, duration=0.01)
    with pytest.raises(ArgumentError, match=r"^plant.disturbance: expected shape \(11, 2\)"):
        fp.simulate(experiment, fp.GravityOnly())


def test_a_reference_for_another_arm_is_refused():
    with pytest.raises(ArgumentError, match=r"reference q: expected shape"):
        fp.Experiment(arm=fp.Arm.from_example("ur5"), reference=Waypoints(TIMES, POSES))
