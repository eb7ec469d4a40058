"""A law on hardware: order of joints, ticks that come late or never, rates of angles, records."""

import numpy as np
import pinocchio as pin
import pytest

import fpid_pin as fp
from fpid_pin.control import EncoderRate, RobotLoop
from fpid_pin.exceptions import ArgumentError

ARM = fp.Arm.two_link()
STEP = 1e-3
ONE, TWO = ARM.joint_names


def started(**changes):
    return fp.paper_controller(**changes).start(ARM, step=STEP, horizon=2.0)


def straight(k):
    """Return q, v, q_ref, v_ref, a_ref at tick k; all of them straight lines in time."""
    lines = np.array([
        [[0.1, 0.2], [0.5, -0.2]], [[0.3, 0.1], [-0.2, 0.1]], [[0.15, 0.3], [0.4, -0.3]],
        [[0.2, -0.1], [0.1, 0.3]], [[0.1, 0.3], [0.0, -0.3]],
    ])  # fmt: skip
    return list(lines @ [1.0, k * STEP])


def call(robot, k, **more):
    q, v, *reference = straight(k)
    return robot.torque(q, *reference, v=v, **more)


@pytest.mark.parametrize("names", [(TWO, ONE), ("finger", TWO, ONE, "thumb")])
def test_a_robot_s_order_and_its_other_joints(names):
    loop, robot = started(), RobotLoop(started(), joint_names=names)
    by_name = RobotLoop(started(), joint_names=names)
    place = [names.index(ONE), names.index(TWO)]

    def robots(values):
        out = np.full(len(names), 9.0)
        out[place] = values
        return out

    for k in range(20):
        expected = loop.torque(*straight(k))
        q, v, *reference = straight(k)
        found = robot.torque(robots(q), *map(robots, reference), v=robots(v))
        assert (found[place] == expected).all()
        assert (np.delete(found, place) == 0.0).all()
        tables = [dict(zip(names, robots(values), strict=True)) for values in straight(k)]
        told = by_name.torque(tables[0], *tables[2:], v=tables[1])
        assert told == dict(zip(names, found.tolist(), strict=True))


def test_missed_ticks_are_made_up_along_straight_lines():
    """Of signals that are straight lines the law then knows as much as if none had been missed."""
    whole, robot = started(), RobotLoop(started())
    whole_record, record = whole.record(), robot.record()
    for k in range(60):
        expected = whole.torque(*straight(k))
        if k not in (3, 10, 11, 12, 40):
            found = call(robot, k, now=7.0 + k * STEP)
            assert found == pytest.approx(expected, rel=1e-9)
    assert robot.ticks.missed == 5
    assert robot.ticks.on_time == 55
    for name, array in whole_record.signals().items():
        assert record.signals()[name] == pytest.approx(array, rel=1e-9, abs=1e-12), name
    torque = record.arrays()["torque"]
    assert len(torque) == 60
    assert (torque[10:13] == torque[9]).all()  # what the drives held meanwhile


def test_calls_near_their_tick_are_that_tick_and_counted():
    loop, robot = started(), RobotLoop(started())
    off = [0.0, 0.3, -0.3, 0.45, 0.0, 0.05]
    for k, part in enumerate(off):
        expected = loop.torque(*straight(k))
        assert (call(robot, k, now=(k + part) * STEP) == expected).all()
    assert (robot.ticks.late, robot.ticks.on_time, robot.ticks.missed) == (3, 3, 0)
    assert robot.ticks.latest == pytest.approx(0.45 * STEP)


def test_a_second_call_for_a_tick_changes_nothing():
    loop, robot = started(), RobotLoop(started())
    for k in range(5):
        expected = loop.torque(*straight(k))
        assert (call(robot, k, now=k * STEP) == expected).all()
        assert (call(robot, 50, now=(k + 0.2) * STEP) == expected).all()
    assert robot.ticks.early == 5


def test_more_missed_than_are_made_up_is_for_the_caller():
    robot = RobotLoop(started(), most_missed=3)
    first = call(robot, 0, now=0.0)
    with pytest.raises(ArgumentError, match=r"now: expected at most 3 ticks missed, got 4 \(reset"):
        call(robot, 5, now=5 * STEP)
    with pytest.raises(ArgumentError, match="now: expected a time that does not go back"):
        call(robot, 0, now=-STEP)
    robot.reset()
    assert (call(robot, 0, now=9.0) == first).all()
    assert robot.ticks.missed == 0


def test_a_soft_start_goes_from_what_was_held_to_the_law_s_torque():
    loop, hold = started(), np.array([2.0, -1.0])
    robot = RobotLoop(started(), soft_start=10 * STEP, hold=hold)
    for k in range(15):
        law, found = loop.torque(*straight(k)), call(robot, k)
        part = min(k / 10, 1.0)
        assert found == pytest.approx(hold + part * (law - hold), rel=1e-12)
    assert (found == law).all()


