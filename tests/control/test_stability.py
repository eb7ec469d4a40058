"""Margins against closed forms, python-control and simulations that are made to break."""

import dataclasses

import control
import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import GravityOnly, PdGravity, Pid, SlidingMode, SlotineLi
from fpid_pin.control.gains import suggest_gains
from fpid_pin.control.sampled import crossings, frequencies, gravity_stiffness, operators
from fpid_pin.control.stability import stability_report
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import ExponentialSum, GrunwaldLetnikov
from fpid_pin.references import Hold

ONE = fp.Arm.planar([1.0], [1.0], gravity=0.0)  # a unit inertia
LAW = fp.AdaptiveFpid(kp=60.0, ki=80.0, kd=18.0, integral_order=0.8, derivative_order=0.9)


def test_operators_respond_as_powers_of_s():
    # Well below Nyquist's frequency, and above that of the horizon.
    omega = np.geomspace(0.3, 50.0, 30)
    z = np.exp(1j * omega * 1e-3)
    found = operators((0.7, 0.6), ExponentialSum(modes=24), step=1e-3, horizon=60.0).response(z)
    s = 1j * omega
    # The rate is the signal's own: e' = s e.
    responses = found[:, :, 0] + s[:, np.newaxis] * found[:, :, 1]
    assert responses[:, 1] == pytest.approx(s**-0.7, rel=3e-3)
    assert responses[:, 2] == pytest.approx(s**0.6, rel=3e-3)


def test_modes_are_solved_as_any_states_are():
    found = operators((0.7, 0.6), ExponentialSum(modes=24), step=1e-3, horizon=60.0)
    z = np.exp(1j * np.array([1e-3, 0.1, 2.0, np.pi]))
    dense = dataclasses.replace(found, core=None).response(z)
    assert found.response(z) == pytest.approx(dense, rel=1e-9)


def test_gravity_stiffness_is_that_of_the_two_link_arm():
    arm = fp.Arm.two_link()
    q = np.array([0.4, -0.7])
    both = -9.8 * 0.8 * np.sin(q.sum())
    truth = [[-9.8 * 2.0 * np.sin(q[0]) + both, both], [both, both]]
    assert gravity_stiffness(arm, q) == pytest.approx(np.array(truth), abs=1e-6)


@pytest.mark.parametrize("method", ["zero_order_hold", "semi_implicit_euler"])
def test_margins_of_pd_on_a_unit_inertia_are_the_closed_forms(method):
    kp, kd, step = 100.0, 14.0, 2e-4
    report = stability_report(ONE, Pid(kp, 0.0, kd), step=step, method=method)
    # |kd s + kp| = |s^2|, with the half step that holding the torque costs.
    crossover = np.sqrt((kd**2 + np.sqrt(kd**4 + 4.0 * kp**2)) / 2.0)
    phase = np.arctan2(kd * crossover, kp) - crossover * step / 2.0
    assert report.crossover[0] == pytest.approx(crossover, rel=1e-3)
    assert report.phase_margin[0] == pytest.approx(phase, abs=2e-3)
    assert report.delay_margin[0] == pytest.approx(phase / crossover, rel=5e-3)
    # s^2 + kd s + kp, and z is the step's exponential of s.
    pole = -kd / 2.0 + 1j * np.sqrt(kp - kd**2 / 4.0)
    assert report.dominant_pole == pytest.approx(pole, rel=5e-3)
    assert report.pole_radius == pytest.approx(np.exp(pole.real * step), rel=1e-5)


def test_the_gain_margin_of_a_rate_loop_is_two_over_the_step():
    report = stability_report(ONE, Pid(0.0, 0.0, 50.0), step=1e-3)
    assert report.gain_margin[0] == pytest.approx(2000.0 / 50.0, rel=1e-6)
    assert not report.stable  # nothing holds the angle


def test_terms_without_a_gain_have_no_poles():
    arm = fp.Arm.two_link()
    law = fp.AdaptiveFpid(100.0, 0.0, 20.0, integral_order=0.9, derivative_order=0.8)
    report = stability_report(arm, Pid(100.0, 0.0, 20.0))
    assert report.stable
    assert str(report).startswith("stable at home")
    assert stability_report(arm, law).stable
    # The integral counts as soon as it has a gain, however small.
    slow = stability_report(arm, Pid(100.0, 1e-3, 20.0))
    assert report.pole_radius < 1.0 - 1e-3 < slow.pole_radius < 1.0


