"""The linear loop: a law answers small signals as its Loop does, tick by tick; margins are closed
forms, and simulations die away, or break, where the report says."""

import dataclasses
from dataclasses import dataclass

import every_law
import numpy as np
import pytest
from own_laws import own

import fpid_pin as fp
from fpid_pin.control import GravityOnly, PdGravity, Pid, SlidingMode, SlotineLi
from fpid_pin.control.linear import linear_arm, linearised
from fpid_pin.control.stability import stability_report
from fpid_pin.references import Hold

STEP, HORIZON = 1e-3, 5.0


@dataclass(frozen=True, eq=False)
class RobotAdaptive(fp.Controller):
    """Arrays of its own: a sum of errors, which counts, and a gain, which stays."""

    def arrays(self, arm, step, horizon):
        return np.ones((arm.n, 2))

    @staticmethod
    def torques(joints, own, model):
        for j in range(joints.size):
            joints[j].u_law = 30.0 * own[j, 1] * joints[j].e + 5.0 * joints[j].e_dot + own[j, 0]

    @staticmethod
    def adapts(joints, own, model):
        for j in range(joints.size):
            own[j, 0] += 0.01 * joints[j].e
            own[j, 1] += 0.01 * joints[j].e * joints[j].e_dot


def filtered(c):
    c.slower += 0.1 * (c.rate - c.slower)
    c.rate += 0.1 * (c.e_dot - c.rate)
    return 50.0 * c.e + 10.0 * c.slower


# At rest at home, the weight held by the law or by its feedforward.
LAWS = every_law.LAWS | {
    "PID": fp.Pid(100.0, 200.0, 20.0, feedforward=True, observer=60.0),
    "sliding mode": fp.SlidingMode(10.0, 20.0, 0.5, scale="inertia", observer=30.0),
    "Slotine-Li": fp.SlotineLi(10.0, 10.0, scale="inertia"),
    "Slotine-Li, leaking": fp.SlotineLi(10.0, 10.0, scale="inertia", leakage=0.5, observer=20.0),
    "own, whole robot, adapting": RobotAdaptive(),
    "own, remembering": own(filtered, memory=("rate", "slower")),
}
del LAWS["gravity only"]


def answer_of_loop(arm, law, shifts):
    """Return what the torque changes by as measured q, q' leave rest by `shifts`, (ticks, 2 n)."""
    loop, n, still = law.start(arm, step=STEP, horizon=HORIZON), arm.n, np.zeros(arm.n)
    torques = [loop.torque(arm.home + x[:n], x[n:], arm.home, still, still) for x in shifts]
    return np.array(torques) - torques[0]


def answer_of(law, shifts):
    """Return the same of a linear law, its equations written out."""
    m, x, found = np.zeros(len(law.following)), np.zeros(len(law.decay)), []
    ends = np.cumsum([shifts.shape[1], len(law.direct)])
    by_u, by_y, by_m = np.split(law.direct, ends, axis=1)
    for u in shifts:
        y = np.linalg.solve(np.eye(len(by_y)) - by_y, by_u @ u + by_m @ m + law.out @ x)
        s = np.concatenate([u, y, m])
        found.append(law.torque @ s)
        m, x = law.following @ s, law.decay * x + law.drive @ s
    return np.array(found)


@pytest.mark.parametrize("name", LAWS)
def test_a_linear_law_answers_as_its_loop_does(name):
    arm = fp.Arm.two_link()
    if name == "Slotine-Li":  # with joints whose weight does not show at all
        arm = fp.Arm.from_example("ur5")
    rng = np.random.default_rng(0)
    shifts = np.zeros((200, 2 * arm.n))
    shifts[3:] = 1e-6 * np.cumsum(rng.normal(size=(197, 2 * arm.n)), axis=0)
    real = answer_of_loop(arm, LAWS[name], shifts)
    law = linearised(LAWS[name], arm, arm.home, step=STEP, horizon=HORIZON)
    # Second-order terms of angles of some 1e-5.
    assert answer_of(law, shifts) == pytest.approx(real, abs=1e-4 * np.abs(real).max())
    # And frequency by frequency, by the sum of what an impulse leaves over four seconds.
    z = 1.01 * np.exp(1j * np.array([0.05, 0.5, 2.0]))
    pulse = np.zeros((3000, 2 * arm.n))
    pulse[0, -1] = 1.0
    left = np.einsum("kz,kj->zj", z ** -np.arange(3000.0)[:, np.newaxis], answer_of(law, pulse))
    found = law.response(z)[:, :, -1]
    assert found == pytest.approx(left, abs=1e-6 * np.abs(left).max())


