import dataclasses
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from studies import Deadly, Faulty, bits, pushed, study

import fpid_pin as fp
from fpid_pin.campaign import Uniform, load, run
from fpid_pin.exceptions import ArgumentError, FpidError, WorkersDied
from fpid_pin.simulation.workers import AHEAD, distribute

RUNS = 24


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Return what a campaign finds in this process, in chunks of 64."""
    return run(study(), tmp_path_factory.mktemp("alone") / "ledger.sqlite", RUNS)


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
    with pytest.raises(FpidError, match=words):
        run(study(), tmp_path / "l.sqlite", 40, executor=Losing(breaks), chunk=10)
    assert load(tmp_path / "l.sqlite").runs == 20


def test_bad_arguments_are_refused(tmp_path):
    ledger = tmp_path / "l.sqlite"
    for options in ({"runs": 0}, {"runs": 3, "chunk": 0}, {"runs": 3, "workers": 0}):
        with pytest.raises(ArgumentError):
            run(study(), ledger, **options)
    with pytest.raises(ArgumentError, match=r"runs: expected at most 1 \(the points given\)"):
        run(study(points=[[0.5] * 12]), ledger, 2)
    assert not ledger.exists()
