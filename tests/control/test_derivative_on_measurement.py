"""The derivative of the measured angle in place of the error's: no kick where references jump."""

import dataclasses
import math

import numpy as np
import pytest

import fpid_pin as fp

STEP = 1e-3
LAW = fp.AdaptiveFpid(
    kp=(10, 12), ki=(25, 20), kd=(20, 15), integral_order=0.9, derivative_order=(0.9, 0.6),
    order_learning_rate=0.1, safeguards=fp.Safeguards(sigma=0.03), feedforward=True,
)  # fmt: skip
ON_MEASUREMENT = dataclasses.replace(LAW, derivative_on="measurement")


def jump(law, by=0.2):
    """Return by how much the torque jumps with q_d, the arm and q'_d being at rest."""
    loop, rest = law.start(fp.Arm.two_link(), step=STEP), np.zeros(2)
    for _ in range(20):
        before = loop.torque(rest, rest, rest, rest, rest)
    return loop.torque(rest, rest, rest + by, rest, rest) - before


def test_a_jump_of_the_reference_kicks_by_the_closed_form_or_not_at_all():
    fixed = dataclasses.replace(
        LAW, order_learning_rate=0.0, learning_rate=0.0, safeguards=None, feedforward=False
    )
    without = jump(dataclasses.replace(fixed, kd=0.0))
    assert np.array_equal(jump(dataclasses.replace(fixed, derivative_on="measurement")), without)
    mu = np.array([0.9, 0.6])
    size = 6.0 * 0.2 * STEP**-mu / ([math.gamma(1.0 - m) for m in mu] * (2.0 - mu) * (3.0 - mu))
    assert jump(fixed) - without == pytest.approx([20, 15] * size, rel=1e-5)


def test_where_the_reference_holds_both_are_one_law():
    """D^mu (q_d - q) = -D^mu q: gains and orders that adapt, too."""
    arm = fp.Arm.two_link()
    experiment = fp.Experiment(
        arm, fp.references.Hold((0.4, -0.3)), q0=(0.0, 0.2), duration=2.0, dynamics="compiled"
    )
    error, measurement = fp.simulate(experiment, [LAW, ON_MEASUREMENT])
    for name in ("q", "torque", "kd", "derivative_order"):
        assert getattr(measurement, name) == pytest.approx(getattr(error, name), rel=1e-9, abs=1e-9)
    assert np.ptp(error.kd[:, 0]) > 1e-3
