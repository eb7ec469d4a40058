"""A law about rest answers small signals as its Loop does, tick by tick: every form, every part."""

import dataclasses
from dataclasses import dataclass

import every_law
import numpy as np
import pytest
from own_laws import own

import fpid_pin as fp
from fpid_pin.control.law import Derivative, Integral
from fpid_pin.control.linear import linearised
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import GrunwaldLetnikov

STEP, HORIZON = 1e-3, 5.0
FPID = every_law.FPID


@dataclass(frozen=True, eq=False)
class FractionalSurface(fp.Controller):
    """Operators of the law's own surface, which has another one in it."""

    operators = {
        "d_e": Derivative(0.5),
        "d_s": Derivative(0.7, of="s"),
        "i_s": Integral(0.6, of="s", sign=-1),
    }

    @staticmethod
    def surface(c):
        c.s = -(c.e_dot + 2.0 * c.d_e)

    @staticmethod
    def torque(c):
        return 30.0 * c.e - 3.0 * c.d_s - 5.0 * c.i_s


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


@dataclass(frozen=True, eq=False)
class PythonFractional(fp.Controller):
    """A fractional PD whose operator no one but itself knows of."""

    def begin(self, state):
        state.memory["d_e"] = state.operator(0.8)

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return 100.0 * (q_ref - q) + 20.0 * state.memory["d_e"].update(q_ref - q, v_ref - v)


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
    "own, a fractional surface": FractionalSurface(),
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


def jumping(c):
    return 10.0 * c.e + (1.0 if c.e_dot > 0.0 else -1.0)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (own(jumping), "smooth at rest, got a jump in Own"),
        (
            own(lambda c: 10.0 * abs(c.e)),
            "smooth at rest, got a jump in Own",
        ),
        (
            fp.SlidingMode(slope=10.0, gain=5.0, boundary_layer=0.0),
            "expected a law that is smooth at rest, got a jump in SlidingMode",
        ),
        (
            PythonFractional(),
            "expected a law that declares its operators, got PythonFractional, whose torque "
            "depends on a past of its own, such as a Bank's",
        ),
        (
            dataclasses.replace(FPID, design=GrunwaldLetnikov()),
            "design: expected one with modes, got GrunwaldLetnikov",
        ),
    ],
)
def test_what_cannot_be_linearised_is_refused_in_a_line(law, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        fp.stability_report(fp.Arm.two_link(), law)
    assert "\n" not in str(caught.value)