def test_the_dominant_pole_is_that_of_the_motion_and_not_of_the_horizon():
    arm = fp.Arm.two_link()
    law = fp.AdaptiveFpid(
        kp=400.0, ki=900.0, kd=90.0, integral_order=0.9, derivative_order=0.9, learning_rate=0.0
    )
    found = [stability_report(arm, law, horizon=T).dominant_pole for T in (20.0, 3600.0)]
    assert found[0] == pytest.approx(found[1], rel=0.02)
    assert found[0].real < -1.0 < -1.0 / 20.0


@pytest.mark.parametrize(
    ("kp", "ki", "kd", "pole"),
    # (s + 1)(s^2 + 6 s + 25); then an integral so slow that a push leaves 1/1000 of it.
    [(31.0, 25.0, 7.0, -1.0), (25.0, 0.25, 6.0, -3.0 + 4.0j)],
)
def test_the_dominant_pole_has_a_tenth_of_what_a_push_leaves(kp, ki, kd, pole):
    report = stability_report(ONE, Pid(kp, ki, kd), step=1e-4)
    assert report.dominant_pole == pytest.approx(pole, rel=3e-3)


@pytest.mark.parametrize("name", ["two_link", "ur5"])
def test_joints_bear_less_together_than_alone(name):
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    law = fp.AdaptiveFpid(
        kp=100.0, ki=250.0, kd=22.0, integral_order=0.9, derivative_order=0.95,
        learning_rate=0.0, scale="inertia",
    )  # fmt: skip
    report = stability_report(arm, law)
    assert report.common_delay_margin < report.delay_margin.min()
    assert report.common_gain_margin < report.gain_margin.min()
    assert report.common_gain_reduction > report.gain_reduction.max()
    still = arm.with_limits(effort=0.0).with_gravity(0.0)
    report = stability_report(still, law)
    samples = int(report.common_delay_margin / 1e-3)
    ends = [shaken(still, law, sensors=fp.Sensors(delay=k)) for k in (samples, samples + 1)]
    assert ends[0] < 1.0 < ends[1]
    factor = report.common_gain_margin
    for by in (0.97, 1.03):
        more = tuple(factor * by * np.full(arm.n, k) for k in (100.0, 250.0, 22.0))
        assert stability_report(still, law, gains=more).stable == (by < 1.0)


def shaken(arm, law, **others):
    experiment = fp.Experiment(
        arm=arm, reference=Hold(arm.home), q0=arm.home, v0=np.full(arm.n, 1e-6),
        duration=3.0, **others,
    )  # fmt: skip
    run = fp.simulate(experiment, law)
    if not run.outcome.completed:
        return np.inf
    return np.abs(run.v[-500:]).max() / np.abs(run.v[:500]).max()


def test_the_loop_breaks_at_its_gain_margin():
    law = dataclasses.replace(LAW, learning_rate=0.0)
    for kind in ("gain_margin", "gain_reduction"):
        factor = float(getattr(stability_report(ONE, law), kind)[0])
        assert factor > 1.0 if kind == "gain_margin" else 0.0 < factor < 1.0
        inside, outside = (0.97, 1.03) if kind == "gain_margin" else (1.15, 0.85)

        def scaled(by, factor=factor):
            gains = {k: float(getattr(law, k)) * factor * by for k in ("kp", "ki", "kd")}
            return dataclasses.replace(law, **gains)

        assert stability_report(ONE, scaled(inside)).stable
        assert not stability_report(ONE, scaled(outside)).stable
        assert shaken(ONE, scaled(inside)) < 1.0 < shaken(ONE, scaled(outside))


def test_the_loop_breaks_at_its_delay_margin():
    law = dataclasses.replace(LAW, learning_rate=0.0)
    margin = stability_report(ONE, law).delay_margin[0] / 1e-3
    inside = shaken(ONE, law, sensors=fp.Sensors(delay=int(0.9 * margin)))
    outside = shaken(ONE, law, sensors=fp.Sensors(delay=int(1.1 * margin) + 1))
    assert inside < 1.0 < outside


