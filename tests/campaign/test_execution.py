"""Campaigns are carried out: the same bits however, faults named, runs shown again."""

import csv
import dataclasses
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from studies import Deadly, Faulty, bits, pushed, study

import fpid_pin as fp
from fpid_pin.campaign import Normal, Scenarios, Study, Uniform, attack, export, load, replay, run
from fpid_pin.campaign.data import METRICS
from fpid_pin.exceptions import ArgumentError, FileFormatError, SimulationError, WorkersDied
from fpid_pin.simulation.workers import AHEAD, distribute

RUNS = 24


@pytest.fixture(scope="module")
def ledger(tmp_path_factory):
    return tmp_path_factory.mktemp("alone") / "ledger.sqlite"


@pytest.fixture(scope="module")
def alone(ledger):
    """Return what a campaign finds in this process, in chunks of 64."""
    return run(study(), ledger, RUNS)


@pytest.fixture(scope="module")
def pool():
    with fp.tuning.WorkerPool(2) as made:
        yield made


def test_a_run_is_what_simulate_says(alone):
    made = study()
    for number in (0, 23):
        experiment = made.experiment_of(number, made.samples(number, number + 1)[0])
        for column, law in enumerate(made.controllers.values()):
            m = fp.simulate(experiment, law).metrics
            expected = {
                "rms": np.sqrt(np.mean(m.rms**2)), "rms_tail": np.sqrt(np.mean(m.rms_tail**2)),
                "energy": m.energy.sum(), "peak_torque": m.peak_torque.max(),
                "total_variation": m.total_variation.sum(),
            }  # fmt: skip
            figures = {name: alone.metrics[name][number, column] for name in expected}
            assert figures == pytest.approx(expected, rel=1e-14)


def test_chunks_threads_and_processes_change_no_bit(alone, pool, tmp_path):
    with ThreadPoolExecutor(3) as threads:
        for k, options in enumerate(
            ({"chunk": 1}, {"executor": threads, "chunk": 5}, {"executor": pool, "chunk": 11})
        ):
            assert bits(run(study(), tmp_path / f"{k}.sqlite", RUNS, **options)) == bits(alone)


def test_going_on_to_more_runs_keeps_the_first(alone, tmp_path):
    ledger = tmp_path / "l.sqlite"
    run(study(), ledger, 13)
    first = load(ledger)
    assert first.runs == 13
    assert bits(run(study(), ledger, RUNS, chunk=8)) == bits(alone)
    # Fewer than there are: they stay.
    assert bits(run(study(), ledger, 3)) == bits(alone)
    assert first.samples.tobytes() == alone.samples[:13].tobytes()


def test_the_window_is_bounded_and_no_result_is_kept():
    class Counting(Executor):
        _max_workers = 3
        under_way = most = 0

        def submit(self, call, /, *arguments):
            self.under_way += 1
            self.most = max(self.most, self.under_way)
            future = Future()
            future.set_result(call(*arguments))
            return future

    executor, found = Counting(), {}
    for k, result in distribute(divmod, [(k, 7) for k in range(40)], executor):
        executor.under_way -= 1
        found[k] = result
    assert executor.most == 3 * AHEAD
    assert found == {k: divmod(k, 7) for k in range(40)}


def test_runs_that_kill_their_worker_twice_are_named_and_what_there_is_stays(
    alone, tmp_path, monkeypatch
):
    made = pushed(Deadly(amplitude=0.5))
    made = dataclasses.replace(made, controllers={"one": fp.PdGravity(kp=50.0, kd=10.0)})
    amplitudes = made.samples(0, 4)[:, 0]
    worst, deaths = int(np.argmax(amplitudes)), tmp_path / "deaths"
    deaths.mkdir()
    monkeypatch.setenv("DEADLY", str(np.sort(amplitudes)[-2]))
    monkeypatch.setenv("DEATHS", str(deaths))
    words = rf"runs {worst} to {worst}: workers: expected processes that live"
    with fp.tuning.WorkerPool(1) as processes, pytest.raises(WorkersDied, match=words):
        run(made, tmp_path / "l.sqlite", 4, executor=processes, chunk=1)
    # Once in company, once by itself.
    assert len(list(deaths.iterdir())) == 2
    monkeypatch.setenv("DEADLY", "inf")
    data = run(made, tmp_path / "l.sqlite", 4)
    assert bits(data) == bits(run(made, tmp_path / "sound.sqlite", 4))


