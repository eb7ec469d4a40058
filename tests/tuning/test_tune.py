"""Searches: what they find, that nothing but their seeds decides its bits, and what stops them."""

import dataclasses
import os
import re
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from own_laws import PythonPd

import fpid_pin as fp
from fpid_pin.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, FileFormatError, TuningError
from fpid_pin.references import Hold
from fpid_pin.tuning import SearchSettings, Space, WorkerPool, cost_map, pareto, search, tune
from fpid_pin.tuning.search import Evolution

EXPERIMENT = fp.paper_experiment(duration=0.4, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))
TRACKING = QuadraticCost(1.0, 0.0)
THREE = fp.Experiment(fp.Arm.planar(lengths=(1,) * 3, masses=(1,) * 3), Hold((0.0,) * 3))


def small(**changes):
    return SearchSettings(**({"population": 8, "generations": 4} | changes))


def bits(result):
    h = result.history
    arrays = (h.best, h.mean, h.best_parameters, h.diverged, h.simulated, result.costs)
    return [np.asarray(array).tobytes() for array in arrays]


def asked(**changes):
    """Search with these settings and other arguments, by their names."""
    given = {"experiment": EXPERIMENT, "controller": CONTROLLER, "space": ORDERS}
    own = {k: changes.pop(k) for k in list(changes) if hasattr(SearchSettings, k)}
    return tune(**given | ({"settings": small(**own)} if own else {}) | changes)


@pytest.fixture(scope="module")
def found():
    return tune(EXPERIMENT, CONTROLLER, ORDERS, TRACKING, small(seeds=(0, 3)))


def test_by_default_the_better_tracker_costs_less_but_on_the_paper_s_arm_it_is_eq_33():
    arm = fp.Arm.from_example("ur5")
    motion = fp.references.Sinusoid(0.3, 1.0, offset=arm.home)
    e = fp.Experiment(arm, motion, duration=1.0, step=2e-3)
    slow, fast = (fp.suggest_gains(arm, bandwidth, step=2e-3) for bandwidth in (4.0, 10.0))
    runs = fp.simulate(e.with_dynamics("compiled"), [slow, fast])
    costs = fp.evaluate(e, [slow, fast])
    assert costs.tolist() == [run.metrics.rms_tail.max() for run in runs]
    assert costs[1] < 0.7 * costs[0]
    assert fp.evaluate(EXPERIMENT, [CONTROLLER]) == fp.evaluate(
        EXPERIMENT, [CONTROLLER], QuadraticCost()
    )
    # What is found varies no more than the start, or it would cost the square of the excess.
    space = Space(kp=(20, 200, "log", "shared"))
    found = tune(e, slow, space, settings=small(population=6, generations=2))
    run = fp.simulate(e.with_dynamics("compiled"), found.controller)
    excess = run.metrics.total_variation.sum() / runs[0].metrics.total_variation.sum()
    assert found.cost == pytest.approx(run.metrics.rms_tail.max() * max(1.0, excess) ** 2)
    with pytest.warns(fp.FpidWarning, match=r"energy is 9\d\.\d % .* hardly looks at the error"):
        tune(e, slow, space, QuadraticCost(), small(population=4, generations=1))


def test_gains_are_suggested_once_for_a_search_over_what_they_have(monkeypatch):
    calls = []
    suggest = fp.SuggestedFpid.on
    monkeypatch.setattr(
        fp.SuggestedFpid, "on", lambda *args, **more: calls.append(1) or suggest(*args, **more)
    )
    space = Space(integral_order=(0, 1, "shared"), kp=(20, 200, "log", "shared"))
    found = tune(EXPERIMENT, fp.SuggestedFpid(), space, TRACKING, small(generations=2))
    assert isinstance(found.controller, fp.AdaptiveFpid)
    assert len(calls) == 1
    # Over what they are suggested by: again for each candidate.
    space = Space(bandwidth=(4.0, 12.0, "shared"))
    found = tune(EXPERIMENT, fp.SuggestedFpid(), space, TRACKING, small(generations=1))
    assert len(calls) > 8
    assert 4.0 <= found.parameters["bandwidth"] <= 12.0
    assert found.cost == fp.evaluate(EXPERIMENT, found.controller, TRACKING)


