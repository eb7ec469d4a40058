"""The engine: Pinocchio's motion from compiled dynamics, and the same bits however it is called."""

import dataclasses
import threading
import tracemalloc
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bounded import FULL
from own_laws import PythonPd

import fpid_pin as fp
from fpid_pin.costs import (
    BLOCK_ROWS,
    METRICS,
    FromRows,
    MetricCost,
    QuadraticCost,
    SettlingCost,
    ToolCost,
)
from fpid_pin.disturbances import Cosine, Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Sinusoid
from fpid_pin.simulation import cost_of, entry
from fpid_pin.simulation.engine import Simulation
from fpid_pin.simulation.workers import WorkerPool, executor_of

ARM = fp.Arm.two_link()
PAPER = fp.paper_experiment(duration=0.25)
COMPILED = dataclasses.replace(PAPER, dynamics="compiled")
FPID = fp.paper_controller()
#: All sensors' faults at once; noise is drawn for a block of rows.
SENSORS = fp.Sensors(
    position_noise=1e-4, velocity_noise=0.05, delay=2, velocity="differentiated",
    position_resolution=1e-4,
)  # fmt: skip


def assert_same(first, second):
    assert first.outcome == second.outcome
    for name in ("t", "q", "v", "q_ref", "v_ref", "torque", *first.signals):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


# ---------------------------------------------------------------------- the motion


#: All of them in `make torture`.
NAMES = fp.arms.names() if FULL else ("kinova", "panda", "talos_arm", "so100", "xarm7")


@pytest.mark.parametrize("name", ["two_link", "planar, 30 joints", *NAMES])
def test_compiled_dynamics_are_pinocchios_on_every_arm(name):
    """Under friction, dry too, and with a payload: found over 2 s at most 2e-14 rad."""
    made = {"two_link": ARM, "planar, 30 joints": fp.Arm.planar(np.full(30, 0.1), np.full(30, 0.2))}
    arm = made.get(name) or fp.Arm.from_example(name)
    inertia = np.diag(arm.mass_matrix(arm.home))
    mass = sum(body.mass for body in list(arm.model.inertias)[1:])
    plant = fp.Plant(
        arm.with_payload(0.01 * mass, (0.0, 0.0, 0.01)), viscous_friction=inertia,
        dry_friction=inertia, effort_limit=np.inf,
    )  # fmt: skip
    experiment = fp.Experiment(
        arm.with_limits(effort=np.inf), Sinusoid(0.2, 2.0, offset=arm.home), q0=arm.home,
        plant=plant, duration=2.0,
    )  # fmt: skip
    law = fp.ComputedTorque(100.0, 20.0, ki=100.0)
    runs = []
    for dynamics in ("compiled", "pinocchio"):
        with warnings.catch_warnings():
            # Drives too weak for the pose are what the arm's file says; this plant's have no limit.
            warnings.simplefilter("ignore", fp.FpidWarning)
            runs.append(fp.simulate(dataclasses.replace(experiment, dynamics=dynamics), law))
    assert runs[0].outcome.completed
    assert np.ptp(runs[0].q, axis=0).min() > 0.05
    assert (runs[0].v == 0.0).mean() > 0.005
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-12


def test_dynamics_are_pinocchios_where_runs_are_recorded_and_compiled_where_they_are_compared():
    recorded = fp.simulate(PAPER, FPID)
    assert recorded.meta["experiment"]["dynamics"] == "pinocchio"
    assert_same(recorded, fp.simulate(PAPER.with_dynamics("pinocchio"), FPID))
    compiled = fp.simulate(COMPILED, FPID)
    assert compiled.meta["experiment"]["dynamics"] == "compiled"
    assert fp.evaluate(PAPER, FPID)[0] == QuadraticCost().of(compiled.metrics)
    with pytest.raises(ArgumentError, match=r"dynamics: .* \(did you mean compiled\?\)"):
        dataclasses.replace(PAPER, dynamics="compile")


# ---------------------------------------------------------------------- the same bits


