"""A file that is damaged, or lies, is read as what it was or refused in one line."""

import dataclasses
import os
import random
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from damage import bombs, lying, repacked, shell_of, structured
from hypothesis import given, settings
from hypothesis import strategies as st

import fpid_pin as fp
from fpid_pin.exceptions import FpidError, FpidWarning
from fpid_pin.tuning import SearchSettings, Space, tune
from fpid_pin.view.export import replay_html

pytestmark = pytest.mark.torture
EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
LAW = fp.paper_controller()
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))
MANY = settings(max_examples=2000 if os.environ.get("FPID_TORTURE") == "full" else 60)
#: What takes the place of some bytes at a part of the file; a failure shrinks to the least.
EDITS = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.integers(0, 64), st.binary(max_size=64)), min_size=1,
    max_size=4,
)  # fmt: skip
#: Memory that a bad file may take beyond an honest one [MB].
MOST = 200.0


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
    folder = tmp_path_factory.mktemp("honest")
    made = {}
    for k, changes in enumerate(({}, {"kp": 11.0})):
        law = dataclasses.replace(LAW, **changes)
        run, path = fp.simulate(EXPERIMENT, law), folder / f"{k}.npz"
        made["run file", k] = run.save(path).read_bytes()
        made["packed run file", k] = run.save(path, compressed=True).read_bytes()
        path = folder / f"c{k}.npz"
        search(path, 2 + k)
        made["checkpoint", k] = path.read_bytes()
    return made


class Judge:
    """Reads a file and says what is wrong with how it was read; "" where nothing is."""

    def __init__(self, kind, honest, path):
        self.path, self.read = path, READERS[kind]
        path.write_bytes(honest)
        self.honest = self.read(path)

    def __call__(self, same=True):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FpidWarning)  # of other versions
                found = self.read(self.path)
        except FpidError as error:
            return "" if "\n" not in str(error) else f"several lines: {error!r}"
        except Exception as error:
            return f"{type(error).__name__}: {error}"
        return "" if not same or found == self.honest else "read as another"


@pytest.mark.parametrize("kind", READERS)
def test_a_flipped_bit_anywhere(kind, files, tmp_path, tally, full):
    honest, path = files[kind, 0], tmp_path / "file.npz"
    judge, chance = Judge(kind, honest, path), random.Random(1)
    shell = set(shell_of(honest))
    data = [k for k in range(0, len(honest), 40) if k not in shell]
    bits = [(k, bit) for k in sorted(shell) for bit in range(8)]
    flips = {
        f"{kind}: bit of headers, list, directory": bits,
        f"{kind}: bit of every 40th byte of data": [(k, chance.randrange(8)) for k in data],
    }
    for attack, places in flips.items():
        for k, bit in places if full else chance.sample(places, min(len(places), 150)):
            flipped = bytearray(honest)
            flipped[k] ^= 1 << bit
            path.write_bytes(flipped)
            fault = judge()
            tally(attack, fault and f"byte {k}, bit {bit}: {fault}")


@pytest.mark.parametrize("kind", READERS)
def test_structured_mutations(kind, files, tmp_path, tally, full):
    path = tmp_path / "file.npz"
    judge, chance = Judge(kind, files[kind, 0], path), random.Random(2)
    for k in range(500 if full else 60):
        what, data = structured(files[kind, 0], files[kind, 1], chance)
        path.write_bytes(data)
        fault = judge()
        tally(f"{kind}: structured mutation", fault and f"{k}, {what}: {fault}")


@pytest.mark.parametrize("kind", READERS)
@MANY
@given(edits=EDITS)
def test_any_edits(kind, files, tmp_path, edits):
    path = tmp_path / "file.npz"
    data = files[kind, 0]
    judge = Judge(kind, data, path)
    for part, lost, put in edits:
        at = round(part * len(data))
        data = data[:at] + put + data[at + lost :]
    path.write_bytes(data)
    assert judge() == ""


@pytest.mark.parametrize("kind", READERS)
def test_repacked_files(kind, files, tmp_path, tally):
    path = tmp_path / "file.npz"
    judge = Judge(kind, files[kind, 0], path)
    for what, data in repacked(files[kind, 0]):
        path.write_bytes(data)
        fault = judge()
        tally(f"{kind}: repacked", fault and f"{what}: {fault}")


@pytest.mark.parametrize("kind", READERS)
def test_files_that_lie_under_a_right_seal(kind, files, tmp_path, tally, full):
    """What they say is refused, or it is a run, of which everything can be asked."""
    path = tmp_path / "file.npz"
    judge, chance = Judge(kind, files[kind, 0], path), random.Random(3)
    for k in range(500 if full else 40):
        what, data = lying(files[kind, 0], chance)
        path.write_bytes(data)
        before = peak(reset=True)
        fault = judge(same=False)
        if not fault and kind != "checkpoint":
            fault = asked(path)
        if peak() - before > MOST:
            fault = f"{peak() - before:.0f} MB"
        tally(f"{kind}: signed again", fault and f"{k}, {what}: {fault}")


def asked(path):
    """Ask a run that was read for all it has; return what is no answer."""
    try:
        run = fp.Run.load(path)
    except FpidError:
        return ""
    questions = {
        "arm": lambda: run.arm, "controller": lambda: run.controller,
        "experiment": lambda: run.experiment, "metrics": lambda: run.metrics,
        "name": lambda: run.name, "replay": lambda: replay_html(run),
        "again": lambda: run.save(path.with_name("again.npz")),
    }  # fmt: skip
    for name, question in questions.items():
        try:
            with np.errstate(all="ignore"):
                question()
        except FpidError:
            continue
        except Exception as error:
            return f"{name}: {type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize("kind", READERS)
def test_bombs(kind, files, tmp_path, tally, full):
    path = tmp_path / "file.npz"
    judge = Judge(kind, files[kind, 0], path)
    for what, data in bombs(files[kind, 0], full):
        path.write_bytes(data)
        size = len(data) / 1e6
        del data
        before = peak(reset=True)
        fault = judge(same=False)
        grown = peak() - before
        if grown > MOST + 2.0 * size:
            fault = f"{grown:.0f} MB"
        tally(f"{kind}: bomb", fault and f"{what}: {fault}")


def peak(reset=False):
    """Return the most memory that this process has had since the last reset [MB]."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        status = Path("/proc/self/status").read_text()
    except OSError:
        pytest.skip("this system does not tell")
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) / 1e3
