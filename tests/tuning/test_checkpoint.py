import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.costs import Cost, MetricCost, QuadraticCost
from fpid_pin.exceptions import FileFormatError, TuningError
from fpid_pin.tuning import SearchSettings, Space, pareto, tune

EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))
TWO = (MetricCost("ise"), MetricCost("energy"))


def small(**changes):
    return SearchSettings(**({"population": 6, "seeds": (0, 7)} | changes))


def bits(result):
    h = result.history
    arrays = (h.best, h.mean, h.best_parameters, h.diverged, h.simulated, np.asarray(result.costs))
    return [array.tobytes() for array in arrays]


@pytest.mark.parametrize("search", [tune, lambda e, c, s, **o: pareto(e, c, s, TWO, **o)])
def test_a_search_can_be_made_longer_to_the_same_bits(tmp_path, search):
    path = tmp_path / "search.npz"
    search(EXPERIMENT, CONTROLLER, ORDERS, settings=small(generations=2, checkpoint=path))
    more = small(generations=5, checkpoint=path, resume=True)
    longer = search(EXPERIMENT, CONTROLLER, ORDERS, settings=more)
    never = search(EXPERIMENT, CONTROLLER, ORDERS, settings=small(generations=5))
    assert bits(longer) == bits(never)
    with pytest.raises(TuningError, match="generations is 4 here, and 5 are done"):
        search(EXPERIMENT, CONTROLLER, ORDERS, settings=dataclasses.replace(more, generations=4))


@pytest.fixture
def checkpoint(tmp_path):
    path = tmp_path / "search.npz"
    given = small(generations=2, checkpoint=path)
    tune(EXPERIMENT, CONTROLLER, ORDERS, QuadraticCost(), given)
    return path


def resume(path, **changes):
    given = {"experiment": EXPERIMENT, "controller": CONTROLLER, "space": ORDERS}
    given["cost"] = QuadraticCost()
    asked = {"generations": 3, "checkpoint": path, "resume": True}
    for name, value in changes.items():
        (asked if hasattr(SearchSettings, name) else given)[name] = value
    return tune(**given, settings=small(**asked))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seeds": (0, 8)}, "seeds.1 is 7 there and 8 here"),
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
    with pytest.raises(TuningError) as error:
        resume(checkpoint, **changes)
    assert "a checkpoint of another search" in str(error.value)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert checkpoint.read_bytes() == before


def test_a_folder_that_cannot_be_written_is_told_before_the_search(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    told, settings = [], small(checkpoint=blocked / "search.npz")
    with pytest.raises(FileFormatError, match="cannot be written"):
        tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings, progress=told.append)
    assert told == []


def test_a_cost_of_ones_own_resumes_in_another_process(tmp_path):
    class Own(Cost):
        def of(self, metrics):
            return float(metrics.iae.sum())

    path = tmp_path / "search.npz"
    tune(EXPERIMENT, CONTROLLER, ORDERS, Own(), small(generations=1, checkpoint=path))
    # Another object, at another address, as it would be in another process.
    assert resume(path, cost=Own()).history.best.shape == (3, 2)


def test_a_checkpoint_appears_with_its_first_generation(tmp_path):
    path = tmp_path / "search.npz"
    settings = small(generations=1, checkpoint=path)

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings, progress=stop)
    lost = dataclasses.replace(CONTROLLER, kp=1e300, kd=1e300)
    with pytest.raises(TuningError, match="diverged"):
        tune(EXPERIMENT, lost, ORDERS, settings=settings)
    # Nothing stands in the way of a search whose configuration was corrected since.
    assert list(tmp_path.iterdir()) == []
    tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings)
    before = path.read_bytes()
    with pytest.raises(TuningError, match="resume it, or remove it"):
        tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings)
    assert path.read_bytes() == before


def test_other_versions_are_told(checkpoint, monkeypatch):
    monkeypatch.setattr("fpid_pin.tuning.search.__version__", "9.9")
    with pytest.warns(fp.FpidWarning, match=r"fpid_pin is '.*' there and '9\.9' here"):
        resume(checkpoint)