def population(count, duration=0.25):
    """Different laws, designs, gains, plants, disturbances, sensors, starts."""
    rng = np.random.default_rng(7)
    heavy = [ARM.with_payload(float(mass)) for mass in (0.3, 0.8)]
    others = [
        fp.ComputedTorque(50.0, 10.0), fp.SlotineLi(5.0, 10.0), fp.Pid(40.0, 10.0, 8.0),
        dataclasses.replace(FPID, design=fp.fractional.Crone()),
        dataclasses.replace(FPID, order_learning_rate=0.1),
    ]  # fmt: skip
    experiments, controllers = [], []
    for run in range(count):
        plant = fp.Plant(
            arm=[None, *heavy][run % 3],
            disturbance=[None, Cosine((0.4, 0.6)), Pulse((1.0, -1.0), 0.05, 0.1)][run % 3],
            viscous_friction=[None, (0.2, 0.1)][run % 2],
            dry_friction=[None, None, None, (0.5, 0.2)][run % 4],
            effort_limit=[None, (30.0, 8.0)][run % 2],
        )
        experiments.append(
            dataclasses.replace(
                COMPILED, arm=ARM, plant=plant, sensors=SENSORS if run % 5 == 0 else None,
                seed=run, v0=rng.normal(0, 0.3, 2), duration=duration * (1 + run % 2),
            )
        )  # fmt: skip
        fpid = dataclasses.replace(
            FPID, kp=rng.uniform(5, 30, 2), integral_order=rng.uniform(0, 1, 2),
            derivative_order=rng.choice([0.0, 1.0, *rng.uniform(0, 1, 6)], 2),
        )  # fmt: skip
        controllers.append(others[run // 3 % 5] if run % 3 == 0 else fpid)
    return experiments, controllers


COSTS = [
    QuadraticCost(), MetricCost("rms", joints="worst"), SettlingCost(), ToolCost()
]  # fmt: skip


def test_a_run_has_the_same_bits_alone_in_company_and_with_any_number_of_threads(monkeypatch):
    experiments, controllers = population(15)
    together = fp.simulate(experiments, controllers)
    for k, run in enumerate(together):
        assert_same(run, fp.simulate(experiments[k], controllers[k]))
    costs = fp.evaluate(experiments, controllers, COSTS)
    recorded = [[cost_of(run, cost) for cost in COSTS] for run in together]
    assert np.array_equal(costs, recorded)
    assert np.isfinite(costs).all()
    for workers in (1, 2, 5):
        assert np.array_equal(fp.evaluate(experiments, controllers, COSTS, workers=workers), costs)
    for most in (1, 5):
        monkeypatch.setattr(entry, "PART", most)
        assert np.array_equal(fp.evaluate(experiments, controllers, COSTS), costs)
        with ThreadPoolExecutor(3) as pool:
            other = fp.evaluate(experiments, controllers, COSTS, executor=pool)
        assert np.array_equal(other, costs)


@pytest.mark.parametrize("dynamics", ["compiled", "pinocchio"])
def test_a_run_has_the_same_bits_in_blocks_of_any_size(dynamics, monkeypatch):
    experiments, controllers = population(6, duration=0.15)
    if dynamics == "compiled":  # beyond a block of noise
        duration = 1.05 * BLOCK_ROWS * 1e-3
        experiments[5] = dataclasses.replace(experiments[5], duration=duration)
    experiments = [dataclasses.replace(e, dynamics=dynamics) for e in experiments]
    assert experiments[5].sensors is not None
    whole = fp.simulate(experiments, controllers)
    costs = fp.evaluate(experiments, controllers, COSTS)
    for rows in (64, 2048):
        monkeypatch.setattr(entry, "BLOCK_ROWS", rows)
        for run, other in zip(whole, fp.simulate(experiments, controllers), strict=True):
            assert_same(run, other)
        # A cost of its own adds up what a block comes to.
        found = fp.evaluate(experiments, controllers, COSTS)
        assert np.array_equal(found[:, :3], costs[:, :3])
        assert found == pytest.approx(costs, rel=1e-13)


@pytest.mark.parametrize(
    ("orders", "short", "long", "dynamics"),
    [("symbol", 1.0, 2.0, "pinocchio"), ("symbol", 5.0, 20.0, "compiled"),
     ("sign", 0.01, 20.0, "compiled"), ("integer", 1.0, 2.0, "compiled")],
)  # fmt: skip
def test_two_durations_agree_to_the_bit_where_both_run(orders, short, long, dynamics):
    """How long a run is must not be felt before it ends: one fit of the operator up to 20 s."""
    law = fp.paper_controller(orders)
    one, other = (
        fp.simulate(fp.paper_experiment(duration=d).with_dynamics(dynamics), law)
        for d in (short, long)
    )
    rows = len(one.t)
    assert rows == round(short / one.step) + 1
    for name in ("t", "q", "v", "torque", *one.signals):
        assert np.array_equal(getattr(one, name), getattr(other, name)[:rows]), name


def test_a_simulation_tick_by_tick_has_the_bits_of_a_run():
    """Across the end of a block of noise; `horizon` is the longest that it may go on."""
    experiment = dataclasses.replace(COMPILED, sensors=SENSORS, duration=0.2, seed=4)
    count = BLOCK_ROWS + 200
    run = fp.simulate(dataclasses.replace(experiment, duration=(count - 1) * 1e-3), FPID)
    simulation = Simulation(experiment, FPID, horizon=20.0)
    robot, rows = simulation.robot, []
    for k in range(count):
        assert simulation.t == k * 1e-3
        q, v = robot.q.copy(), robot.v.copy()
        simulation.tick()
        rows.append((q, v, robot.torque.copy(), simulation.q_ref.copy()))
    for name, column in zip(("q", "v", "torque", "q_ref"), zip(*rows, strict=True), strict=True):
        assert np.array_equal(getattr(run, name), np.array(column)), name


def test_a_push_is_a_disturbance_of_so_many_ticks():
    push = Pulse((0.0, 7.0), 0.0995, 0.1495)
    experiment = dataclasses.replace(COMPILED, plant=fp.Plant(viscous_friction=0.2))
    pushed = dataclasses.replace(
        experiment,
        plant=fp.Plant(viscous_friction=0.2, disturbance=push),
    )
    run = fp.simulate(pushed, FPID)
    quiet = fp.simulate(experiment, FPID)
    simulation, rows = Simulation(experiment, FPID), []
    for k in range(len(run.t)):
        if k == 100:
            simulation.push("joint2", 7.0, 0.05)
        rows.append(simulation.robot.q.copy())
        simulation.tick()
    assert np.abs(run.q - quiet.q).max() > 1e-3
    assert np.abs(run.q - np.array(rows)).max() < 1e-12
    with pytest.raises(ArgumentError, match="duration: expected a number > 0"):
        simulation.push(0, 1.0, 0.0)


# ---------------------------------------------------------------------- what is measured


class Late:
    """A disturbance that is no number from the last row on."""

    def sample(self, t):
        return np.where(t[:, np.newaxis] >= PAPER.duration - 1e-9, np.nan, [0.4, 0.6])


@pytest.mark.parametrize("dynamics", ["compiled", "pinocchio"])
def test_the_last_torque_is_recorded_and_neither_applied_nor_counted(dynamics):
    experiment = dataclasses.replace(PAPER, dynamics=dynamics, plant=fp.Plant(disturbance=Late()))
    run = fp.simulate(experiment, FPID)
    assert str(run.outcome) == "completed at 0.25 s"
    assert len(run.t) == run.planned_rows == 251
    assert np.isfinite(run.torque).all()
    steady = dataclasses.replace(experiment, plant=fp.Plant(disturbance=Cosine((0.4, 0.6), 0.0)))
    assert_same(run, fp.simulate(steady, FPID))
    assert run.metrics.peak_torque == pytest.approx(np.abs(run.torque[:-1]).max(axis=0))
    assert fp.evaluate(experiment, FPID) == fp.evaluate(steady, FPID)


def test_metrics_are_what_they_say():
    run = fp.simulate(dataclasses.replace(COMPILED, duration=1.5), FPID)
    h, m = 1e-3, run.metrics
    e, u, t = run.error[:-1], run.torque[:-1], run.t[:-1, np.newaxis]
    expected = {
        "ise": h * (e**2).sum(0),
        "iae": h * np.abs(e).sum(0),
        "itae": h * (t * np.abs(e)).sum(0),
        "rms": np.sqrt((e**2).mean(0)),
        "rms_tail": np.sqrt((e[750:] ** 2).mean(0)),
        "energy": h * (u**2).sum(0),
        "total_variation": np.abs(np.diff(u, axis=0)).sum(0),
        "peak_torque": np.abs(u).max(0),
        "peak_error": np.abs(e).max(0),
        "torque_rate": np.sqrt((np.diff(u, axis=0) ** 2).mean(0)) / h,
    }
    for name, value in expected.items():
        assert getattr(m, name) == pytest.approx(value, rel=1e-12), name
    cost = QuadraticCost(w1=2.0, w2=1e-3, joint_weights=(1.0, 3.0))
    assert cost.of(m) == pytest.approx(((2 * m.ise + 1e-3 * m.energy) * [1.0, 3.0]).sum())


def add_u_s(total, rows):
    assert len(rows.t) == len(rows.q) == len(rows.signals["u_fpid"])
    return total + float(np.abs(rows.signals["u_fpid"]).sum()) + rows.t[0]


@pytest.mark.parametrize("plant", [None, fp.Plant(effort_limit=(25.0, 7.0))])
def test_costs_and_metrics_while_running_have_the_bits_of_the_record(plant):
    """Over more than one block; of every metric, and of rows that stream by."""
    experiment = dataclasses.replace(COMPILED, plant=plant, duration=1.1 * BLOCK_ROWS * 1e-3)
    costs = [*map(MetricCost, METRICS), ToolCost(), FromRows(0.0, add_u_s, None, "u_fpid")]
    run = fp.simulate(experiment, FPID)
    streamed = fp.evaluate(experiment, [FPID], costs)[0]
    assert np.array_equal(streamed, [cost_of(run, cost) for cost in costs])
    assert (run.metrics.saturated > 0.0).all() == (plant is not None)
    with pytest.raises(ArgumentError, match=r"cost.signals: expected signals of the law .* got x"):
        fp.evaluate(experiment, FPID, FromRows(0.0, add_u_s, None, "x"))


# ---------------------------------------------------------------------- the way in


def test_a_run_has_whole_steps_and_one_at_least():
    for duration, step in ((1.0, 0.0), (1.0, -1.0), (1e-4, 1e-3), (0.0, 1.0)):
        with pytest.raises(ArgumentError, match="step|duration"):
            fp.paper_experiment(duration=duration, step=step)
    for duration, step, rows in ((20.0, 1e-3, 20001), (1e-3, 1e-3, 2), (0.3, 0.1, 4)):
        assert fp.paper_experiment(duration=duration, step=step).rows == rows


def test_progress_ends_at_one_and_never_goes_back(monkeypatch):
    told = []
    experiments, controllers = population(6, duration=0.3)
    fp.simulate(experiments, controllers, progress=told.append)
    fractions = [progress.part for progress in told]
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)
    told.clear()
    monkeypatch.setattr(entry, "PART", 4)
    short = dataclasses.replace(COMPILED, duration=0.01)
    fp.evaluate(short, [FPID] * 12, workers=1, progress=told.append)
    assert [progress.part for progress in told] == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_the_memory_of_a_cost_does_not_grow_with_the_horizon():
    peaks = []
    for duration in (9.0, 20.0):
        experiment = fp.paper_experiment(duration=duration)
        fp.evaluate(dataclasses.replace(experiment, duration=0.1), FPID)
        tracemalloc.start()
        fp.evaluate(experiment, FPID)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_threads_do_compiled_work_and_processes_what_holds_the_lock():
    for experiment, law, threads in (
        (PAPER, FPID, True), (PAPER.with_dynamics("pinocchio"), FPID, False),
        (PAPER, PythonPd(60.0, 12.0), False),
    ):  # fmt: skip
        with executor_of(None, 1, [experiment, PAPER], [FPID, law]) as pool:
            assert isinstance(pool, ThreadPoolExecutor) == threads
            assert isinstance(pool, WorkerPool) != threads
    with executor_of(None, None, [PAPER], [FPID]) as pool:
        assert pool is None
    with pytest.raises(ArgumentError, match="workers or executor, not both"):
        fp.evaluate(PAPER, FPID, executor=ThreadPoolExecutor(1), workers=1)


def test_after_a_fault_no_thread_begins_anything_more():
    begun, first, before = [], threading.current_thread(), threading.active_count()

    def fail(state, rows):
        if threading.current_thread() is not first:  # the warm-up's runs are here
            begun.append(1)
            raise KeyboardInterrupt
        return state

    short = dataclasses.replace(PAPER, duration=0.05)
    with pytest.raises(KeyboardInterrupt):
        fp.evaluate(short, [FPID] * (20 * entry.PART), FromRows(0.0, fail), workers=2)
    assert len(begun) < 20
    assert threading.active_count() <= before