def test_python_control_finds_the_same_margins():
    """A PID on a pendulum at rest, its loop written down in z: the arm moves by v+, then q+."""
    arm, h = fp.Arm.planar([1.0], [1.0], gravity=0.0), 1e-3
    kp, ki, kd = 60.0, 80.0, 15.0
    report = stability_report(arm, fp.Pid(kp, ki, kd), step=h)
    omega = np.geomspace(1e-2, np.pi / h, 20_000)
    z = np.exp(1j * omega * h)
    rate = h / (z - 1.0)
    angle = h * z / (z - 1.0) * rate
    # int e += h/2 (e + e_) + h^2/12 (e'_ - e')
    total = (h / 2 * (1.0 + 1.0 / z) * angle + h**2 / 12 * (1.0 / z - 1.0) * rate) / (1.0 - 1.0 / z)
    loop = kp * angle + ki * total + kd * rate
    data = (np.abs(loop), np.degrees(np.unwrap(np.angle(loop))), omega)
    _, phase, _, _, at, _ = control.stability_margins(data)
    assert np.degrees(report.phase_margin) == pytest.approx([phase], rel=1e-3)
    assert report.crossover == pytest.approx([at], rel=1e-3)
    assert report.delay_margin == pytest.approx([np.radians(phase) / at], rel=1e-3)


def test_crossings_are_interpolated():
    omega = frequencies(1e-3)
    at, value = crossings(omega, 100.0 / (1j * omega), lambda x: np.log(np.abs(x)))
    assert at == pytest.approx([100.0], rel=1e-4)
    assert np.abs(value) == pytest.approx([1.0], rel=1e-3)


@pytest.mark.parametrize(
    "law",
    [
        suggest_gains(fp.Arm.two_link()),
        PdGravity(kp=100.0, kd=20.0, scale="inertia"),
        fp.ComputedTorque(k0=100.0, k1=20.0),
        SlidingMode(slope=10.0, gain=50.0, boundary_layer=1.0, scale="inertia"),
        SlotineLi(slope=10.0, damping=10.0, scale="inertia"),
    ],
    ids=lambda law: type(law).__name__,
)
def test_laws_that_work_are_stable_and_have_room(law):
    report = stability_report(fp.Arm.two_link(), law)
    assert report.stable
    assert report.dominant_pole.real < 0.0
    assert (report.gain_margin > 2.0).all()
    assert (report.phase_margin > np.radians(30.0)).all()
    assert (report.delay_margin > 5e-3).all()
    assert "joint1" in str(report)


def test_no_control_is_no_stability():
    report = stability_report(fp.Arm.two_link(), GravityOnly())
    assert not report.stable
    assert np.isinf(report.phase_margin).all()


def test_adapted_gains_can_be_asked_about():
    arm = fp.Arm.two_link()
    law = suggest_gains(arm)
    one = stability_report(arm, law)
    same = stability_report(arm, law, gains=(law.kp, law.ki, law.kd))
    more = stability_report(arm, law, gains=(law.kp, law.ki, 4.0 * np.asarray(law.kd)))
    assert same.gain_margin == pytest.approx(one.gain_margin)
    assert (more.gain_margin < one.gain_margin).all()
    assert (one.kd_ceiling == 0.5 * one.kd_limit).all()


def test_what_cannot_be_linearised_is_refused():
    with pytest.raises(ArgumentError, match="smooth about home, got a jump in SlidingMode"):
        stability_report(ONE, SlidingMode(slope=10.0, gain=5.0, boundary_layer=0.0))
    law = dataclasses.replace(LAW, design=GrunwaldLetnikov())
    with pytest.raises(ArgumentError, match="design: expected one with modes, got GrunwaldLetn"):
        stability_report(ONE, law)
    with pytest.raises(ArgumentError, match="did you mean zero_order_hold"):
        stability_report(ONE, LAW, method="zero_order_hol")
    with pytest.raises(ArgumentError, match=r"gains\.0: expected shape \(1,\)"):
        stability_report(ONE, LAW, gains=(np.ones(2), 1.0, 1.0))
