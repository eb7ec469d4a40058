"""A tick of a controller against the equations, written out with NumPy and Pinocchio."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control.state import start_all
from fpid_pin.kernels import supervisor, tick
from fpid_pin.kernels.records import GIVEN, ROBOT

pytestmark = pytest.mark.kernels
H = 2e-3


class WrittenOut:
    """The torques of an FPID, (n,), tick by tick; orders are 1, so that operators are trivial."""

    def __init__(self, law, arm):
        self.law, self.arm, self.guard, self.k = law, arm, law.supervisor, 0
        n = arm.n
        self.int_e, self.cut, self.xi = np.zeros((3, n))
        self.hold = True
        self.scale = law.scale_on(arm)
        pole = np.exp(-law.bandwidth * H)
        self.l1, self.l2 = 1.0 - pole**2, (1.0 - pole) ** 2 / H
        self.gains = np.array([np.broadcast_to(k, n) for k in (law.kp, law.ki, law.kd)])
        if self.guard is not None:
            self.p, self.bound = self.guard.p, self.guard.bound(n)

    def energy(self, e, rate):
        x = np.stack([e, rate])
        return 0.5 * np.einsum("aj,ab,bj", x, self.p, x)

    def limited(self, asked):
        self.torque = np.clip(asked, -self.arm.effort_limit, self.arm.effort_limit)
        self.cut = asked - self.torque

    def tick(self, q, v, q_ref, v_ref, a_ref):
        law, arm = self.law, self.arm
        mass = arm.mass_matrix(q)
        # Over a step viscous friction is implicit in the speed.
        stepped = mass + H * np.diag(arm.viscous_friction)
        e, rate = q_ref - q, v_ref - v
        paper = self.guard is not None and self.guard.kind == "paper"
        self.acting = paper and self.energy(e, rate) >= self.guard.threshold
        if self.k and not self.hold:
            self.gains = self.gains - H * 3.0 * self.s * self.terms * (self.cut * -self.s <= 0.0)
        if self.k and not self.acting:
            grows = H / 2 * (e + self.e) + H**2 / 12 * (self.rate - rate)
            self.int_e = self.int_e + np.where(self.cut * e > 0.0, 0.0, grows)
        self.e, self.rate, self.hold = e, rate, self.acting
        if law.bandwidth and self.k:
            miss = v - self.predicted
            v_hat, self.xi = self.predicted + self.l1 * miss, self.xi + self.l2 * miss
        else:
            v_hat = v
        self.terms = np.stack([e, self.int_e, rate])
        self.s = -(rate + 2.0 * e + 1.0 * self.int_e)
        u = self.scale * (self.gains * self.terms).sum(axis=0)
        if law.feedforward:
            u = u + arm.inverse_dynamics(q_ref, v_ref, a_ref) + arm.viscous_friction * v_ref
        if law.observer:
            u = u - stepped @ self.xi
        self.limited(u)
        if self.acting:
            self.limited(u + self.paper_torque(q, v, a_ref, mass, u))
        weight = arm.gravity_vector(q)
        bias = weight + arm.coriolis_matrix(q, v_hat) @ v_hat + arm.viscous_friction * v
        a, change = np.linalg.solve(stepped, self.torque - bias), np.zeros(arm.n)
        if self.guard is not None and not paper:
            before = self.torque
            change = self.least_change(v_hat, v_ref, a_ref - a - self.xi, stepped)
            self.limited(u + stepped @ change)
            change = np.linalg.solve(stepped, self.torque - before)
        self.predicted = v_hat + H * (a + change + self.xi)
        self.k += 1
        return self.torque

    def paper_torque(self, q, v, a_ref, mass, u):
        """Eq. (20)."""
        w = np.linalg.solve(mass, self.p[0, 1] * self.e + self.p[1, 1] * self.rate)
        size = self.bound + np.abs(u) + np.abs(self.arm.coriolis_matrix(q, v) @ v)
        size += np.abs(mass @ (self.guard.k0 * self.e + self.guard.k1 * self.rate))
        size += np.abs(mass @ a_ref)
        if self.guard.gravity_bound is None:
            size += np.abs(self.arm.gravity_vector(q))
        layer = self.guard.boundary_layer
        return size * (np.clip(w / layer, -1.0, 1.0) if layer else np.sign(w))

    def least_change(self, v_hat, v_ref, a, mass):
        """The least change of the error's acceleration `a` that ends in the ball {V <= V_T}."""
        guard, ahead = self.guard, self.guard.lookahead or H
        target, trigger = (part * guard.threshold for part in (guard.target, guard.trigger))
        rate = v_ref - v_hat
        there = np.stack([self.e + ahead * rate, rate])
        by_a = ahead * np.array([H / 2.0, 1.0])  # of error and rate one look-ahead later
        eta, slope = by_a @ self.p @ by_a, by_a @ self.p @ there
        least = self.energy(*there) - slope @ slope / (2.0 * eta)
        z = a + slope / eta
        size, radius = np.linalg.norm(z), np.sqrt(max(2.0 * (target - least) / eta, 0.0))
        if self.energy(self.e, rate) < trigger or size == 0.0:
            return np.zeros_like(z)
        reserve = np.abs(np.linalg.solve(mass, z / size)) @ self.bound
        # z is what is to be made smaller, and an error's acceleration falls as the arm's grows.
        return z / size * np.clip(size + reserve - radius, 0.0, size)