def test_rates_come_from_angles_where_the_robot_has_none():
    loop, robot = started(), RobotLoop(started(), rate=EncoderRate(0.0))
    previous = None
    for k in range(10):
        q, _, *reference = straight(k)
        v = np.zeros(2) if previous is None else (q - previous) / STEP
        assert robot.torque(q, *reference) == pytest.approx(loop.torque(q, v, *reference), rel=1e-9)
        previous = q
    with pytest.raises(ArgumentError, match=r"v: expected rates, or RobotLoop\(rate="):
        RobotLoop(started()).torque(q, *reference)


def turning(k):
    """Return q, q_ref, v, v_ref at tick k: some turns forward and back, the reference ahead."""
    t, amplitude = k * STEP, np.array([8 * np.pi, -6 * np.pi])
    q = amplitude * np.sin(2 * np.pi * t) + [0.1, 6.2]
    ahead = 5.0 * np.sin(7.0 * t) + 0.2  # at times by more than half a turn
    v = 2 * np.pi * amplitude * np.cos(2 * np.pi * t)
    return q, q + ahead, v, v + 35.0 * np.cos(7.0 * t)


@pytest.mark.parametrize("missed", [(*range(80, 90), 250, 400, 401, 700)])
@pytest.mark.parametrize("wrapped_reference", [False, True])
@pytest.mark.parametrize("measured_rates", [False, True])
def test_an_encoder_that_begins_again_changes_no_torque(missed, wrapped_reference, measured_rates):
    """Torques and records are those of an encoder that counts all turns."""
    plain = RobotLoop(started(), rate=EncoderRate(0.002))
    robot = RobotLoop(started(), rate=EncoderRate(0.002, turn=2 * np.pi))
    record, plain_record = robot.record(), plain.record()
    lowest = np.array([0.0, -np.pi])  # of each encoder

    def wrapped(angle):
        return (angle - lowest) % (2 * np.pi) + lowest

    for k in range(1000):
        if k in missed:
            continue
        q, q_ref, v, v_ref = turning(k)
        more = {"now": k * STEP, "v": v if measured_rates else None}
        expected = plain.torque(q, q_ref, v_ref, **more)
        shown = wrapped(q_ref) if wrapped_reference else q_ref
        found = robot.torque(wrapped(q), shown, v_ref, **more)
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-8)
    assert robot.ticks.missed == len(missed)
    rows, expected = record.arrays(), plain_record.arrays()
    for name in ("q", "q_ref"):  # the same turn all along, the one of the first reference
        off = (expected[name] - rows[name]) / (2 * np.pi)
        assert off == pytest.approx(np.broadcast_to(np.round(off[0]), off.shape), abs=1e-9)
    assert rows["v"] == pytest.approx(expected["v"], abs=1e-8)
    assert np.ptp(rows["q"], axis=0).min() > 11 * np.pi