def test_a_run_that_fails_is_recorded_with_its_cause(tmp_path):
    made = pushed(Faulty(amplitude=0.5))
    data = run(made, tmp_path / "l.sqlite", 32)
    bad = data.samples[:, 0] > 1.0
    assert 0 < bad.sum() < 32
    assert (data.outcome[bad] == "failed").all()
    assert (data.cause[bad] == "ZeroDivisionError: a fault of its own").all()
    assert (data.outcome[~bad] == "completed").all()
    assert not data.ended[bad].any()
    assert data.ended[~bad].all()
    with pytest.raises(SimulationError, match="a fault of its own; there is nothing to replay"):
        replay(tmp_path / "l.sqlite", int(np.flatnonzero(bad)[0]))


@dataclasses.dataclass(frozen=True, eq=False)
class Fragile(fp.Controller):
    """A PD law in plain Python that fails where the arm starts beyond 0.1 rad."""

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        start = state.memory.setdefault("start", q[0])
        if start > 0.1 and state.joints["t"][0] > 0.2:
            raise ZeroDivisionError("a fault of its own")
        return 50.0 * (q_ref - q) - 10.0 * v


def test_a_law_that_fails_leaves_other_laws_and_runs_alone(pool, tmp_path):
    uncertain = {"q0": Uniform(low=0.0, high=0.2, shared=True)}
    made = study(uncertain=uncertain)
    alone = run(made, tmp_path / "alone.sqlite", 6)
    laws = {"fragile": Fragile()} | made.controllers
    for options in ({}, {"executor": pool}):
        ledger = tmp_path / f"{len(options)}.sqlite"
        data = run(dataclasses.replace(made, controllers=laws), ledger, 6, chunk=5, **options)
        bad = data.samples[:, 0] > 0.1
        assert 0 < bad.sum() < 6
        assert (data.outcome[bad, 0] == "failed").all()
        assert "ZeroDivisionError: a fault of its own" in data.cause[bad, 0][0]
        assert (data.outcome[~bad, 0] == "completed").all()
        for name, values in data.metrics.items():
            assert values[:, 1:].tobytes() == alone.metrics[name].tobytes()


def test_outcomes_say_how_runs_ended(tmp_path):
    made = study(uncertain={"payload": Uniform(low=0.0, high=5.0)})
    arm = fp.Arm.two_link().with_limits(effort=(25.0, np.inf))
    # Far beyond what a step of 5 ms can hold.
    wild = fp.PdGravity(kp=1e6, kd=0.0)
    laws = {"calm": fp.PdGravity(kp=50.0, kd=10.0), "wild": wild}
    experiment = dataclasses.replace(made.experiment, arm=arm, duration=2.0, runaway_speed=30.0)
    data = run(dataclasses.replace(made, experiment=experiment, controllers=laws),
               tmp_path / "l.sqlite", 8)  # fmt: skip
    assert (data.outcome[:, 0] == "saturated").any()
    cause = data.cause[data.outcome[:, 0] == "saturated", 0][0]
    assert "at its effort limit" in cause
    assert "% of the time" in cause
    assert (data.outcome[:, 1] == "diverged").all()
    assert "beyond 30 rad/s" in data.cause[0, 1]
    assert np.isnan(data.metrics["rms"][:, 1]).all()
    assert data.ended[:, 0].all()
    assert not data.ended[:, 1].any()


class Losing(Executor):
    """Does two tasks; then it is broken, or cancels, as Dask does whose scheduler is lost."""

    def __init__(self, breaks):
        self.breaks, self.count = breaks, 0

    def submit(self, call, /, *arguments):
        self.count += 1
        future = Future()
        if self.count <= 2:
            future.set_result(call(*arguments))
        elif self.breaks:
            raise BrokenExecutor("gone")
        else:
            future.cancel()
            future.set_running_or_notify_cancel()
        return future


@pytest.mark.parametrize(
    ("breaks", "words"),
    [(True, r"does not outlive its workers \(fp\.tuning"), (False, "where a scheduler is lost")],
)
def test_an_executor_that_is_lost_is_told_and_what_there_is_stays(breaks, words, tmp_path):
    with pytest.raises(fp.FpidError, match=words):
        run(study(), tmp_path / "l.sqlite", 40, executor=Losing(breaks), chunk=10)
    assert load(tmp_path / "l.sqlite").runs == 20


