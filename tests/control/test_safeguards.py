"""What keeps adapted gains bounded, each against its closed form."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import Safeguards
from fpid_pin.control.fpid import adapt_gains
from fpid_pin.kernels.compiled import compile_plain, kernel

STEP = 1e-3
START = np.array([10.0, 20.0, 5.0])


adapt = compile_plain(adapt_gains)


@kernel
def repeat(joints, history):
    c = joints[0]
    for k in range(history.shape[0]):
        adapt(c)
        history[k, 0], history[k, 1], history[k, 2] = c.kp, c.ki, c.kd


def adapted(guard, signals, ticks, rate=25.0):
    """Return the gains, (ticks, 3), of one joint whose [int e, e, e'] stays at `signals`.

    The law's own records are filled by its description; then the signals are held there.
    """
    law = fp.AdaptiveFpid(
        *START, learning_rate=rate, k0=1.0, k1=2.0, regressors="integer", safeguards=guard
    )
    arm = fp.Arm.planar([1.0], [1.0])
    joints = law.start(arm, step=STEP).state.joints
    joints["int_e"], joints["e"], joints["e_dot"] = signals
    joints["s"] = -(signals[2] + 2.0 * signals[1] + signals[0])
    history = np.empty((ticks, 3))
    repeat(joints, history)
    return history


def test_unguarded_gains_drift_for_ever_under_a_constant_error():
    gains = adapted(None, (0.3, 0.0, 0.0), 4000)
    slope = 25.0 * 0.3**2  # gamma k0 (int e)^2
    assert gains[-1] == pytest.approx([10.0, 20.0 + slope * 4.0, 5.0], rel=1e-9)


def test_projection_keeps_each_gain_within_its_bounds():
    maximum = np.array([[10.5], [20.5], [5.5]])
    gains = adapted(Safeguards(minimum=4.0, maximum=maximum), (0.5, 0.4, 0.3), 5000)
    assert (gains <= maximum.T).all()
    assert gains[-1] == pytest.approx(maximum[:, 0])
    falling = adapted(Safeguards(minimum=4.0), (-2.0, 0.4, 0.3), 5000)
    assert (falling >= 4.0).all()
    assert falling[-1, 0] == 4.0


def test_projection_counts_from_the_start():
    gains = adapted(Safeguards(maximum=8.0), (0.0, 0.0, 0.0), 1)
    assert gains[0] == pytest.approx([8.0, 8.0, 5.0])
    law = fp.AdaptiveFpid(kp=10.0, ki=3.0, kd=2.0, safeguards=Safeguards(maximum=8.0))
    loop = law.start(fp.Arm.two_link(), step=STEP)
    assert loop.torque([0.0, 0.0], [0.0, 0.0], [0.1, 0.1], [0.0, 0.0])[0] < 0.1 * 8.0 + 1e-2


def test_sigma_modification_settles_where_gradient_and_leakage_balance():
    sigma, rate, e = 4.0, 25.0, 0.1
    gains = adapted(Safeguards(sigma=sigma), (0.0, e, 0.0), 4000, rate=rate)
    offset = rate * 2.0 * e * e / sigma  # -gamma S e = gamma k1 e^2
    t = STEP * np.arange(1, 4001)
    assert gains[:, 0] == pytest.approx(10.0 + offset * (1.0 - np.exp(-sigma * t)), rel=1e-3)
    assert gains[-1, 1:] == pytest.approx([20.0, 5.0])


def test_e_modification_leaks_only_while_the_surface_is_away_from_zero():
    nu, rate, e = 0.4, 25.0, 0.1
    gains = adapted(Safeguards(e_modification=nu), (0.0, e, 0.0), 10_000, rate=4.0 * rate)
    # gamma |S| e = gamma nu |S| (K - K0): the offset is e/nu whatever the rate.
    assert gains[-1, 0] == pytest.approx(10.0 + e / nu, rel=1e-4)
    still = adapted(Safeguards(e_modification=nu), (-0.2, 0.1, 0.0), 100)
    assert (still == START).all()


def test_nothing_adapts_within_the_dead_zone_and_only_the_excess_counts_beyond():
    within = adapted(Safeguards(dead_zone=0.21), (0.0, 0.1, 0.0), 100)
    assert (within == START).all()
    beyond = adapted(Safeguards(dead_zone=0.15), (0.0, 0.1, 0.0), 1000)
    assert beyond[-1, 0] == pytest.approx(10.0 + 25.0 * (0.2 - 0.15) * 0.1, rel=1e-9)


def test_a_held_joint_does_not_even_leak():
    arm = fp.Arm.planar([1.0], [1.0]).with_limits(effort=0.5)
    law = fp.AdaptiveFpid(*START, learning_rate=25.0, safeguards=Safeguards(sigma=5.0))
    loop = law.start(arm, step=STEP)
    loop.torque([0.0], [0.0], [0.1], [0.0])
    loop.state.joints["kp"] = 30.0  # above the initial one, so that leakage would lower it
    for _ in range(100):
        loop.torque([0.0], [0.0], [0.1], [0.0])
    assert loop.signals()["kp"] == [30.0]
