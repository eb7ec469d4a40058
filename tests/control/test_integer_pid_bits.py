"""With orders one the law is the integer PID: the same bits, not nearly.

No tolerance: D^1 e is the measured rate and I^1 e is int e, so nothing is approximated, and the
order of operations, that of `by_hand`, is part of the promise (the README's "bit by bit").
"""

import by_hand
import numpy as np
import pytest

import fpid_pin as fp

STEP, TICKS = 1e-3, 1500
KP, KI, KD = np.array([10.0, 12.0]), np.array([25.0, 20.0]), np.array([20.0, 15.0])
RATES = np.array([[25.0, 17.0], [3.0, 0.7], [11.0, 29.0]])
K0, K1 = np.array([1.0, 0.6]), np.array([2.0, 1.7])
SCALES = pytest.mark.parametrize("scale", ["none", "inertia", (0.7, 1.9)], ids=str)
LIMITS = pytest.mark.parametrize("limit", [np.inf, (9.0, 4.0)], ids=["unlimited", "saturated"])


def signals(seed):
    """Return q, v, q_ref, v_ref, (ticks, 4, 2): smooth enough to integrate, rough in the last bits.

    Errors of about 1 rad that change sign every 100 ticks or so, with noise, so that limits are
    met from both sides and left again.
    """
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(TICKS)[:, np.newaxis, np.newaxis]
    waves = np.sin(rng.uniform(5.0, 30.0, (4, 2)) * t + rng.uniform(0.0, 6.0, (4, 2)))
    return rng.uniform(0.3, 0.8, (4, 2)) * waves + rng.normal(0.0, 0.01, (TICKS, 4, 2))


def written_out(arm, law, scale):
    if isinstance(scale, str):
        scale = np.diag(arm.mass_matrix(arm.home)) if scale == "inertia" else np.ones(2)
    return by_hand.Loop(arm, law, STEP, scale=np.asarray(scale))


def adaptive(scale, rates, **changes):
    return fp.AdaptiveFpid(
        kp=KP, ki=KI, kd=KD, learning_rate=rates, k0=K0, k1=K1, scale=scale, **changes
    )


@LIMITS
@SCALES
def test_without_learning_it_is_the_pid_on_any_signal(scale, limit):
    arm = fp.Arm.two_link().with_limits(effort=limit)
    pid = fp.Pid(kp=KP, ki=KI, kd=KD, scale=scale).start(arm, step=STEP)
    fpid = adaptive(scale, 0.0).start(arm, step=STEP)
    plain = written_out(arm, by_hand.Pid(KP, KI, KD), scale)
    beyond = 0
    for row in signals(seed=1):
        torque = plain.torque(*row, np.zeros(2))
        beyond += (np.abs(torque) == limit).sum() / (2 * TICKS)
        assert np.array_equal(pid.torque(*row), torque)
        assert np.array_equal(fpid.torque(*row), torque)
    # Some tenths of the ticks are beyond the limit, so that the held integrals count.
    assert 0.1 < beyond < 0.9 if np.isfinite(limit).all() else beyond == 0.0


@LIMITS
@SCALES
def test_with_learning_it_is_the_plain_adaptive_integer_loop(scale, limit):
    arm = fp.Arm.two_link().with_limits(effort=limit)
    loop = adaptive(scale, RATES).start(arm, step=STEP)
    law = by_hand.Fpid([KP, KI, KD], RATES, k0=K0, k1=K1)
    plain, moved = written_out(arm, law, scale), 0.0
    for row in signals(seed=2):
        gains = law.gains
        assert np.array_equal(loop.torque(*row), plain.torque(*row, np.zeros(2)))
        shown = loop.signals()
        assert np.array_equal([shown[name] for name in ("kp", "ki", "kd")], gains)
        assert np.array_equal(shown["s"], law.s)
        moved = max(moved, np.abs(gains[0] - KP).min())
    assert moved > 1.0


@pytest.mark.parametrize("changes", [{"regressors": "integer"}, {"design": fp.fractional.Crone()}])
def test_neither_the_design_nor_the_regressors_matter_at_orders_one(changes):
    """The gradient of the integer law has the integer regressors, and no operator is at work."""
    experiment = fp.paper_experiment(duration=1.0)
    one = fp.simulate(experiment, adaptive("none", RATES))
    other = fp.simulate(experiment, adaptive("none", RATES, **changes))
    for name in ("q", "torque", "kp", "ki", "kd", "s"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