def test_the_result_is_what_it_says(found):
    assert found.cost == fp.evaluate(EXPERIMENT, [found.controller], TRACKING)[0]
    assert found.cost == found.costs.min() == found.history.best[-1].min()
    assert found.evaluations == 2 * 8 * 4 > found.simulations == found.history.simulated.sum()
    assert (np.diff(found.history.best, axis=0) <= 0).all()
    assert found.cost < fp.evaluate(EXPERIMENT, [CONTROLLER], TRACKING)[0]
    assert found.mean == np.mean(found.costs)
    assert found.spread == pytest.approx(abs(found.costs[0] - found.costs[1]) / np.sqrt(2))
    assert np.array_equal(found.parameters["integral_order"], found.controller.integral_order)
    assert found.controller.name == "tuned"
    for controller, cost in zip(found.controllers, found.costs, strict=True):
        assert cost == fp.evaluate(EXPERIMENT, [controller], TRACKING)[0]
    assert str(found).startswith(f"cost {found.cost:.6g} (2 seeds: ")
    (first, *_, last), along = found.rows(), found.space.labels
    assert (first["parameter"], last["parameter"]) == (along[0], along[-1])
    assert (first["low"], first["high"], first["start"]) == (0.0, 1.0, 0.901)
    assert first["tuned"] == found.controller.integral_order[0]
    assert (last["at a bound"] == "yes") == (last["parameter"] in found.at_bounds)
    rows = found.history.rows()
    assert len(rows) == 4 * 2
    assert list(rows[-1].items())[:4] == [
        ("generation", 4), ("seed", 3), ("evaluations", 64), ("best cost", found.costs[1]),
    ]  # fmt: skip


def test_the_same_seed_gives_the_same_bits_alone_and_in_company(found):
    alone = tune(EXPERIMENT, CONTROLLER, ORDERS, TRACKING, small(seeds=(3,)))
    assert np.array_equal(alone.history.best[:, 0], found.history.best[:, 1])
    assert np.array_equal(alone.history.best_parameters[:, 0], found.history.best_parameters[:, 1])


def test_workers_do_not_change_a_bit_also_where_one_is_killed(found):
    killed = []

    def kill(progress):
        if progress.generation == 2 and not killed:
            killed.append(pool.processes[-1])
            os.kill(killed[0], signal.SIGKILL)

    with WorkerPool(2) as pool:
        settings = small(seeds=(0, 3), executor=pool)
        shared = tune(EXPERIMENT, CONTROLLER, ORDERS, TRACKING, settings, progress=kill)
        assert killed
        assert bits(shared) == bits(found)
        heavy = fp.Plant(arm=EXPERIMENT.arm.with_payload(0.7), disturbance=None)
        several = [EXPERIMENT, dataclasses.replace(EXPERIMENT, plant=heavy)]
        one = tune(several, CONTROLLER, ORDERS, settings=small())
        two = tune(several, CONTROLLER, ORDERS, settings=small(executor=pool))
        assert bits(one) == bits(two)
        assert one.simulations == 2 * int(one.history.simulated.sum())


def test_progress_rises_to_the_end():
    told = []
    tune(EXPERIMENT, CONTROLLER, ORDERS, settings=small(), progress=told.append)
    parts = [progress.part for progress in told]
    assert parts == sorted(parts)
    assert [progress.generation for progress in told if progress.complete] == [1, 2, 3, 4]
    last = told[-1]
    assert (last.part, last.generation, last.evaluations) == (1.0, 4, 32)
    assert last.rate > 0
    assert last.seconds_left == 0.0
    assert np.isfinite(last.best)


INTEGER = fp.paper_controller("integer", supervised=False)


def test_individuals_that_diverge_cost_infinity_and_the_search_goes_on():
    # Derivative gains beyond 2/(h max eig M^-1) make the sampled loop unstable.
    wild = Space(kd=(1, 4000, "log", "shared"))
    result = tune(EXPERIMENT, INTEGER, wild, settings=small())
    assert result.history.diverged[0, 0] > 0
    assert np.isfinite(result.cost)
    assert np.isfinite(result.history.mean).all()
    said = r"^generation 1, seed 0: all 8 candidates diverged, the first one diverged.*joint[^\n]*$"
    with pytest.raises(TuningError, match=said):
        tune(EXPERIMENT, INTEGER, Space(kd=(3000, 4000, "shared")), settings=small())


def test_a_cost_that_is_not_a_number_never_wins():
    class Odd(Cost):
        def of(self, metrics):
            ise = float(metrics.ise.sum())
            return ise if ise > 0.07 else float("nan")

    result = tune(EXPERIMENT, CONTROLLER, ORDERS, Odd(), small(population=24))
    assert result.cost > 0.07