def fpid(guard=None, **others):
    return fp.AdaptiveFpid(
        kp=(40.0, 20.0), ki=20.0, kd=(10.0, 4.0), learning_rate=3.0, k0=1.0, k1=2.0,
        supervisor=guard, **others,
    )  # fmt: skip


PAPER = fp.Supervisor(1.3, 1.0, kind="paper", disturbance_bound=0.4)
LAWS = {
    "alone": fpid(),
    "scaled, both assists": fpid(scale=(2.0, 0.5), feedforward=True, observer=40.0),
    "paper": fpid(PAPER),
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
    [("scaled, both assists", False), ("seven joints", False), *((name, True) for name in LAWS)],
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
    state, written = start_all([law], arm, step=H, horizon=10.0)[0], WrittenOut(law, arm)
    found, expected, acted, cut = [], [], 0, 0
    for row in inputs:
        state.inputs[:] = row
        state.tick()
        found.append(state.torque.copy())
        expected.append(written.tick(*row))
        acted += bool(np.any(state.joints["u_s"]))
        cut += bool(np.any(state.cut))
    found, expected = np.array(found), np.array(expected)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    gains = np.array([state.joints[k] for k in ("kp", "ki", "kd")])
    assert gains == pytest.approx(written.gains, rel=1e-12)
    start = [np.broadcast_to(k, arm.n) for k in (law.kp, law.ki, law.kd)]
    assert (gains != np.array(start)).any()
    # Nothing that is to be compared stood idle, or acted all the time.
    assert (0 < acted < 60) == (law.supervisor is not None), acted
    assert (0 < cut < 60) == limited, cut


def test_a_joint_that_was_cut_tells_nothing_where_adapting_would_ask_for_more():
    """Adaptation pushes the torque where -S points."""
    joints, out = np.zeros(5, GIVEN), np.full(5, np.nan)
    joints["cut"], joints["s"] = [2.0, 2.0, -2.0, -2.0, 0.0], [-1.0, 3.0, -4.0, 5.0, 6.0]
    tick.mask_surface(joints, out)
    assert out.tolist() == [0.0, 3.0, -4.0, 0.0, 6.0]


# ---------------------------------------------------------------------- supervisor and observer


def records(n=2, **robot):
    robots, joints = np.zeros(1, ROBOT), np.zeros(n, GIVEN)
    robots["h"] = H
    for name, value in robot.items():
        robots[name] = value
    return robots[0], joints


def test_where_even_the_least_v_is_beyond_v_t_the_ball_is_its_centre():
    robot, joints = records(1, p11=1.75, p12=1.0, p22=1.5, lookahead=H, target=0.5)
    joints["e"] = 10.0
    direction = np.zeros(1)
    supervisor.find_correction(robot, joints, np.zeros(1), direction)
    assert robot.radius == 0.0
    supervisor.least_correction(robot, joints, np.zeros(1), direction)
    assert abs(direction[0]) == pytest.approx(robot.distance, rel=1e-14)


def test_an_error_at_rest_where_it_should_be_is_left_alone():
    robot, joints = records(p11=1.75, p12=1.0, p22=1.5, lookahead=H, target=0.5)
    direction = np.full(2, np.nan)
    supervisor.find_correction(robot, joints, np.zeros(2), direction)
    assert not robot.correcting
    assert (direction == 0.0).all()
