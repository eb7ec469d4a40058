"""A tick with a supervisor against the equations, written out with NumPy and Pinocchio.

What a tick is without one is in tests/control/test_laws.py.
"""

import dataclasses

import by_hand
import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control.state import State
from fpid_pin.kernels import supervisor, tick
from fpid_pin.kernels.records import GIVEN, ROBOT

pytestmark = pytest.mark.kernels
H = 2e-3


class Supervised(by_hand.Loop):
    """The loop written out, with a supervisor; orders are 1, so that operators are trivial."""

    def __init__(self, law, arm):
        self.guard, n = law.supervisor, arm.n
        gains = [np.broadcast_to(k, n) for k in (law.kp, law.ki, law.kd)]
        super().__init__(
            arm, by_hand.Fpid(gains, [3.0] * 3), H, scale=law.scale_on(arm),
            feedforward=law.feedforward, observer=law.observer,
        )  # fmt: skip
        self.bandwidth, self.p, self.bound = law.bandwidth, self.guard.p, self.guard.bound(n)

    def energy(self, e, rate):
        x = np.stack([e, rate])
        return 0.5 * np.einsum("aj,ab,bj", x, self.p, x)

    def is_held(self):
        paper = self.guard.kind == "paper"
        self.acting = paper and self.energy(self.e, self.rate) >= self.guard.threshold
        return self.acting

    def supervised(self, asked, given):
        if self.guard.kind == "paper":
            return self.limited(asked + self.paper_torque(asked)) if self.acting else given
        change, cut = self.least_change(self.a_ref - self.ahead(given)), self.cut
        given = self.limited(given + self.felt() @ change)
        self.cut = self.cut + cut
        return given

    def paper_torque(self, u):
        """Eq. (20)."""
        mass, guard = self.mass(), self.guard
        w = np.linalg.solve(mass, self.p[0, 1] * self.e + self.p[1, 1] * self.rate)
        size = self.bound + np.abs(u) + np.abs(self.coriolis(self.v))
        size += np.abs(mass @ (guard.k0 * self.e + guard.k1 * self.rate))
        size += np.abs(mass @ self.a_ref)
        if guard.gravity_bound is None:
            size += np.abs(self.gravity())
        layer = guard.boundary_layer
        return size * (np.clip(w / layer, -1.0, 1.0) if layer else np.sign(w))

    def least_change(self, a):
        """The least change of the error's acceleration `a` that ends in the ball {V <= V_T}."""
        guard, ahead = self.guard, self.guard.lookahead or H
        target, trigger = (part * guard.threshold for part in (guard.target, guard.trigger))
        rate = self.v_ref - self.v_hat
        there = np.stack([self.e + ahead * rate, rate])
        by_a = ahead * np.array([H / 2.0, 1.0])  # of error and rate one look-ahead later
        eta, slope = by_a @ self.p @ by_a, by_a @ self.p @ there
        least = self.energy(*there) - slope @ slope / (2.0 * eta)
        z = a + slope / eta
        size, radius = np.linalg.norm(z), np.sqrt(max(2.0 * (target - least) / eta, 0.0))
        if self.energy(self.e, rate) < trigger or size == 0.0:
            return np.zeros_like(z)
        reserve = np.abs(np.linalg.solve(self.felt(), z / size)) @ self.bound
        # z is what is to be made smaller, and an error's acceleration falls as the arm's grows.
        return z / size * np.clip(size + reserve - radius, 0.0, size)


def fpid(guard=None, **others):
    return fp.AdaptiveFpid(
        kp=(40.0, 20.0), ki=20.0, kd=(10.0, 4.0), learning_rate=3.0, k0=1.0, k1=2.0,
        supervisor=guard, **others,
    )  # fmt: skip


PAPER = fp.Supervisor(1.3, 1.0, kind="paper", disturbance_bound=0.4)
LAWS = {
    "paper": fpid(PAPER, scale=(2.0, 0.5), observer=40.0),
    "paper, a layer": fpid(dataclasses.replace(PAPER, boundary_layer=2.0), feedforward=True),
    "paper, a bound": fpid(dataclasses.replace(PAPER, gravity_bound=(30.0, 8.0), observer=20.0)),
    "quiet": fpid(fp.Supervisor.quiet(1.4, 1.0)),
    "reserve": fpid(fp.Supervisor(1.4, 1.0, disturbance_bound=(0.15, 0.05), lookahead=0.02)),
}


