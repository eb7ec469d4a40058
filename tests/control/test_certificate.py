"""Gains may move at any speed within a certified box: judged by sequences, grids, closed forms."""

import contextlib
import dataclasses
import io
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import minimize

import fpid_pin as fp
from fpid_pin.control import Safeguards, certify_gains, gain_ceilings, suggest_gains
from fpid_pin.control.frozen import terms_of
from fpid_pin.control.observed import observer_system, under
from fpid_pin.control.sampled import linear_arm
from fpid_pin.control.scaling import best_scaling
from fpid_pin.control.small_gain import MovingGains
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import ExponentialSum

STEP = 1e-3


def arm_named(name):
    return fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)


def table_of(arm, law):
    gains = np.stack([np.broadcast_to(k, arm.n) for k in (law.kp, law.ki, law.kd)])
    return gains * law.scale_on(arm)


def loop_of(arm, law, q, horizon=3600.0):
    """Return plant and terms, the law's gains left out."""
    plant = linear_arm(arm, q, step=STEP, method="semi_implicit_euler")
    return plant, terms_of(law, arm.n, step=STEP, horizon=horizon)


def on_a_grid(arm, law, q, omega):
    """Return -K0 T P (I + K0 T P)^-1 for each term, (K, 3 n, 3 n), from the open loop's parts."""
    plant, terms = loop_of(arm, law, q)
    z, n = np.exp(1j * omega * STEP), arm.n
    seen, moved = terms.response(z), plant.response(z)  # (K, n, 3, 2) and (K, 2 n, n)
    phi = np.einsum("kjti,kijm->kjtm", seen, moved.reshape(-1, 2, n, n))
    weighed = table_of(arm, law).T[:, :, np.newaxis] * phi
    closed = np.linalg.inv(np.eye(n) + weighed.sum(axis=2))
    whole = -(weighed @ closed[:, np.newaxis]).reshape(len(z), 3 * n, n)
    return np.repeat(whole, 3, axis=2)


def largest(matrices, scaling):
    scaled = scaling[:, np.newaxis] * matrices / scaling
    return np.linalg.norm(scaled, 2, axis=(1, 2)).max()


@pytest.mark.parametrize(("name", "least"), [("two_link", 0.30), ("ur5", 0.27), ("panda", 0.2)])
def test_a_certified_box_keeps_the_scaled_norm_below_one_on_a_dense_grid(name, least):
    arm = arm_named(name)
    law = suggest_gains(arm)
    poses = np.stack([arm.home, arm.home + 0.3])
    found = certify_gains(arm, law, poses=poses)
    assert found.reach == found.reaches.min() > least
    omega = np.geomspace(1e-6, np.pi / STEP, 2000)
    for q, reach in zip(poses, found.reaches, strict=True):
        table = table_of(arm, law)
        plant, terms = loop_of(arm, law, q)
        loop = MovingGains(plant, terms, table, table, step=STEP)
        scaling = best_scaling(loop, loop.response(np.exp(1j * omega[::25] * STEP)))
        grid = on_a_grid(arm, law, q, omega)
        assert reach * largest(grid, scaling) < 1.01  # this scaling is not quite the one used
        assert reach * largest(grid, np.ones(3 * arm.n)) > 1.0  # scaling is what does it


def test_an_observer_counts():
    arm = fp.Arm.two_link()
    law = dataclasses.replace(suggest_gains(arm, adaptive=False), observer=80.0)
    omega = np.geomspace(1e-6, np.pi / STEP, 400)
    z, n, table = np.exp(1j * omega * STEP), arm.n, table_of(arm, law)
    plant, terms = loop_of(arm, law, arm.home)
    observer = observer_system(arm, arm.home, law.observer, STEP)
    loop = MovingGains(under(plant, observer), terms, table, table, step=STEP)
    # u = -W P u + V u_law with the observer's W and V, u_law = delta K0 T [e, e'].
    seen, passed = np.split(observer.response(z), [2 * n], axis=2)
    moved = plant.response(z)
    driven = moved @ np.linalg.solve(np.eye(n) + seen @ moved, passed)
    phi = np.einsum("kjti,kijm->kjtm", terms.response(z), driven.reshape(-1, 2, n, n))
    weighed = table.T[:, :, np.newaxis] * phi
    whole = -weighed @ np.linalg.inv(np.eye(n) + weighed.sum(axis=2))[:, np.newaxis]
    found = loop.response(z)
    assert found == pytest.approx(whole.reshape(found.shape), rel=1e-6, abs=1e-9)
    alone = certify_gains(arm, dataclasses.replace(law, observer=0.0), poses=arm.home)
    assert 0.05 < certify_gains(arm, law, poses=arm.home).reach < alone.reach


