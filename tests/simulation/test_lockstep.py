"""One loop for any number of runs: the same bits whatever the batching."""

import dataclasses
import os
import sys
import tracemalloc

import numpy as np
import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.costs import MetricCost, QuadraticCost
from fpid_pin.disturbances import Cosine, Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Sinusoid
from fpid_pin.simulation import entry, lockstep


def population(count, duration=0.25):
    """Different orders, gains, plants, disturbances, sensors, starts."""
    rng = np.random.default_rng(7)
    base, arm = fp.paper_experiment(duration=duration), fp.Arm.two_link()
    heavy = [arm.with_payload(float(mass)) for mass in (0.3, 0.8)]
    experiments, controllers = [], []
    for run in range(count):
        plant = fp.Plant(
            arm=[None, *heavy][run % 3],
            disturbance=[None, Cosine((0.4, 0.6)), Pulse((1.0, -1.0), 0.05, 0.1)][run % 3],
            viscous_friction=[None, (0.2, 0.1)][run % 2],
            dry_friction=[None, None, None, (0.5, 0.2)][run % 4],
            effort_limit=[None, (20.0, 8.0)][run % 2],
        )
        sensors = fp.Sensors(velocity_noise=0.05, delay=run % 3) if run % 5 == 0 else None
        experiments.append(
            dataclasses.replace(
                base, arm=arm, plant=plant, sensors=sensors, seed=run, v0=rng.normal(0, 0.3, 2)
            )
        )
        controllers.append(
            dataclasses.replace(
                fp.paper_controller(),
                kp=rng.uniform(5, 30, 2),
                integral_order=rng.uniform(0, 1, 2),
                derivative_order=rng.choice([0.0, 1.0, *rng.uniform(0, 1, 6)], 2),
            )
        )
    return experiments, controllers


def same(first, second):
    names = ("q", "v", "torque", "kp", "ki", "kd", "s", "lyapunov", "u_s")
    return all((getattr(first, n) == getattr(second, n)).all() for n in names)


@pytest.mark.parametrize("chunk", [1, 3, 17, 60])
def test_a_population_gives_the_same_bits_in_any_chunks(chunk, monkeypatch):
    experiments, controllers = population(64)
    whole = fp.simulate(experiments, controllers)
    monkeypatch.setattr(entry, "MOST_RUNS", chunk)
    for run, alone in zip(whole, fp.simulate(experiments, controllers), strict=True):
        assert same(run, alone)


def test_costs_are_the_same_bits_in_any_chunks_and_are_those_of_the_record(monkeypatch):
    experiments, controllers = population(12)
    costs = [QuadraticCost(), MetricCost("total_variation")]
    whole = fp.evaluate(experiments, controllers, costs)
    recorded = [
        [cost.of(run.metrics) for cost in costs] for run in fp.simulate(experiments, controllers)
    ]
    assert (whole == recorded).all()
    for chunk in (1, 5):
        monkeypatch.setattr(entry, "MOST_RUNS", chunk)
        assert (fp.evaluate(experiments, controllers, costs) == whole).all()


def test_a_one_joint_arm_alone_has_the_bits_of_one_in_company():
    arm = fp.Arm.planar([1.0], [1.0])
    experiment = fp.Experiment(arm, Sinusoid(0.5), duration=0.3)
    controllers = [
        fp.AdaptiveFpid(kp=kp, ki=5.0, kd=4.0, integral_order=0.7, derivative_order=0.8)
        for kp in (5.0, 10.0, 20.0)
    ]
    together = fp.simulate(experiment, controllers)
    for run, controller in zip(together, controllers, strict=True):
        alone = fp.simulate(experiment, controller)
        assert same(run, alone)
    assert (
        fp.evaluate(experiment, controllers) == [fp.evaluate(experiment, c)[0] for c in controllers]
    ).all()


def test_kinds_of_controllers_and_experiments_may_be_mixed():
    base = fp.paper_experiment(duration=0.1)
    longer = dataclasses.replace(base, duration=0.2)
    controllers = [
        fp.paper_controller(),
        fp.ComputedTorque(),
        fp.paper_controller("integer", supervised=False),
    ]
    runs = fp.simulate([base, longer, base], controllers)
    assert [len(run.t) for run in runs] == [101, 201, 101]
    for run, e, c in zip(runs, [base, longer, base], controllers, strict=True):
        assert (run.q == fp.simulate(e, c).q).all()