SEVEN = fp.AdaptiveFpid(
    kp=40.0, ki=20.0, kd=10.0, learning_rate=3.0, k0=1.0, k1=2.0, scale="inertia", feedforward=True,
    supervisor=fp.Supervisor(2.4, 1.0, disturbance_bound=0.02, lookahead=0.02),
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "limited"),
    [("seven joints", False), *((name, True) for name in LAWS)],
)
def test_torques_are_those_of_the_equations(name, limited):
    arm, law = fp.Arm.two_link().with_friction(viscous=0.3), LAWS.get(name, SEVEN)
    if name == "seven joints":  # h F_v is up to a tenth of M_jj: how friction counts is to be seen
        arm = fp.Arm.from_example("panda").with_limits(effort=np.inf)
        inertia = np.diag(arm.mass_matrix(np.zeros(7)))
        arm = arm.with_friction(viscous=inertia * np.linspace(0.0, 0.1, 7) / H)
    arm = arm.with_limits(effort=(38.0, 11.0)) if limited else arm
    t = H * np.arange(60)[:, np.newaxis] * np.linspace(1.0, 1.3, arm.n)
    # No error, a small one, one that a supervisor acts on, and back.
    error = 0.003 * np.sin(25.0 * t) + 0.4 * np.clip(np.sin(40.0 * t - 1.5), 0.0, 1.0) ** 2
    error[:4] = 0.0
    q_ref, v_ref, a_ref = np.sin(t), np.cos(t), -np.sin(t)
    inputs = np.stack(
        [q_ref - error, v_ref - np.gradient(error, H, axis=0), q_ref, v_ref, a_ref], axis=1
    )
    state, written = State(law, arm, step=H, horizon=10.0), Supervised(law, arm)
    found, expected, acted, cut = [], [], 0, 0
    for row in inputs:
        state.inputs[:] = row
        state.tick()
        found.append(state.torque.copy())
        law_gains = written.law.gains
        expected.append(written.torque(*row))
        acted += bool(np.any(state.joints["u_s"]))
        cut += bool(np.any(state.cut))
    found, expected = np.array(found), np.array(expected)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    gains = np.array([state.joints[k] for k in ("kp", "ki", "kd")])
    assert gains == pytest.approx(np.array(law_gains), rel=1e-12)
    start = [np.broadcast_to(k, arm.n) for k in (law.kp, law.ki, law.kd)]
    assert (gains != np.array(start)).any()
    # Nothing that is to be compared stood idle, or acted all the time.
    assert 0 < acted < 60, acted
    assert (0 < cut < 60) == limited, cut


def test_a_joint_that_was_cut_tells_nothing_where_adapting_would_ask_for_more():
    """Adaptation pushes the torque where -S points."""
    joints, out = np.zeros(5, GIVEN), np.full(5, np.nan)
    joints["cut"], joints["s"] = [2.0, 2.0, -2.0, -2.0, 0.0], [-1.0, 3.0, -4.0, 5.0, 6.0]
    tick.mask_surface(joints, out)
    assert out.tolist() == [0.0, 3.0, -4.0, 0.0, 6.0]


@pytest.mark.parametrize("error", [0.0, 10.0])
def test_no_error_is_left_alone_and_where_the_least_v_is_beyond_v_t_the_ball_is_its_centre(error):
    robots, joints, direction = np.zeros(1, ROBOT), np.zeros(1, GIVEN), np.full(1, np.nan)
    given = {"h": H, "p11": 1.75, "p12": 1.0, "p22": 1.5, "lookahead": H, "target": 0.5}
    for name, value in given.items():
        robots[name] = value
    robot, joints["e"] = robots[0], error
    supervisor.find_correction(robot, joints, np.zeros(1), direction)
    assert bool(robot.correcting) == (error > 0.0)
    assert (robot.radius == 0.0) == (error > 0.0)
    supervisor.least_correction(robot, joints, np.zeros(1), direction)
    assert abs(direction[0]) == pytest.approx(robot.distance if error else 0.0, rel=1e-14, abs=0)