def test_twice_as_wide_is_certified_by_no_scaling():
    arm = fp.Arm.two_link()
    law = suggest_gains(arm)
    reach = certify_gains(arm, law, poses=arm.home).reach
    grid = on_a_grid(arm, law, arm.home, np.geomspace(1e-4, np.pi / STEP, 250))
    # The logarithm is convex in ln D: whatever search has the least has the only one.
    best = minimize(
        lambda log_d: np.log(largest(grid, np.exp(log_d))), np.zeros(6), method="Powell",
        options={"maxfev": 4000},
    )  # fmt: skip
    assert reach * np.exp(best.fun) == pytest.approx(0.985, abs=0.015)
    assert 2.0 * reach * np.exp(best.fun) > 1.9


def test_the_bound_on_an_arc_holds_everywhere_on_it():
    rng = np.random.default_rng(4)
    for name in ("two_link", "panda"):
        arm = arm_named(name)
        law = suggest_gains(arm, adaptive=False)
        plant, terms = loop_of(arm, law, arm.home)
        table = table_of(arm, law)
        loop = MovingGains(plant, terms, table, table, step=STEP)
        scaling = np.exp(rng.normal(size=3 * arm.n))
        middle = np.exp(rng.uniform(np.log(1e-7), np.log(np.pi), 60))
        width = middle * np.exp(rng.uniform(np.log(0.01), np.log(0.3), 60))
        at, upper = loop.sizes(middle, width, scaling)
        assert np.isfinite(upper).sum() > 40
        tight = upper[np.isfinite(upper)] / at[np.isfinite(upper)]
        assert np.median(tight) < 1.1
        for k in np.flatnonzero(np.isfinite(upper)):
            omega = (middle[k] + width[k] * np.linspace(-0.5, 0.5, 21)) / STEP
            inside = largest(on_a_grid(arm, law, arm.home, omega), scaling)
            assert inside <= upper[k] * (1.0 + 1e-6)


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


def state_space(arm, law, q, horizon):
    """Return x+ = A x + B u, terms = C x, of arm and operators."""
    plant, terms = loop_of(arm, law, q, horizon)
    whole, n = terms.together, arm.n
    a = np.block([[plant.a, np.zeros((2 * n, len(whole.a)))], [-whole.b, whole.a]])
    b = np.vstack([plant.b, np.zeros((len(whole.a), n))])
    return a, b, np.hstack([-whole.d, whole.c])


@pytest.mark.parametrize(("name", "adversary"), [
    ("two_link", "random"), ("two_link", "slow"), ("two_link", "greedy"), ("ur5", "random"),
    ("ur5", "greedy"),
])  # fmt: skip
def test_no_sequence_of_gains_inside_the_box_is_found_that_blows_up(name, adversary):
    arm, horizon = arm_named(name), 20.0
    law = dataclasses.replace(suggest_gains(arm), design=ExponentialSum(modes=6))
    found = certify_gains(arm, law, horizon=horizon, poses=arm.home)
    assert _driven(arm, law, found.reach, adversary, horizon).max() < 1e-2
    if adversary == "greedy":  # it would find what is there to be found
        assert _driven(arm, law, 3.0 * found.reach, adversary, horizon).max() > 1e2


def _driven(arm, law, reach, adversary, horizon, runs=8, ticks=10000):
    """Return how large arms are after so many ticks, over how they were kicked, (runs,)."""
    a, b, c = state_space(arm, law, arm.home, horizon)
    rng, n, table = np.random.default_rng(7), arm.n, table_of(arm, law).T.reshape(-1)
    fixed = a + b @ (table.reshape(n, 3, 1) * c.reshape(n, 3, -1)).sum(axis=1)
    # What the greedy adversary makes grow: energy to come, were gains fixed.
    weight = np.zeros(len(a))
    weight[: 2 * n] = [1.0] * n + [1e-2] * n
    to_come = solve_discrete_lyapunov(fixed.T, np.diag(weight))
    x = rng.normal(size=(runs, len(a))) * (np.arange(len(a)) < 2 * n)
    start = np.linalg.norm(x[:, : 2 * n], axis=1)
    signs = rng.choice([-1.0, 1.0], size=(runs, 3 * n))
    for _ in range(ticks):
        terms = x @ c.T
        if adversary == "greedy":
            ahead = (x @ fixed.T) @ (to_come @ b)
            signs = np.sign(np.repeat(ahead, 3, axis=1) * terms)
        elif adversary == "random":
            signs = rng.choice([-1.0, 1.0], size=(runs, 3 * n))
        else:
            flips = rng.random((runs, 3 * n)) < 1.0 / rng.integers(20, 2000)
            signs = np.where(flips, -signs, signs)
        torque = (table * (1.0 + reach * signs) * terms).reshape(runs, n, 3).sum(axis=2)
        x = x @ a.T + torque @ b.T
        if np.abs(x).max() > 1e12:
            return np.full(runs, np.inf)
    return np.linalg.norm(x[:, : 2 * n], axis=1) / start


