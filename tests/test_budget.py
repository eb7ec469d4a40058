"""What would take more than there is, in memory or in time, is refused before it starts."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import fpid_pin as fp
from fpid_pin import resources
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import SearchSettings, Space, pareto, tune

LAW = fp.paper_controller()


def test_there_is_as_much_memory_as_the_machine_has_or_a_container_s_limit(tmp_path, monkeypatch):
    whole = resources.memory()
    assert 1e8 < whole < 1e14
    for text, expected in (("1000000\n", 1_000_000), ("max\n", whole)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(
            resources, "_CONTAINER", (str(tmp_path / "memory.max"), "/no/such/file")
        )
        assert resources.memory() == expected


def test_a_record_larger_than_memory_is_refused_with_both_sizes(monkeypatch):
    monkeypatch.setattr(resources, "memory", lambda: 100_000)
    experiment = fp.paper_experiment(duration=1.0)
    expected = r"duration: expected work that fits into 0.0001 GB of memory, got .*0.000184 GB"
    with pytest.raises(ArgumentError, match=expected):
        fp.simulate(experiment, LAW)
    # The cost alone keeps no record.
    assert fp.evaluate(experiment, LAW) > 0.0


def test_what_a_record_takes_is_foreseen():
    run = fp.simulate(fp.paper_experiment(duration=1.0), LAW)
    arrays = [run.t, run.q, run.v, run.q_ref, run.v_ref, run.torque, *run.signals.values()]
    foreseen = len(run.t) * (1 + 11 * 2) * 8
    assert sum(array.nbytes for array in arrays) == pytest.approx(foreseen, rel=0.05)


@pytest.mark.parametrize("search", [tune, pareto])
def test_a_search_of_a_life_s_length_is_refused_with_its_time(search):
    space, settings = Space(kp=(1, 100)), SearchSettings(generations=10**9)
    costs = () if search is tune else ([fp.costs.MetricCost("ise"), fp.costs.MetricCost("iae")],)
    with pytest.raises(ArgumentError, match="search: expected work of 30 days at most, got 1 seed"):
        search(fp.paper_experiment(), LAW, space, *costs, settings=settings)


def test_small_matrices_are_worked_on_by_one_thread(monkeypatch):
    def threads():
        return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}

    seen, eig = [], np.linalg.eig
    monkeypatch.setattr(np.linalg, "eig", lambda a: seen.append(threads()) or eig(a))
    law = fp.suggest_gains(fp.Arm.two_link())
    with threadpool_limits(2, user_api="blas"):
        fp.stability_report(fp.Arm.two_link(), law)
        assert seen
        assert all(each == {1} for each in seen)
        assert threads() == {2}