def test_the_front_holds_nothing_that_is_beaten():
    costs = (MetricCost("ise"), MetricCost("energy"), MetricCost("total_variation"))
    for count in (2, 3):
        front = pareto(EXPERIMENT, CONTROLLER, ORDERS, costs[:count], small(seeds=(0, 1)))
        assert len(front) >= 3
        for one in front.costs:
            assert not ((front.costs <= one).all(axis=1) & (front.costs < one).any(axis=1)).any()
        table = fp.evaluate(EXPERIMENT, list(front.controllers), costs[:count])
        assert np.array_equal(table, front.costs)
        assert (np.diff(front.costs[:, 0]) >= 0).all()
        assert len(front.history.rows()[0]) == len(front.history.labels) + 4 + 2 * count
        head, *lines = str(front).splitlines()
        assert head.startswith(f"{len(front)} controllers, {count} costs (")
        assert len(lines) == count
        assert all("integral_order.0 0." in line for line in lines)


def test_a_cost_map_is_the_cost_at_every_pair_of_orders():
    found = cost_map(
        EXPERIMENT, CONTROLLER, TRACKING, integral_orders=[0, 0.4, 1], derivative_orders=[0.5, 1]
    )
    for i, a in enumerate((0, 0.4, 1)):
        for j, b in enumerate((0.5, 1)):
            law = dataclasses.replace(CONTROLLER, integral_order=a, derivative_order=b)
            assert found.costs[i, j] == fp.evaluate(EXPERIMENT, [law], TRACKING)[0]
    i, j = np.unravel_index(np.argmin(found.costs), (3, 2))
    assert found.best == (found.integral_orders[i], found.derivative_orders[j])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"population": 3}, "population: expected a whole number >= 4, got 3"),
        ({"mutation": -0.1}, "mutation: expected a number in [0, 1], got -0.1"),
        ({"seeds": (1, 1)}, "seeds: expected at least one, each once"),
        ({"executor": 2}, "executor: expected an Executor, got int"),
        ({"executor": ThreadPoolExecutor(1), "workers": 2},
         "workers: expected workers or executor"),
        ({"resume": True}, "resume: expected a checkpoint to resume from, got none"),
        ({"initial": [CONTROLLER, 1]}, "initial.1: expected a Controller, got int"),
        ({"initial": fp.Pid(1.0, 1.0, 1.0)}, "a controller with integral_order"),
        ({"settings": {"population": 8}}, "settings: expected SearchSettings, got dict"),
        ({"cost": [TRACKING]}, "cost: expected one cost (several: use pareto)"),
        ({"experiment": []}, "experiment: expected at least one, got none"),
        ({"experiment": [EXPERIMENT, THREE]}, "one number of joints, got [2, 3]"),
    ],
)  # fmt: skip
def test_bad_input_is_named_before_anything_is_simulated(changes, said):
    with pytest.raises(ArgumentError, match=re.escape(said)):
        asked(**changes)


TWO = (MetricCost("ise"), MetricCost("energy"))


@pytest.mark.parametrize("search", [tune, lambda e, c, s, **o: pareto(e, c, s, TWO, **o)])
def test_a_search_can_be_made_longer_to_the_same_bits(tmp_path, search):
    def to(generations, **more):
        given = small(generations=generations, seeds=(0, 7), **more)
        return search(EXPERIMENT, CONTROLLER, ORDERS, settings=given)

    path = tmp_path / "search.npz"
    to(2, checkpoint=path)
    longer = to(5, checkpoint=path, resume=True)
    assert bits(longer) == bits(to(5))
    with pytest.raises(TuningError, match="generations is 4 here, and 5 are done"):
        to(4, checkpoint=path, resume=True)


@pytest.fixture
def checkpoint(tmp_path):
    asked(generations=2, checkpoint=tmp_path / "search.npz", cost=QuadraticCost())
    return tmp_path / "search.npz"


