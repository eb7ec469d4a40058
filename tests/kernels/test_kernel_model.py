"""The model's part of a tick as kernels: the same as with Pinocchio."""

import dataclasses

import numpy as np
import pytest
from fpid_pin.export.parts import law_of

import fpid_pin as fp
from fpid_pin.arms.bodies import bodies_of
from fpid_pin.kernels import model, rigid_body

pytestmark = pytest.mark.kernels

STEP = 2e-3
ARM = fp.Arm.two_link()


@pytest.mark.parametrize("name", ["two_link", "ur5"])
def test_mass_and_inverse_dynamics_are_pinocchios(name):
    arm = ARM if name == "two_link" else fp.Arm.from_example(name)
    rng = np.random.default_rng(3)
    bodies, frames = bodies_of(arm.model), np.zeros(arm.n + 1, rigid_body.FRAME)
    gravity = np.array(arm.model.gravity.linear)
    mass, factored = np.zeros((2, arm.n, arm.n))
    bias, out = np.zeros((2, arm.n))
    for _ in range(10):
        q, v, a = rng.normal(size=(3, arm.n))
        model.inverse_dynamics(bodies, frames, gravity, q, v, a, bias, mass, out)
        scale = np.abs(out).max()
        assert np.abs(out - arm.inverse_dynamics(q, v, a)).max() < 1e-12 * scale
        model.mass_times(bodies, mass, a, out)
        assert np.allclose(out, arm.mass_matrix(q) @ a, rtol=1e-11, atol=1e-12)
        kept = mass.copy()
        model.factored_mass(bodies, mass, factored)
        rigid_body.solve_tree(bodies, factored, out)
        assert np.allclose(out, a, rtol=1e-9, atol=1e-10)
        assert np.array_equal(mass, kept)


def ticked(controller, inputs):
    """Return the torques of the kernels of a law, as they are exported."""
    law = law_of(controller, ARM, STEP, 10.0)
    memory, found = law.memory(), []
    for row in inputs:
        memory["inputs"][:, 0] = row
        for call in law.calls:
            call.kernel(*[memory[a] if isinstance(a, str) else a for a in call.arguments])
        found.append(np.ravel(memory["torque"]).copy())
    return np.array(found)


def law(supervisor=None, **others):
    return fp.AdaptiveFpid(
        kp=40.0, ki=20.0, kd=10.0, integral_order=0.9, derivative_order=0.9, learning_rate=1.0,
        design=fp.fractional.ExponentialSum(modes=8), supervisor=supervisor, **others,
    )  # fmt: skip


PAPER = fp.Supervisor(1.3, 1.0, kind="paper", disturbance_bound=0.4)
QUIET = fp.Supervisor.quiet(1.4, 1.0)
LAWS = {
    "nothing but the law": law(),
    "feedforward": law(feedforward=True),
    "observer": law(observer=40.0),
    "both": law(feedforward=True, observer=40.0),
    "paper": law(PAPER),
    "paper, with feedforward": law(PAPER, feedforward=True),
    "paper, observing": law(dataclasses.replace(PAPER, observer=20.0)),
    "quiet": law(QUIET),
    "with a reserve": law(fp.Supervisor(1.2, 1.0, disturbance_bound=5.0, lookahead=0.02)),
    "computed torque": fp.ComputedTorque(k0=50.0, k1=12.0),
}


# "With a reserve" is warned of: its step is too long for so large a disturbance.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.parametrize("limit", [None, 25.0])
@pytest.mark.parametrize("name", LAWS)
def test_a_tick_is_the_one_with_pinocchio(name, limit, monkeypatch):
    arm = ARM if limit is None else ARM.with_limits(effort=limit)
    monkeypatch.setitem(globals(), "ARM", arm.with_friction(viscous=0.3))
    t = STEP * np.arange(60)[:, np.newaxis] * np.array([1.0, 1.3])
    # From no error to one that a supervisor acts on, and back.
    error = 0.5 * np.sin(20.0 * t) ** 2 * np.sin(31.0 * t)
    error[:8] = 0.0
    rate = np.gradient(error, STEP, axis=0)
    q_ref, v_ref, a_ref = np.sin(t), np.cos(t), -np.sin(t)
    inputs = np.stack([q_ref - error, v_ref - rate, q_ref, v_ref, a_ref], axis=1)
    loop = LAWS[name].start(ARM, step=STEP, horizon=10.0)
    expected = np.array([loop.torque(*row) for row in inputs])
    found = ticked(LAWS[name], inputs)
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    if limit is not None:
        assert np.abs(expected).max() == limit
