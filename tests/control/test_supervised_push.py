"""What the sampled supervisor is asked to reach: pushes, other masses, noise, a UR5.

The bounds are those that were asked for before it was written. V is that of the true state;
V(0) is 0.972 V_M on the two-link arm.
"""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.disturbances import Cosine

# The pushes are three to five times what R gives its word for; see docs/supervisor.md.
pytestmark = pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound:fpid_pin.FpidWarning")
PUSH, CONSTANT = (30.0, 12.0), (40.0, 20.0)
STEPS = [2.5e-4, 1e-3, 2e-3, 4e-3]


def largest(run, guard):
    """Return the largest V over V_M of the true state."""
    state = np.stack([run.error, run.v_ref - run.v], axis=-1)
    v = 0.5 * np.einsum("kja,ab,kjb->k", state, guard.p, state)
    return v.max() / guard.threshold


def two_link(disturbance, step=1e-3, arm=None, **changes):
    plant = fp.Plant(arm=arm, disturbance=disturbance)
    experiment = fp.paper_experiment(duration=4.0, step=step)
    return dataclasses.replace(experiment, plant=plant, **changes)


def supervised(guard):
    return dataclasses.replace(fp.paper_controller(), supervisor=guard)


def variation(run):
    return np.abs(np.diff(run.u_s, axis=0)).sum()


@pytest.mark.parametrize("step", STEPS)
def test_it_keeps_the_set_where_sgn_makes_it_worse_and_the_torque_stays_quiet(step):
    r = fp.Supervisor(3.0, 1.0, disturbance_bound=PUSH)
    f, sgn = fp.Supervisor.quiet(3.0, 1.0), dataclasses.replace(r, kind="paper")
    experiment = two_link(Cosine(PUSH, 1.0), step)
    guards = (r, f, sgn, None)
    run_r, run_f, run_sgn, alone = fp.simulate(experiment, [supervised(g) for g in guards])
    assert largest(alone, r) > 1.9
    assert largest(run_r, r) <= 1.001
    assert largest(run_f, r) <= 0.99
    for run in (run_r, run_f):
        assert variation(run) <= 200.0
        assert np.abs(run.torque).max() <= 75.0
    if step > 2.5e-4:
        assert largest(run_sgn, r) > largest(alone, r)
    assert variation(run_sgn) > 1e5


def test_masses_that_are_wrong_by_a_fifth_do_not_drive_it_out():
    """R must be told: 20 % of the weight (27.4, 7.8) N m is not in a d_u that the push uses up."""
    arms = [fp.Arm.two_link().perturbed(np.random.default_rng(k), mass=0.2) for k in range(12)]
    experiments = [two_link(Cosine(PUSH, 1.0), arm=arm) for arm in arms]
    told = fp.Supervisor(3.0, 1.0, disturbance_bound=np.multiply(1.2, PUSH))
    for guard in (fp.Supervisor.quiet(3.0, 1.0), told):
        runs = fp.simulate(experiments, supervised(guard))
        assert max(largest(run, guard) for run in runs) <= 1.0
    # With the push alone in d_u the word is not kept, nor broken by much.
    guard = fp.Supervisor(3.0, 1.0, disturbance_bound=PUSH)
    runs = fp.simulate(experiments, supervised(guard))
    assert 1.0 < max(largest(run, guard) for run in runs) < 1.002


def test_noisy_speeds_do_not_drive_it_out_if_it_aims_lower():
    """By what the estimate's own error makes of V, three standard deviations (docs)."""
    sensors = fp.Sensors(velocity_noise=0.05)
    experiments = [two_link(Cosine(PUSH, 1.0), sensors=sensors, seed=k) for k in range(8)]
    guard = fp.Supervisor.quiet(3.0, 1.0, lookahead=0.02)
    pole = np.exp(-guard.observer * 1e-3)
    alpha, beta = 1.0 - pole**2, (1.0 - pole) ** 2
    rate = 0.05 * np.sqrt(
        (2.0 * alpha**2 + beta * (2.0 - 3.0 * alpha)) / (alpha * (4.0 - 2.0 * alpha - beta))
    )
    margin = 3.0 * rate * np.sqrt(2.0 * guard.p[1, 1] / guard.threshold)
    lower = dataclasses.replace(guard, target=1.0 - margin)
    assert lower.target == pytest.approx(0.92, abs=0.01)
    runs = fp.simulate(experiments, supervised(lower))
    assert max(largest(run, guard) for run in runs) <= 1.0
    # As it comes it wanders about 0.98 V_M.
    runs = fp.simulate(experiments, supervised(guard))
    assert 1.0 < max(largest(run, guard) for run in runs) < 1.05
