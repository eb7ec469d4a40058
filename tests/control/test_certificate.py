"""Gains may move at any speed within a certified box: judged by sequences, grids, closed forms."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import Safeguards, certify_gains, gain_ceilings, suggest_gains
from fpid_pin.control.certificate import best_scaling, joint_factors, norm_bound
from fpid_pin.control.linear import LinearSystem, linear_arm
from fpid_pin.fractional.design import modes_of

STEP = 1e-3
TWO, UR5 = fp.Arm.two_link(), fp.Arm.from_example("ur5")


@pytest.fixture(scope="module", params=["two_link", "ur5"])
def suggested(request):
    """An arm, its suggested law, and the certificate of that at home."""
    arm = TWO if request.param == "two_link" else UR5
    law = suggest_gains(arm)
    return arm, law, certify_gains(arm, law, poses=arm.home)


def on_a_grid(arm, law, q, omega):
    """Return -K0 T P (I + K0 T P)^-1 for each term, (K, 3 n, 3 n), from the open loop's parts.

    P is the arm's response, from its matrices; T the operators', each from its own recursion.
    """
    z, n = np.exp(1j * omega * STEP), arm.n
    plant = linear_arm(arm, q, step=STEP)
    moved = np.array([np.linalg.solve(x * np.eye(2 * n) - plant.a, plant.b) for x in z])
    angle, rate = moved[:, :n], moved[:, n:]
    back = (1.0 / z)[:, np.newaxis]
    whole = (STEP / 2.0 * (1.0 + back), STEP**2 / 12.0 * (back - 1.0))
    whole = [(x / (1.0 - back))[:, :, np.newaxis] for x in whole]
    total = whole[0] * angle + whole[1] * rate
    lam, mu = (float(np.mean(x)) for x in (law.integral_order, law.derivative_order))
    terms = [angle]
    for alpha, f, f_dot in ((1.0 - lam, total, angle), (mu, angle, rate)):
        rule = modes_of(law.design, alpha, step=STEP, horizon=3600.0).recursion().response(1.0 / z)
        terms.append(rule[:, 0, None, None] * f + rule[:, 1, None, None] * f_dot)
    gains = [np.broadcast_to(k, n) * law.scale_on(arm) for k in (law.kp, law.ki, law.kd)]
    answer = np.stack(gains)[:, :, np.newaxis] * np.stack(terms, axis=1)  # (K, 3, n, n)
    closed = np.linalg.inv(np.eye(n) + answer.sum(axis=1))
    whole = -(answer @ closed[:, np.newaxis]).reshape(len(z), 3 * n, n)
    return np.tile(whole, 3)


def largest(matrices, scaling):
    scaled = scaling[:, np.newaxis] * matrices / scaling
    return np.linalg.norm(scaled, 2, axis=(1, 2)).max()


def test_a_certified_box_keeps_the_scaled_norm_below_one_on_a_dense_grid(suggested):
    arm, law, found = suggested
    assert found.reach == found.reaches.min() > 0.27
    omega = np.geomspace(1e-6, np.pi / STEP, 1000)
    grid = on_a_grid(arm, law, arm.home, omega)
    used = np.ones(3 * arm.n, dtype=bool)
    scaling = best_scaling(grid[::12, :, : arm.n], used)
    # E D^-1 as one factor a joint has the same norms.
    narrow = scaling[:, np.newaxis] * grid[:, :, : arm.n] * joint_factors(scaling, used)
    assert np.linalg.norm(narrow, 2, axis=(1, 2)).max() == pytest.approx(largest(grid, scaling))
    # This scaling is not quite the one used; the reach uses 0.999 of a bound within one per cent.
    assert 0.96 < found.reach * largest(grid, scaling) < 1.01
    assert found.reach * largest(grid, np.ones(3 * arm.n)) > 1.0  # scaling is what does it


@pytest.mark.parametrize("seed", range(3))
def test_the_norm_of_a_system_is_bounded_between_frequencies(seed):
    """Lightly damped: two of three peaks are between the frequencies that are looked at first."""
    rng = np.random.default_rng(seed)
    angles, radius = rng.uniform(0.1, 3.0, 3), 1.0 - 10.0 ** rng.uniform(-5, -2, 3)
    a = np.zeros((6, 6))
    for k, (x, r) in enumerate(zip(angles, radius, strict=True)):
        turn = [[np.cos(x), -np.sin(x)], [np.sin(x), np.cos(x)]]
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = r * np.array(turn)
    system = LinearSystem(a, rng.normal(size=(6, 2)), rng.normal(size=(5, 6)))

    def norms(x):
        return np.linalg.norm(system.response(np.exp(1j * x)), 2, axis=(1, 2))

    near = np.concatenate([x + np.linspace(-30.0, 30.0, 6001) * (1.0 - r)
                           for x, r in zip(angles, radius, strict=True)])  # fmt: skip
    exact = norms(near).max()
    coarse = norms(np.linspace(0.0, np.pi, 20)).max()
    bound = norm_bound(system, lambda x: system.response(np.exp(1j * x)), coarse)
    assert coarse < 0.9 * exact
    assert exact < bound < 1.0101 * exact


def joint(kp, kd):
    """Return a joint of inertia 1 without weight or friction, and a PD law on it."""
    arm = fp.Arm.planar(lengths=(1.0,), masses=(1.0,), gravity=0.0)
    assert arm.mass_matrix(arm.home)[0, 0] == pytest.approx(1.0)
    law = fp.AdaptiveFpid(kp, 0.0, kd, integral_order=0.5, derivative_order=1.0)
    return arm, law


@pytest.mark.parametrize(
    ("kp", "kd"), [(100.0, 2.0), (100.0, 8.0), (100.0, 20.0), (4e4, 60.0), (100.0, 900.0)]
)
def test_one_joint_has_the_closed_form(kp, kd):
    # The loop of a moving Kp is h^2 Kp z/((z - 1)^2 + h Kd (z - 1) + h^2 Kp z). With c = 1 - cos,
    # |den|^2 = (h^2 Kp - (2 - h Kd) c)^2 + (h Kd)^2 (2 c - c^2), a parabola for c in [0, 2].
    arm, law = joint(kp, kd)
    a, b, k = (2.0 - STEP * kd) ** 2 - (STEP * kd) ** 2, 2.0 - STEP * kd, STEP**2 * kp
    slope = (STEP * kd) ** 2 - k * b
    c = np.array([0.0, 2.0, np.clip(-slope / a, 0.0, 2.0)])
    exact = np.sqrt((k**2 + 2.0 * slope * c + a * c**2).min()) / k
    found = certify_gains(arm, law, spread=np.array([[1.0], [0.0], [0.0]]), poses=arm.home)
    assert 0.985 * exact < found.reach < exact
    assert found.high[0, 0] == pytest.approx(kp * (1.0 + found.reach))
    assert found.low[1:, 0] == pytest.approx([0.0, kd])


def test_a_law_with_its_box_is_the_law():
    arm = TWO
    law = dataclasses.replace(
        suggest_gains(arm), safeguards=Safeguards(dead_zone=0.1, sigma=0.01, maximum=1e9)
    )
    found = certify_gains(arm, law, poses=[[0.3, 0.2]])
    guards = found.controller.safeguards
    assert (guards.dead_zone, guards.sigma) == (0.1, 0.01)
    initial = np.stack([law.kp, law.ki, law.kd])
    assert found.low == pytest.approx(initial * (1.0 - found.reach))
    assert np.array_equal(Safeguards.bounds_of(guards, 2), [found.low, found.high])
    assert np.array_equal(found.controller.learning_rate, law.learning_rate)
    assert f"{100.0 * found.reach:.0f} % of the initial ones" in str(found)


def test_unstable_gains_have_no_reach_and_a_gain_that_stands_still_gives_others_room():
    law = suggest_gains(TWO)
    unstable = dataclasses.replace(law, kd=1.5 * gain_ceilings(TWO, law).kd_limit)
    found = certify_gains(TWO, unstable)
    assert found.reach == 0.0
    assert np.array_equal(found.low, found.high)
    spreads = (1.0, [[0.0], [0.0], [1.0]])
    whole, alone = (certify_gains(TWO, law, poses=TWO.home, spread=x).reach for x in spreads)
    assert alone > 1.2 * whole


def test_orders_at_the_ends_have_no_modes_and_are_certified():
    arm = TWO
    law = suggest_gains(arm, integral_order=1.0, derivative_order=1.0)
    near = suggest_gains(arm, integral_order=0.9999, derivative_order=0.9999)
    reaches = [certify_gains(arm, x, poses=arm.home).reach for x in (law, near)]
    assert reaches[0] == pytest.approx(reaches[1], rel=0.01)