def test_more_runs_than_points_are_refused(tmp_path):
    ledger = tmp_path / "l.sqlite"
    with pytest.raises(ArgumentError, match=r"runs: expected at most 1 \(the points given\)"):
        run(study(points=[[0.5] * 12]), ledger, 2)
    assert not ledger.exists()


@pytest.mark.parametrize(("number", "controller"), [(0, None), (5, "integer")])
def test_a_replay_has_the_bits_of_its_row(alone, ledger, number, controller):
    again = replay(ledger, number, controller)
    assert again.exact
    column = alone.controllers.index(again.controller)
    now = dict(zip(METRICS, again.again.figures, strict=True))
    for name, values in alone.metrics.items():
        assert now[name] == values[number, column]
    assert list(again.sample.values()) == alone.samples[number].tolist()
    assert "kp" in again.run.signals
    assert len(again.run.t) == 101
    twin = fp.simulate(study().experiment, study().controllers[again.controller])
    assert again.nominal.q.tobytes() == twin.q.tobytes()
    assert again.run.q.tobytes() != twin.q.tobytes()


def test_ledger_export_report_and_replay_say_the_dynamics(tmp_path):
    told = "pinocchio"
    made = study(duration=0.1, dynamics=told)
    data = run(made, tmp_path / "l.sqlite", 3)
    assert data.dynamics == load(tmp_path / "l.sqlite").dynamics == told
    rows = csv.DictReader(export(data, tmp_path / "l.csv").read_text().splitlines())
    assert {row["dynamics"] for row in rows} == {told}
    page = fp.campaign.report_html(data, tmp_path / "l.html").read_text(encoding="utf-8")
    assert f"Dynamics: {told}." in page
    again = replay(tmp_path / "l.sqlite", 2)
    assert again.exact
    assert again.run.meta["experiment"]["dynamics"] == told
    # The two agree within rounding, and are told apart.
    other = study(duration=0.1, dynamics=None)
    with pytest.raises(FileFormatError, match=r"another: experiment\.dynamics is "):
        run(other, tmp_path / "l.sqlite", 3)
    beside = run(other, tmp_path / "other.sqlite", 3)
    assert beside.dynamics == "compiled"
    assert beside.metrics["rms"] == pytest.approx(data.metrics["rms"], rel=1e-9)


def test_a_run_or_controller_that_is_not_there_is_refused(alone, ledger):
    with pytest.raises(ArgumentError, match="run: expected one that is recorded, got 24"):
        replay(ledger, alone.runs)
    with pytest.raises(ArgumentError, match="did you mean integer"):
        replay(ledger, 0, "intege")


def test_an_attack_finds_the_corner_that_sampling_misses(tmp_path):
    # PD without enough gravity compensation: the heaviest payload is the worst, whatever else.
    spreads = {
        "payload": Uniform(low=0.0, high=3.0),
        "viscous_friction": Uniform(low=0.0, high=0.1, shared=True),
        "position_noise": Normal(mean=1e-4, std=1e-5, shared=True),
    }
    experiment = fp.Experiment(
        fp.Arm.two_link(), fp.references.Hold((0.2, 0.3)), duration=1.0, step=5e-3
    )
    laws = {"soft": fp.PdGravity(kp=60.0, kd=15.0), "stiff": fp.PdGravity(kp=300.0, kd=30.0)}
    made = Study(experiment, laws, Scenarios(spreads, seed=1), "hold")
    ledger = tmp_path / "worst.sqlite"
    worst = attack(made, ledger, population=12, generations=12, workers=2)
    sampled = run(made, tmp_path / "sampled.sqlite", 64)
    alone = attack(made, tmp_path / "alone.sqlite", population=12, generations=12)
    assert bits(alone) == bits(worst)
    column = worst.parameters.index("payload")
    assert worst.samples[:, column] == pytest.approx(3.0, abs=0.05)
    for k in range(2):
        assert worst.metrics["rms"][k, k] > sampled.metrics["rms"][:, k].max()
        again = replay(ledger, k, worst.controllers[k])
        assert again.exact
        assert again.again.figures[0] == worst.metrics["rms"][k, k]
    with pytest.raises(ArgumentError, match="population"):
        attack(made, tmp_path / "x.sqlite", population=2)