def test_equal_arms_built_apart_share_a_call():
    experiments = [fp.paper_experiment(duration=0.1) for _ in range(3)]
    assert len({id(e.arm) for e in experiments}) == 3
    controllers = [fp.paper_controller(o) for o in ("symbol", "sign", "integer")]
    assert lockstep.batches(experiments, controllers, 240) == [[0, 1, 2]]
    heavy = dataclasses.replace(experiments[0], arm=experiments[0].arm.with_payload(1.0))
    assert len(lockstep.batches([*experiments[:2], heavy], controllers, 240)) == 2


def test_designs_are_told_apart_by_what_they_are():
    base, designs = fp.paper_controller(), fp.fractional
    laws = [
        dataclasses.replace(base, design=design)
        for design in (
            designs.ExponentialSum(24), designs.ExponentialSum(24), designs.ExponentialSum(32),
            designs.Crone(), designs.Crone(n=6),
        )
    ]  # fmt: skip
    experiments = [fp.paper_experiment(duration=0.1)] * 5
    assert lockstep.batches(experiments, laws, 240) == [[0, 1], [2], [3], [4]]


def test_numbers_that_do_not_match_are_refused():
    experiment, controller = fp.paper_experiment(duration=0.1), fp.paper_controller()
    with pytest.raises(ArgumentError, match="equal numbers, or one of either, got 2 and 3"):
        fp.simulate([experiment] * 2, [controller] * 3)
    with pytest.raises(ArgumentError, match="experiment: expected an Experiment, got str"):
        fp.simulate(["x"], controller)


def test_progress_ends_at_one_and_never_goes_back():
    told = []
    experiments, controllers = population(6, duration=0.3)
    fp.simulate(experiments, controllers, progress=told.append)
    parts = [progress.part for progress in told]
    assert parts == sorted(parts)
    assert parts[-1] == pytest.approx(1.0)


def test_a_second_order_reference_is_followed_as_computed_torque_predicts():
    """On the exact model e'' + k1 e' + k0 e = 0; RK4 with a held torque comes near at 0.1 ms."""
    k0, k1 = 25.0, 10.0
    experiment = dataclasses.replace(
        fp.paper_experiment(duration=1.0, step=1e-4), plant=None, integrator="rk4"
    )
    run = fp.simulate(experiment, fp.ComputedTorque(k0, k1))
    e0, rate0 = run.error[0], (run.v_ref - run.v)[0]
    t = run.t[:, np.newaxis]
    exact = (e0 + (rate0 + 5.0 * e0) * t) * np.exp(-5.0 * t)  # a double root at -5
    assert np.abs(run.error - exact).max() < 1e-3


def test_the_memory_of_a_cost_does_not_grow_with_the_horizon():
    peaks = []
    for duration in (0.5, 3.0):
        experiment = fp.paper_experiment(duration=duration)
        fp.evaluate(dataclasses.replace(experiment, duration=0.1), fp.paper_controller())
        tracemalloc.start()
        fp.evaluate(experiment, fp.paper_controller())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


COLD = """
from concurrent.futures import Executor, Future
import fpid_pin as fp

class Watched(Executor):
    _max_workers = 2

    def submit(self, function, *arguments):
        from fpid_pin.kernels import compiled
        names = {path.name.split("-")[0] for path in compiled.CACHE.rglob("*.nbc")}
        print(sorted(names & {"law.fpids", "metrics.tally", "motion.euler"}))
        future = Future()
        future.set_result(function(*arguments))
        return future

fp.evaluate(fp.paper_experiment(duration=0.01), [fp.paper_controller()] * 2, executor=Watched())
"""


def test_workers_find_the_kernels_compiled(tmp_path):
    """Cold ones would each compile all of them, at the same time."""
    done = finished(
        [sys.executable, "-c", COLD],
        check=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    )
    assert done.stdout.splitlines() == ["['law.fpids', 'metrics.tally', 'motion.euler']"] * 2
