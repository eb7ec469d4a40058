"""With orders one the law is the integer PID: the same bits, not nearly.

No tolerance: D^1 e is the measured rate and I^1 e is int e, so nothing is approximated, and the
order of operations is part of the promise (the README's "bit by bit").
"""

import numpy as np
import pytest

import fpid_pin as fp

STEP = 1e-3
KP, KI, KD = np.array([10.0, 12.0]), np.array([25.0, 20.0]), np.array([20.0, 15.0])
RATES = np.array([[25.0, 17.0], [3.0, 0.7], [11.0, 29.0]])
K0, K1 = np.array([1.0, 0.6]), np.array([2.0, 1.7])
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [np.inf, (9.0, 4.0)], ids=["unlimited", "saturated"])
# Enough to carry the arm's weight.
CARRYING = pytest.mark.parametrize("limit", [np.inf, (28.0, 8.0)], ids=["unlimited", "saturated"])
TICKS = 3000


def arm_with(limit):
    arm = fp.Arm.two_link()
    return arm.with_limits(effort=limit) if np.isfinite(limit).all() else arm


def signals(seed):
    """Return q, v, q_ref, v_ref, (ticks, 4, 2): smooth enough to integrate, rough in the last bits.

    Errors of about 1 rad that change sign every 100 ticks or so, with noise, so that limits are
    met from both sides and left again.
    """
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(TICKS)[:, np.newaxis, np.newaxis]
    waves = np.sin(rng.uniform(5.0, 30.0, (4, 2)) * t + rng.uniform(0.0, 6.0, (4, 2)))
    return rng.uniform(0.3, 0.8, (4, 2)) * waves + rng.normal(0.0, 0.01, (TICKS, 4, 2))


def same(got, expected, what):
    away = np.abs(got - expected).max()
    assert np.array_equal(got, expected), f"{what}: up to {away:.2g} apart"


class Plain:
    """The adaptive integer PID on one robot, in the order of operations that is promised."""

    def __init__(self, arm, scale, rates):
        self.limit, self.rates = arm.effort_limit, rates
        if isinstance(scale, str):
            scale = np.diag(arm.mass_matrix(arm.home)) if scale == "inertia" else np.ones(2)
        self.scale = np.asarray(scale)
        self.kp, self.ki, self.kd = KP, KI, KD
        self.total, self.cut, self.s = np.zeros(2), np.zeros(2), np.zeros(2)
        self.last = None

    def torque(self, q, v, q_ref, v_ref):
        h, (gamma_p, gamma_i, gamma_d) = STEP, self.rates
        if self.last is not None:
            e, e_dot = self.last
            # A cut torque is not pushed further: nor by the gains, along -S, nor by int e below.
            free = self.cut * -self.s <= 0.0
            self.kp = np.where(free, self.kp - h * (gamma_p * self.s * e), self.kp)
            self.ki = np.where(free, self.ki - h * (gamma_i * self.s * self.total), self.ki)
            self.kd = np.where(free, self.kd - h * (gamma_d * self.s * e_dot), self.kd)
        e, e_dot = q_ref - q, v_ref - v
        if self.last is not None:
            e_, e_dot_ = self.last
            step = 0.5 * h * (e + e_) + h * h / 12.0 * (e_dot_ - e_dot)
            self.total = np.where(self.cut * e <= 0.0, self.total + step, self.total)
        self.last = e, e_dot
        self.s = -(e_dot + K1 * e + K0 * self.total)
        u = self.scale * (self.kp * e + self.ki * self.total + self.kd * e_dot)
        torque = np.clip(u, -self.limit, self.limit)
        self.cut = u - torque
        return torque


def adaptive(scale, rates, **changes):
    return fp.AdaptiveFpid(
        kp=KP, ki=KI, kd=KD, learning_rate=rates, k0=K0, k1=K1, scale=scale, **changes
    )


@LIMITS
@SCALES
def test_without_learning_it_is_the_pid_on_any_signal(scale, limit):
    arm = arm_with(limit)
    pid = fp.Pid(kp=KP, ki=KI, kd=KD, scale=scale).start(arm, step=STEP)
    fpid = adaptive(scale, 0.0).start(arm, step=STEP)
    plain = Plain(arm, scale, np.zeros((3, 2)))
    given = np.array(
        [
            [law.torque(*row) for law in (pid, fpid, plain)]
            for row in signals(seed=1)
        ]
    )  # fmt: skip
    # Some tenths of the ticks are beyond the limit, so that the held integrals count.
    beyond = (np.abs(given[:, 2]) == limit).mean()
    assert 0.1 < beyond < 0.9 if np.isfinite(limit).all() else beyond == 0.0
    same(given[:, 0], given[:, 2], "PID")
    same(given[:, 1], given[:, 2], "FPID")


@LIMITS
@SCALES
@pytest.mark.parametrize("rates", [RATES, np.full((3, 2), 25.0)], ids=["own rates", "one rate"])
def test_with_learning_it_is_the_plain_adaptive_integer_loop(scale, limit, rates):
    arm = arm_with(limit)
    loop, plain = adaptive(scale, rates).start(arm, step=STEP), Plain(arm, scale, rates)
    moved = 0.0
    for k, row in enumerate(signals(seed=2)):
        same(loop.torque(*row), plain.torque(*row), f"torque, tick {k}")
        shown = loop.signals()
        for name in ("kp", "ki", "kd", "s"):
            same(shown[name], getattr(plain, name), f"{name}, tick {k}")
        moved = max(moved, np.abs(plain.kp - KP).min())
    assert moved > 1.0


@pytest.mark.parametrize(
    "changes",
    [
        {"regressors": "integer"},
        {"design": fp.fractional.ExponentialSum(modes=8)},
        {"design": fp.fractional.Crone()},
    ],
    ids=["integer regressors", "8 modes", "CRONE"],
)
def test_neither_the_design_nor_the_regressors_matter_at_orders_one(changes):
    """The gradient of the integer law has the integer regressors, and no operator is at work."""
    experiment = fp.paper_experiment(duration=1.0)
    one = fp.simulate(experiment, adaptive("none", RATES))
    other = fp.simulate(experiment, adaptive("none", RATES, **changes))
    for name in ("q", "torque", "kp", "ki", "kd", "s"):
        same(getattr(one, name), getattr(other, name), name)