def test_one_turn_is_for_revolute_joints_alone():
    model = pin.Model()
    for name, joint in (("turn", pin.JointModelRY()), ("slide", pin.JointModelPX())):
        place = model.addJoint(model.njoints - 1, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(place, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    slide = fp.Arm.from_model(model)
    for turn, expected in ((2 * np.pi, [2 * np.pi, 0.0]), ([np.inf, 0.5], [0.0, 10.0])):
        law = fp.PdGravity(kp=1.0, kd=1.0).start(slide, step=STEP)
        robot = RobotLoop(law, rate=EncoderRate(turn=turn))
        record = robot.record()
        robot.torque([0.0, 0.0], [6.3, 10.1], [0.0, 0.0])
        assert record.arrays()["q"][0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (np.array([np.nan, 0.0]), "q: expected finite numbers"),
        (np.zeros(3), r"q: expected shape \(2,\) \(the robot's joints\), got shape \(3,\)"),
        ({ONE: 1.0}, f"q: expected a number for {TWO}, got '{ONE}'"),
        ("x", "q: expected numbers"),
    ],
)
def test_after_bad_input_the_law_is_as_before(bad, message):
    robot = RobotLoop(started(), rate=EncoderRate())
    other = RobotLoop(started(), rate=EncoderRate())
    for k in range(5):
        q, _, *reference = straight(k)
        with pytest.raises(ArgumentError, match=message):
            robot.torque(bad, *reference, now=k * STEP)
        expected = other.torque(q, *reference, now=k * STEP)
        assert (robot.torque(q, *reference, now=k * STEP) == expected).all()


# ---------------------------------------------------------------------- the loop itself


@pytest.mark.parametrize("rows", [7, 10_000])
def test_a_recorded_loop_is_the_run_that_the_engine_makes(rows):
    """Fed with what the engine measured, it gives and keeps what the engine did."""
    experiment = fp.paper_experiment(duration=0.3)
    run = fp.simulate(experiment, fp.paper_controller())
    loop = fp.paper_controller().start(ARM, step=STEP, horizon=20.0)
    record = loop.record(rows)
    reference = experiment.motion(run.t)
    for k in range(len(run.t)):
        tau = loop.torque(run.q[k], run.v[k], *(part[k] for part in reference))
        assert (tau == run.torque[k]).all()
    back = fp.Run.from_record(record)
    assert len(record) == len(run.t)
    for name in ("t", "q", "v", "q_ref", "v_ref", "torque", *run.signals):
        assert getattr(back, name) == pytest.approx(getattr(run, name), rel=1e-15, abs=0.0), name
    for name in fp.costs.METRICS:
        assert getattr(back.metrics, name) == pytest.approx(getattr(run.metrics, name)), name
    assert back.controller.start(ARM, step=STEP).torque(*straight(0)).shape == (2,)
    assert repr(record) == "<Record of 301 rows, 0.001 s apart>"


def test_a_loop_refuses_bad_measurements_and_is_not_moved_by_them():
    loops = [fp.paper_controller().start(fp.Arm.two_link(), step=1e-3) for _ in range(2)]
    good = np.array([[0.1, 0.2], [0.0, 0.1], [0.3, 0.3], [0.1, 0.0]])
    with pytest.raises(ArgumentError, match=r"v: expected shape \(2,\)"):
        loops[0].torque(good[0], [0.0], good[2], good[3])
    with pytest.raises(ArgumentError, match=r"q.1: .* got nan"):
        loops[0].torque([0.0, np.nan], good[1], good[2], good[3])
    first, second = (loop.torque(*good) for loop in loops)
    assert (first == second).all()


def test_a_loop_that_outlives_its_horizon_says_so_once():
    loop = fp.paper_controller().start(fp.Arm.two_link(), step=1e-3, horizon=0.05)
    inputs = np.zeros((4, 2))
    for _ in range(51):
        loop.torque(*inputs)
    with pytest.warns(fp.FpidWarning, match=r"past its horizon of 0.05 s"):
        loop.torque(*inputs)
    for _ in range(100):
        loop.torque(*inputs)


@pytest.mark.parametrize("tau", [0.0, 0.002, 0.02])
def test_it_is_late_by_its_delay(tau):
    """Of q = t^2/2 the rate is t, and the filter's t - delay once its start has died away."""
    rate = EncoderRate(tau).start(STEP)
    t = STEP * np.arange(2000)
    for now in t:
        found = rate.rate(np.array([0.5 * now**2, -0.5 * now**2]))
    late = t[-1] - found[0]
    assert late == pytest.approx(EncoderRate(tau).delay(STEP), rel=1e-9)
    assert found[1] == pytest.approx(-found[0])


@pytest.mark.parametrize("tau", [0.0, 0.005])
def test_its_noise_is_that_of_rounded_angles(tau):
    resolution, filter_ = 2 * np.pi / 4096, EncoderRate(tau)
    joints = 500  # moving by some thirty steps of the encoder a tick, none of them alike
    speeds = np.linspace(40.0, 60.0, joints) * resolution / (2 * STEP)
    rate, found = filter_.start(STEP), []
    for k in range(400):
        angle = speeds * k * STEP + np.linspace(0.0, 1.0, joints)
        found.append(rate.rate(resolution * np.round(angle / resolution)) - speeds)
    spread = np.std(found[100:])
    assert spread == pytest.approx(filter_.noise(resolution, STEP), rel=0.05)


def test_a_steady_motion_is_the_same_through_ticks_that_were_missed():
    rate, through = EncoderRate(0.004).start(STEP), EncoderRate(0.004).start(STEP)
    q = 0.3 * STEP * np.arange(20.0)
    for value in q:
        every = rate.rate(np.array([value]))
    for k in (0, 1, 5, 6, 19):
        some = through.rate(q[k : k + 1], {0: 1, 1: 1, 5: 4, 6: 1, 19: 13}[k])
    assert some == pytest.approx(every, rel=1e-12)


def test_it_starts_at_rest_and_again_after_a_reset():
    rate = EncoderRate().start(STEP)
    assert (rate.rate(np.array([3.0])) == 0.0).all()
    assert rate.rate(np.array([3.1])) > 0.0
    rate.reset()
    assert (rate.rate(np.array([9.0])) == 0.0).all()
