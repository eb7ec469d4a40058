"""What would take more than there is, in memory or in time, is refused before it starts."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import fpid_pin as fp
from fpid_pin import resources
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import SearchSettings, Space, pareto, tune

LAW = fp.paper_controller()
TUNE = "\n[tune]\n{}\n[tune.space]\nkp = [1, 100]\n"


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


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("run", ("duration = 20.0", "duration = 1e9"), "duration: expected work that fits into"),
        ("compare", ("step = 1e-3", "step = 1e-9"), "runs of 2e+10 rows: about 1.47e+04 GB"),
        ("tune", None, "100000 seeds of 60 runs of 2e+04 rows, 80 times: about 66.7 days"),
        ("tune", "population = 1_000_000_000_000", "search: expected work that fits into"),
    ],
)
def test_no_command_starts_what_it_cannot_end(
    tmp_path, capsys, monkeypatch, command, text, message
):
    config, settings = demo_config().text, ""
    if isinstance(text, tuple):
        config = config.replace(*text)
    elif text is None:
        # Where the memory would do.
        monkeypatch.setattr(resources, "memory", lambda: 10**12)
        settings = f"seeds = {list(range(100_000))}"
    else:
        settings = text
    if command == "run":
        head, first, *_ = config.split("[[controller]]")
        config = f"{head}[[controller]]{first}"
    path = tmp_path / "large.toml"
    path.write_text(config + (TUNE.format(settings) if command == "tune" else ""))
    assert main([command, str(path), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert len(err.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["large.toml"]


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
