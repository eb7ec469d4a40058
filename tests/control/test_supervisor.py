"""The paper's supervisor: its promises, checked on the plant's own dynamics."""

import dataclasses
import functools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import lyapunov_matrix
from fpid_pin.disturbances import Cosine


def supervisor(**changes):
    values = {
        "kind": "paper",
        "m_x": 5.0,
        "reference_bound": 1.0,
        "disturbance_bound": (0.4, 0.6),
        "gravity_bound": (27.44, 7.84),
    }
    return fp.Supervisor(**(values | changes))


def test_p_is_the_paper_s():
    assert np.abs(lyapunov_matrix(0.5, 1.0) - [[1.75, 1.0], [1.0, 1.5]]).max() < 1e-14


@pytest.mark.parametrize(("k0", "k1"), [(0.5, 1.0), (4.0, 0.3), (100.0, 20.0)])
def test_p_solves_the_lyapunov_equation(k0, k1):
    weight = np.array([[2.0, 0.5], [0.5, 3.0]])
    p, a = lyapunov_matrix(k0, k1, weight), np.array([[0.0, 1.0], [-k0, -k1]])
    assert np.abs(a.T @ p + p @ a + weight).max() < 1e-12 * np.abs(p).max() * (1 + k0)
    assert np.linalg.eigvalsh(p)[0] > 0


def test_the_threshold_is_equation_16():
    smallest = (3.25 - np.sqrt(0.25**2 + 4.0)) / 2.0
    assert supervisor().threshold == pytest.approx(0.5 * smallest * 16.0, rel=1e-12)


def test_it_is_silent_in_the_paper_s_experiment():
    run = fp.simulate(fp.paper_experiment(), fp.paper_controller())
    assert run.lyapunov.max() < supervisor().threshold
    assert (run.u_s == 0.0).all()
    alone = fp.simulate(fp.paper_experiment(), fp.paper_controller(supervised=False))
    assert (run.torque == alone.torque).all()


# A push that is announced to the supervisor; that without it V leaves the set, and for how long a
# step it does with it, is in test_sampled_supervisor.py.
PUSH = (30.0, 12.0)


@functools.cache
def pushed(gravity_bound=None):
    experiment = dataclasses.replace(
        fp.paper_experiment(duration=3.0, step=2.5e-4),
        plant=fp.Plant(disturbance=Cosine(amplitude=PUSH, frequency=1.0)),
    )
    guard = supervisor(m_x=3.0, disturbance_bound=PUSH, gravity_bound=gravity_bound)
    controller = dataclasses.replace(fp.paper_controller(), supervisor=guard)
    return experiment, fp.simulate(experiment, controller)


@pytest.mark.parametrize("gravity_bound", [(27.44, 7.84), None])
def test_the_bound_on_the_derivative_of_v_holds_wherever_it_acts(gravity_bound):
    experiment, run = pushed(gravity_bound)
    state, p = np.stack([run.error, run.v_ref - run.v], axis=-1), [[1.75, 1.0], [1.0, 1.5]]
    v = 0.5 * np.einsum("kja,ab,kjb->k", state, p, state)  # (14)
    assert np.abs(run.lyapunov - v).max() < 1e-12 * v.max()
    acting = np.flatnonzero((run.u_s != 0.0).any(axis=1))
    assert len(acting) > 50
    for k in acting:
        t = run.t[k]
        d = np.array(PUSH) * np.cos(t)
        a = experiment.arm.forward_dynamics(run.q[k], run.v[k], run.torque[k] + d)
        rates = np.stack([state[k, :, 1], -np.sin(t) - a], axis=-1)
        derivative = np.einsum("ja,ab,jb->", state[k], p, rates)
        bound = -0.5 * np.sum(state[k] ** 2)
        assert derivative <= bound + 1e-9 * abs(derivative)


def test_gains_and_integrals_stand_still_while_it_acts():
    _, run = pushed()
    acting = (run.u_s != 0.0).any(axis=1)
    assert acting.any()
    for gains in (run.kp, run.ki, run.kd):
        changes = np.diff(gains, axis=0)
        assert (changes[acting[:-1]] == 0.0).all()
    # int e, recovered from S, is held as well: the next row's is the same.
    e, rate = run.error, run.v_ref - run.v
    integral = -run.s - rate - 2.0 * e
    held = np.flatnonzero(acting[1:]) + 1
    assert np.abs(integral[held] - integral[held - 1]).max() < 1e-12