def test_within_the_box_learning_may_be_as_fast_as_it_likes():
    arm = fp.Arm.from_example("ur5")
    law = certify_gains(arm, suggest_gains(arm)).controller
    fast = dataclasses.replace(law, learning_rate=3e4 * np.asarray(law.learning_rate))
    bound = np.stack(Safeguards.bounds_of(fast.safeguards, arm.n))
    still = fp.Experiment(arm, fp.references.Hold(arm.home), duration=10.0)
    run = fp.simulate(still, fast)
    gains = np.stack([run.kp, run.ki, run.kd], axis=1)
    assert (gains >= bound[0]).all()
    assert (gains <= bound[1]).all()
    jumps = np.abs(np.diff(gains, axis=0)) > 0.9 * (bound[1] - bound[0])
    assert jumps.any()  # from one end to the other within a tick
    error = np.abs(run.error).max(axis=1)
    assert error[-1000:].max() < 0.1 * error.max()


def test_a_law_with_its_box_is_the_law():
    arm = fp.Arm.two_link()
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
    arm = fp.Arm.two_link()
    law = suggest_gains(arm)
    unstable = dataclasses.replace(law, kd=1.5 * gain_ceilings(arm, law).kd_limit)
    found = certify_gains(arm, unstable)
    assert found.reach == 0.0
    assert np.array_equal(found.low, found.high)
    whole = certify_gains(arm, law, poses=arm.home).reach
    alone = certify_gains(arm, law, poses=arm.home, spread=[[0.0], [0.0], [1.0]]).reach
    assert alone > 1.2 * whole


def test_orders_at_the_ends_have_no_modes_and_are_certified():
    arm = fp.Arm.two_link()
    law = suggest_gains(arm, integral_order=1.0, derivative_order=1.0)
    near = suggest_gains(arm, integral_order=0.9999, derivative_order=0.9999)
    reaches = [certify_gains(arm, x, poses=arm.home).reach for x in (law, near)]
    assert reaches[0] == pytest.approx(reaches[1], rel=0.01)


def test_the_page_on_gains_prints_what_is_printed():
    page = (Path(__file__).parents[2] / "docs" / "gains.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    names, printed = {}, []
    for language, text in blocks:
        if language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(text, names)
            printed.append(out.getvalue())
    told = [text for language, text in blocks if language == "text"]
    for ours, theirs in zip("".join(printed).splitlines(), "".join(told).splitlines(), strict=True):
        # Where a search ends depends on the last bits of a machine's linear algebra.
        number = re.compile(r"(?<=[ ,])\d+(?:\.\d+)?")
        assert number.split(ours)[0] == number.split(theirs)[0]
        first = [[float(x) for x in number.findall(line)[:2]] for line in (ours, theirs)]
        assert first[0] == pytest.approx(first[1], rel=0.05)


def test_orders_that_adapt_are_certified_by_nothing_here():
    law = dataclasses.replace(suggest_gains(fp.Arm.two_link()), order_learning_rate=0.1)
    with pytest.raises(ArgumentError, match="controller: expected orders that stay"):
        certify_gains(fp.Arm.two_link(), law)


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ({"spread": 0.0}, "spread: expected a gain above 0 that may move, got none"),
        ({"spread": -1.0}, "spread"),
        ({"poses": [[0.0, 0.0, 0.0]]}, r"poses: expected shape \(poses, 2\), got shape \(1, 3\)"),
        ({"step": 0.0}, "step: expected a number > 0"),
    ],
)
def test_bad_arguments_to_certificates_are_named(others, message):
    arm = fp.Arm.two_link()
    with pytest.raises(ArgumentError, match=message):
        certify_gains(arm, suggest_gains(arm), **others)