def test_where_a_law_is_asked_about_counts():
    arm, q = fp.Arm.two_link(), np.array([0.7, -0.4])
    law = linearised(fp.ComputedTorque(100.0, 20.0), arm, q, step=STEP, horizon=HORIZON)
    assert law.torque[:, 2:] == pytest.approx(-20.0 * arm.mass_matrix(q), rel=1e-6)


ONE = fp.Arm.planar([1.0], [1.0], gravity=0.0)  # a unit inertia
PLANAR = fp.Arm.planar([1.0, 0.8], [2.0, 1.0], gravity=0.0)
FRACTIONAL = fp.AdaptiveFpid(
    kp=60.0, ki=80.0, kd=18.0, integral_order=0.8, derivative_order=0.9, learning_rate=0.0
)
OBSERVED = [
    fp.AdaptiveFpid(
        kp=100.0, ki=200.0, kd=20.0, integral_order=0.9, derivative_order=0.9, learning_rate=0.0,
        scale="inertia", observer=80.0,
    ),
    fp.ComputedTorque(k0=100.0, k1=20.0, ki=300.0, observer=80.0),
    PdGravity(kp=100.0, kd=20.0, ki=300.0, scale="inertia", observer=80.0),
    SlidingMode(slope=10.0, gain=20.0, boundary_layer=2.0, scale="inertia", observer=80.0),
    SlotineLi(slope=10.0, damping=10.0, scale="inertia", observer=80.0),
]  # fmt: skip


def grown(arm, law, late=0):
    """Return the largest speed of the end over that of the beginning, after a small kick."""
    experiment = fp.Experiment(
        arm, Hold(arm.home), v0=np.full(arm.n, 1e-6), duration=3.0, step=STEP,
        sensors=fp.Sensors(delay=late), dynamics="compiled",
    )  # fmt: skip
    run = fp.simulate(experiment, law)
    part = len(run.v) // 6
    return np.abs(run.v[-part:]).max() / np.abs(run.v[:part]).max()


def test_margins_of_pd_on_a_unit_inertia_are_the_closed_forms():
    kp, kd, step = 100.0, 14.0, 2e-4
    report = stability_report(ONE, Pid(kp, 0.0, kd), step=step)
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
    said, joint, together = str(report).splitlines()
    assert said.startswith(f"stable at home, dominant pole {report.dominant_pole.real:.3g} ± ")
    assert f"joint1: gain margin {report.gain_margin[0]:.3g}, gain reduction" in joint
    assert f"delay margin [ms] {1e3 * report.common_delay_margin:.3g}" in together


def test_the_gain_margin_of_a_rate_loop_is_two_over_the_step():
    report = stability_report(ONE, Pid(0.0, 0.0, 50.0), step=1e-3)
    assert report.gain_margin[0] == pytest.approx(2000.0 / 50.0, rel=1e-6)
    assert not report.stable  # nothing holds the angle
    report = stability_report(fp.Arm.two_link(), GravityOnly())
    assert not report.stable
    assert np.isinf(report.phase_margin).all()


def test_terms_without_a_gain_have_no_poles():
    law = fp.AdaptiveFpid(100.0, 0.0, 20.0, integral_order=0.9, derivative_order=0.8)
    assert stability_report(PLANAR, law).stable
    report = stability_report(PLANAR, Pid(100.0, 0.0, 20.0))
    # The integral counts as soon as it has a gain, however small.
    slow = stability_report(PLANAR, Pid(100.0, 1e-3, 20.0))
    assert report.pole_radius < 1.0 - 1e-3 < slow.pole_radius < 1.0


