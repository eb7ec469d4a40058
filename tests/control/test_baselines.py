"""The controllers to beat: against closed forms, each other and the arm's own matrices."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.arms.bodies import bodies_of, inertial_numbers
from fpid_pin.control import SlidingMode, SlotineLi
from fpid_pin.control.slotine_li import natural_sizes
from fpid_pin.references import Sinusoid


@pytest.mark.parametrize(("k0", "k1"), [(25.0, 6.0), (9.0, 6.0)])
def test_computed_torque_on_the_exact_model_obeys_the_error_equation(k0, k1):
    arm = fp.Arm.two_link()
    experiment = fp.Experiment(
        arm=arm, reference=Sinusoid((0.8, 0.6)), q0=(0.3, -0.4), v0=(0.8, 0.6),
        step=5e-4, duration=1.5, integrator="rk4",
    )  # fmt: skip
    run = fp.simulate(experiment, fp.ComputedTorque(k0=k0, k1=k1))
    roots = np.roots([1.0, k1, k0]).astype(complex)
    if abs(roots[0] - roots[1]) < 1e-6:
        shape = (1.0 - roots[0] * run.t) * np.exp(roots[0] * run.t)
    else:
        shape = roots[1] * np.exp(roots[0] * run.t) - roots[0] * np.exp(roots[1] * run.t)
        shape /= roots[1] - roots[0]
    expected = np.outer(shape.real, run.error[0])
    assert np.abs(run.error - expected).max() < 1e-3 * np.abs(run.error[0]).max()


def test_sliding_mode_reaches_its_layer_and_stays_within_in_spite_of_a_payload():
    arm = fp.Arm.two_link()
    law = SlidingMode(slope=5.0, gain=(60.0, 30.0), boundary_layer=0.2)
    experiment = fp.Experiment(
        arm=arm, reference=Sinusoid(0.6), q0=(0.3, -0.3),
        plant=fp.Plant(arm=arm.with_payload(0.3)), duration=4.0,
    )  # fmt: skip
    run = fp.simulate(experiment, law)
    assert np.abs(run.s[0]).max() > 0.2
    assert np.abs(run.s[1000:]).max() < 0.2
    # Within the layer |e| <= layer/slope: e' + slope e = -S is a low-pass filter.
    assert np.abs(run.error[2500:]).max() < 0.2 / 5.0


def test_slotine_li_lyapunov_function_does_not_rise():
    arm = fp.Arm.two_link()
    law = SlotineLi(slope=5.0, damping=20.0, adaptation_rate=4.0, initial=0.5, friction=False)
    step = 5e-4
    loop = law.start(arm, step=step, horizon=10.0)
    mass, reach, _ = natural_sizes(arm)
    sizes = np.stack([mass, *3 * [mass * reach], *6 * [mass * reach**2]], axis=1)
    names = ["m", "h0", "h1", "h2", "j00", "j01", "j02", "j11", "j12", "j22"]
    q, v = np.array([0.3, -0.2]), np.zeros(2)
    values = []
    for k in range(1500):
        t = k * step
        torque = loop.torque(q, v, *np.outer([np.sin(t), np.cos(t), -np.sin(t)], np.ones(2)))
        estimates = np.stack([loop.state.joints[f"{name}_hat"] for name in names], axis=1)
        s = loop.signals()["s"]
        wrong = (estimates - inertial_numbers(bodies_of(arm))) / sizes
        values.append(0.5 * s @ arm.mass_matrix(q) @ s + 0.5 * (wrong**2).sum() / 4.0)
        v = v + step * arm.forward_dynamics(q, v, torque)
        q = q + step * v
    # In continuous time V' = -S^T K_D S; a step of h adds terms of the order of h.
    assert np.diff(values).max() < 5e-4 * values[0]
    assert values[-1] < 0.95 * values[0]
