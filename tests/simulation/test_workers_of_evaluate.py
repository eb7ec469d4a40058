"""Threads of `evaluate`: the same bits, and after a fault nothing more is begun."""

import threading

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.costs import FromRows
from fpid_pin.simulation.entry import PART, executor_of
from fpid_pin.simulation.workers import WorkerPool

EXPERIMENT, LAW = fp.paper_experiment(duration=0.05), fp.paper_controller()


def test_parts_and_threads_change_no_bit():
    laws = [fp.Pid(kp=1.0 + k, ki=0.0, kd=1.0) for k in range(2 * PART + 3)]
    alone = fp.evaluate(EXPERIMENT, laws)
    told = []
    shared = fp.evaluate(EXPERIMENT, laws, workers=2, progress=lambda p: told.append(p.part))
    assert shared.tobytes() == alone.tobytes()
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0], abs=0.01)


def test_after_a_fault_no_thread_begins_anything_more():
    begun, first = [], threading.current_thread()

    def fail(state, rows):
        if threading.current_thread() is not first:  # the warm-up's runs are here
            begun.append(1)
            raise KeyboardInterrupt
        return state

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        fp.evaluate(EXPERIMENT, [LAW] * (20 * PART), FromRows(0.0, fail), workers=2)
    assert len(begun) < 20
    assert threading.active_count() == before


class Python(fp.Controller):
    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return np.zeros(2)


def test_threads_are_for_what_is_compiled_and_processes_for_the_rest():
    slow = EXPERIMENT.with_dynamics("pinocchio")
    for experiment, law, processes in (
        (EXPERIMENT, LAW, False), (EXPERIMENT, Python(), True), (slow, LAW, True),
    ):  # fmt: skip
        with executor_of(None, 2, [experiment, EXPERIMENT], [LAW, law]) as pool:
            assert isinstance(pool, WorkerPool) == processes
            assert pool._max_workers == 2
    with executor_of(None, None, [slow], [LAW]) as pool:
        assert pool is None