def resume(path, **changes):
    given = {"generations": 3, "checkpoint": path, "resume": True, "cost": QuadraticCost()}
    return asked(**given | changes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seeds": (8,)}, "seeds.0 is 0 there and 8 here"),
        ({"cost": QuadraticCost(1, 0)}, "cost.0.w2 is 0.0001 there and 0.0 here"),
        ({"space": Space(integral_order=(0, 1), derivative_order=(0.5, 1))},
         "space.derivative_order.low is 0.0 there and 0.5 here"),
        ({"controller": dataclasses.replace(CONTROLLER, kp=(10, 13))},
         "controller.kp.1 is 12.0 there and 13.0 here"),
        ({"experiment": dataclasses.replace(EXPERIMENT, arm=EXPERIMENT.arm.with_payload(1.0))},
         "experiment.0.arm."),
    ],
)  # fmt: skip
def test_a_checkpoint_of_another_search_is_refused_with_the_difference(checkpoint, changes, said):
    before = checkpoint.read_bytes()
    with pytest.raises(TuningError, match=f"a checkpoint of another search.*{re.escape(said)}.*$"):
        resume(checkpoint, **changes)
    assert checkpoint.read_bytes() == before


def test_a_folder_that_cannot_be_written_is_told_before_the_search(tmp_path):
    (tmp_path / "file").write_text("")
    told = []
    with pytest.raises(FileFormatError, match="cannot be written"):
        asked(checkpoint=tmp_path / "file" / "search.npz", progress=told.append)
    assert told == []


def test_a_cost_of_ones_own_resumes_in_another_process(tmp_path):
    class Own(Cost):
        def of(self, metrics):
            return float(metrics.iae.sum())

    path = tmp_path / "search.npz"
    asked(generations=1, checkpoint=path, cost=Own())
    # Another object, at another address, as it would be in another process.
    assert resume(path, cost=Own()).history.best.shape == (3, 1)


def test_a_checkpoint_appears_with_its_first_generation(tmp_path):
    path = tmp_path / "search.npz"

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        asked(generations=1, checkpoint=path, progress=stop)
    lost = dataclasses.replace(CONTROLLER, kp=1e300, kd=1e300)
    with pytest.raises(TuningError, match="diverged"):
        asked(generations=1, checkpoint=path, controller=lost)
    # Nothing stands in the way of a search whose configuration was corrected since.
    assert list(tmp_path.iterdir()) == []
    asked(generations=1, checkpoint=path)
    before = path.read_bytes()
    with pytest.raises(TuningError, match="resume it, or remove it"):
        asked(generations=1, checkpoint=path)
    assert path.read_bytes() == before


def test_other_versions_are_told(checkpoint, monkeypatch):
    monkeypatch.setattr("fpid_pin.tuning.search.__version__", "9.9")
    with pytest.warns(fp.FpidWarning, match=r"fpid_pin is '.*' there and '9\.9' here"):
        resume(checkpoint)


def made(seed, **changes):
    return Evolution(np.empty((0, 6)), 1, SearchSettings(**changes), seed)


def bred(evolution):
    """Return a first generation of a bowl, and its offspring."""
    parents = evolution.ask()
    evolution.tell(((parents - 0.3) ** 2).sum(axis=1, keepdims=True))
    return parents, evolution.ask()


def test_the_papers_settings_mean_what_they_say():
    crossed = mutated = offspring = 0
    for seed in range(20):
        # Without mutation: an offspring that is no parent's copy was crossed.
        parents, children = bred(made(seed, mutation=0.0))
        known = {p.tobytes() for p in parents}
        crossed += sum(child.tobytes() not in known for child in children)
        # Without crossover: a coordinate that no parent has was mutated.
        parents, children = bred(made(seed, crossover=0.0))
        mutated += int((~np.isin(children, parents)).sum())
        offspring += len(children)
    # Two parents that are one and the same come out of a crossover unchanged.
    assert 0.70 < crossed / offspring < 0.76
    assert 0.025 < mutated / (6 * offspring) < 0.035


SHORT = fp.paper_experiment(duration=0.1, step=5e-3)
GAINS = Space(kp=(10, 100, "log"), kd=(1, 20))


def test_it_says_before_the_search_how_long_it_takes(monkeypatch):
    clock = iter((0.0, 36.0))
    monkeypatch.setattr(
        search, "time", SimpleNamespace(perf_counter=lambda: next(clock), monotonic=time.monotonic)
    )
    settings, counts = small(population=4, generations=2), []
    with pytest.warns(fp.FpidWarning) as caught:
        tune(SHORT, PythonPd(50.0, 10.0), GAINS, settings=settings,
             progress=lambda _: counts.append(len(caught)))  # fmt: skip
    (warning,) = caught
    assert str(warning.message) == (
        "PythonPd is a law in plain Python: 8 candidates of 36 s each take about "
        "0:04:48 (h:min:s); in the joint form, torque(c), it is compiled (CONTRIBUTING.md)"
    )
    assert warning.filename == __file__
    assert counts[0] == 1
