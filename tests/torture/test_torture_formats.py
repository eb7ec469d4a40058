"""A file that is damaged is read as what it was or refused in one line with its name."""

import contextlib
import dataclasses
import random
import warnings

import pytest
from bounded import FULL
from hypothesis import given, settings
from hypothesis import strategies as st

import fpid_pin as fp
from fpid_pin.exceptions import FpidError, FpidWarning
from fpid_pin.tuning import SearchSettings, Space, tune

pytestmark = pytest.mark.torture
EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
LAW = fp.paper_controller()
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))
MANY = settings(max_examples=2000 if FULL else 60)
#: What takes the place of some bytes at a part of the file: these, or as many of another file's
#: from there on; a failure shrinks to the least.
SIZES = st.integers(0, 512)
EDITS = st.lists(
    st.tuples(st.floats(0.0, 1.0), SIZES, st.binary(max_size=64) | SIZES), min_size=1, max_size=4
)


def search(path, generations, resume=False):
    settings = SearchSettings(
        population=4, generations=generations, seeds=(0, 7), checkpoint=path, resume=resume
    )
    return tune(EXPERIMENT, LAW, ORDERS, settings=settings)


def run_of(path):
    run = fp.Run.load(path)
    arrays = {name: getattr(run, name) for name in ("t", "q", "v", "q_ref", "v_ref", "torque")}
    arrays |= run.signals
    return [(name, a.shape, a.tobytes()) for name, a in arrays.items()] + [
        run.outcome, run.step, run.planned_rows, run.meta
    ]  # fmt: skip


def checkpoint_of(path):
    # At its end: nothing is simulated, and what is restored comes out as the result.
    result = search(path, 2, resume=True)
    h = result.history
    return [a.tobytes() for a in (h.best, h.mean, h.best_parameters, h.diverged, h.simulated)] + [
        result.cost, result.costs.tobytes(), result.simulations
    ]  # fmt: skip


READERS = {"run file": run_of, "packed run file": run_of, "checkpoint": checkpoint_of}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return an honest file of each kind, and another of the same."""
    folder, made = tmp_path_factory.mktemp("honest"), {}
    for k, kp in enumerate((10.0, 11.0)):
        run, path = fp.simulate(EXPERIMENT, dataclasses.replace(LAW, kp=kp)), folder / f"{k}.npz"
        made["run file", k] = run.save(path).read_bytes()
        made["packed run file", k] = run.save(path, compressed=True).read_bytes()
        search(folder / f"c{k}.npz", 2 + k)
        made["checkpoint", k] = (folder / f"c{k}.npz").read_bytes()
    return made


class Judge:
    """Reads a file and says what is wrong with how it was read; "" where nothing is."""

    def __init__(self, kind, path, *honest):
        self.path, self.read, self.known = path, READERS[kind], []
        for data in honest:
            path.write_bytes(data)
            with contextlib.suppress(FpidError):  # a search that is longer than what reads it
                self.known.append(self.read(path))
        assert self.known

    def __call__(self):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FpidWarning)  # of other versions
                found = self.read(self.path)
        except FpidError as error:
            told = str(error).startswith(f"{self.path}: ") and "\n" not in str(error)
            return "" if told else f"several lines, or none of this file: {error!r}"
        except Exception as error:
            return f"{type(error).__name__}: {error}"
        return "" if found in self.known else "read as another"


@pytest.mark.parametrize("kind", READERS)
def test_a_flipped_bit_anywhere(kind, files, tmp_path, tally):
    honest, path = files[kind, 0], tmp_path / "file.npz"
    judge, chance = Judge(kind, path, honest), random.Random(1)
    for place in chance.sample(range(8 * len(honest)), 3000 if FULL else 100):
        flipped = bytearray(honest)
        flipped[place // 8] ^= 1 << place % 8
        path.write_bytes(flipped)
        fault = judge()
        tally(f"{kind}: flipped bit", fault and f"byte {place // 8}, bit {place % 8}: {fault}")


@pytest.mark.parametrize("kind", READERS)
@MANY
@given(edits=EDITS)
def test_any_edits(kind, files, tmp_path, tally, edits):
    """The most that becomes of two files is one of them, never a mixture."""
    path = tmp_path / "file.npz"
    data, other = files[kind, 0], files[kind, 1]
    judge = Judge(kind, path, data, other)
    for part, lost, put in edits:
        at = round(part * len(data))
        piece = other[at : at + put] if isinstance(put, int) else put
        data = data[:at] + piece + data[at + lost :]
    path.write_bytes(data)
    fault = judge()
    tally(f"{kind}: edits", fault)
    assert fault == ""
