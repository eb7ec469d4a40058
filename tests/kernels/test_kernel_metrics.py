"""The sums behind the figures of merit, taken in any portions."""

import numpy as np
import pytest

from fpid_pin.kernels import metrics

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("size", [1, 3, 7])
def test_the_sums_are_those_of_the_whole_record(size):
    error, torque = np.random.default_rng(0).normal(size=(2, 7, 2, 2))
    sums, h, applied, half = np.zeros((2, 2), metrics.SUM), 0.1, 6, 3
    ends = np.array([7, 5])  # the second run ends early
    for first in range(0, 7, size):
        rows = slice(first, first + size)
        valid = np.clip(ends - first, 0, len(error[rows]))
        metrics.tally(sums, error[rows], torque[rows], valid, first, applied, half, h)
    for run, rows in enumerate((6, 5)):
        e, u, t = error[:rows, run], torque[:rows, run], h * np.arange(rows)[:, np.newaxis]
        expected = {
            "square": e**2, "late": e[half:] ** 2, "absolute": np.abs(e), "aged": t * np.abs(e),
            "effort": u**2, "changes": np.abs(np.diff(u, axis=0)),
        }  # fmt: skip
        for name, parts in expected.items():
            assert sums[name][run] == pytest.approx(parts.sum(axis=0), rel=1e-13)
        assert (sums["peak"][run] == np.abs(u).max(axis=0)).all()
        assert (sums["rows"][run] == rows).all()
        assert (sums["late_rows"][run] == rows - half).all()


@pytest.mark.parametrize("size", [1, 3, 7])
def test_a_path_is_that_of_the_whole_record(size):
    error, torque = np.random.default_rng(0).normal(size=(2, 7, 2, 2))
    error[0] = [[1.0, -1.0], [0.5, -0.5]]
    error[4:, :, 1] = 0.01
    limit, band, applied = np.full((2, 2), 0.8), 0.1, 6
    traces, ends = np.zeros((2, 2), metrics.TRACE), np.array([7, 5])
    for first in range(0, 7, size):
        rows = slice(first, first + size)
        valid = np.clip(ends - first, 0, len(error[rows]))
        metrics.trace(traces, error[rows], torque[rows], valid, limit, band, first, applied)
    for run, rows in enumerate((6, 5)):
        e, u, path = error[:rows, run], torque[:rows, run], traces[run]
        assert (path["worst"] == np.abs(e).max(axis=0)).all()
        assert (path["beyond"] == np.maximum((-np.sign(e[0]) * e).max(axis=0), 0.0)).all()
        assert path["jumps"] == pytest.approx((np.diff(u, axis=0) ** 2).sum(axis=0), rel=1e-13)
        assert (path["at_limit"] == (np.abs(u) >= 0.8).sum(axis=0)).all()
        last = [np.flatnonzero(np.abs(column) > band).max() for column in e.T]
        assert path["settled"].tolist() == [k + 1 for k in last]
        assert (path["rows"] == rows).all()