@pytest.mark.parametrize(
    ("kp", "ki", "kd", "pole"),
    # (s + 1)(s^2 + 6 s + 25); then an integral so slow that a push leaves 1/1000 of it.
    [(31.0, 25.0, 7.0, -1.0), (25.0, 0.25, 6.0, -3.0 + 4.0j)],
)
def test_the_dominant_pole_has_a_tenth_of_what_a_push_leaves(kp, ki, kd, pole):
    report = stability_report(ONE, Pid(kp, ki, kd), step=1e-4)
    assert report.dominant_pole == pytest.approx(pole, rel=3e-3)


@pytest.mark.parametrize("law", OBSERVED, ids=lambda law: type(law).__name__)
def test_the_delay_that_is_borne_is_the_simulation_s(law):
    report = stability_report(PLANAR, law)
    assert report.stable
    samples = int(report.common_delay_margin / STEP)
    assert grown(PLANAR, law, samples) < 1.0 < grown(PLANAR, law, samples + 1)
    # Computed torque decouples the joints: there both are the same, but for rounding.
    assert report.common_delay_margin <= report.delay_margin.min() * (1.0 + 1e-9)
    alone = stability_report(PLANAR, dataclasses.replace(law, observer=0.0))
    assert report.common_delay_margin < alone.common_delay_margin


def test_joints_bear_less_together_than_alone():
    arm = fp.Arm.from_example("ur5")
    law = dataclasses.replace(FRACTIONAL, kp=100.0, ki=250.0, kd=22.0, scale="inertia")
    report = stability_report(arm, law)
    assert report.common_delay_margin < report.delay_margin.min()
    assert report.common_gain_margin < report.gain_margin.min()
    assert report.common_gain_reduction > report.gain_reduction.max()
    for by in (0.97, 1.03):
        factor = by * report.common_gain_margin
        more = dict(zip(("kp", "ki", "kd"), factor * np.array([100.0, 250.0, 22.0]), strict=True))
        assert stability_report(arm, dataclasses.replace(law, **more)).stable == (by < 1.0)


@pytest.mark.parametrize("kind", ["gain_margin", "gain_reduction"])
def test_the_loop_breaks_at_its_gain_margin(kind):
    factor = float(getattr(stability_report(ONE, FRACTIONAL), kind)[0])
    assert factor > 1.0 if kind == "gain_margin" else 0.0 < factor < 1.0
    growth = []
    for by in (0.97, 1.03) if kind == "gain_margin" else (1.15, 0.85):
        gains = {k: float(getattr(FRACTIONAL, k)) * factor * by for k in ("kp", "ki", "kd")}
        law = dataclasses.replace(FRACTIONAL, **gains)
        assert stability_report(ONE, law).stable == (len(growth) == 0)
        growth.append(grown(ONE, law))
    assert growth[0] < 1.0 < growth[1]


@pytest.mark.parametrize("kind", [PdGravity, fp.Pid])  # one holds the weight, the other does not
@pytest.mark.parametrize("bandwidth", [5.0, 300.0])
def test_on_the_exact_model_an_observer_adds_two_poles_p_and_moves_none(bandwidth, kind):
    arm = fp.Arm.two_link()
    # h F_v is 3 M_jj for one joint: friction stops it within a step.
    arm = arm.with_friction(viscous=np.diag(arm.mass_matrix(arm.home)) * (3.0, 0.1) / STEP)
    law, pose = kind(kp=100.0, ki=0.0, kd=20.0, scale="inertia"), np.array([0.4, 0.9])
    plant, found = linear_arm(arm, pose, step=STEP), []
    for one in (law, dataclasses.replace(law, observer=bandwidth)):
        linear = linearised(one, arm, pose, step=STEP, horizon=1.0)
        found.append(np.linalg.eigvals(linear.open_loop(plant).closed(np.eye(arm.n))))
    p = np.exp(-bandwidth * STEP)
    alone = np.sort_complex(np.concatenate([found[0], [p, p, p, p]]))
    # A pole that is double comes out at the root of the rounding.
    assert np.sort_complex(found[1]) == pytest.approx(alone, abs=1e-4)
