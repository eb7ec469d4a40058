"""What figures of merit are made of, a row at a time: sums, peaks, and the path itself."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout

#: Sums over the rows of one joint: e^2, e^2 of the late half, |e|, t |e|, u^2, |u_k - u_(k-1)|; the
#: largest |u|, the last u; how many rows there were, and how many of them late.
SUM = layout("square late absolute aged effort changes peak last", "rows late_rows")

#: What the path of one joint was like: the first e, the largest |e| and the largest e on the side
#: opposite to the first; the sum of (u_k - u_(k-1))^2, the last u; how many rows there were, the
#: number of the row from which on |e| stayed within a band, and rows at the torque's limit.
TRACE = layout("start worst beyond jumps last", "rows settled at_limit")


@kernel
def tally(sums, error, torque, valid, first, applied, half, h):
    """Add some rows, (K, runs, n), of which the first is row `first` of its run.

    `valid` of them are a run's; those from row `applied` on had no effect and do not count.
    """
    for r in range(sums.shape[0]):
        for k in range(min(valid[r], applied - first)):
            t = (first + k) * h
            for j in range(sums.shape[1]):
                c = sums[r, j]
                e = error[k, r, j]
                u = torque[k, r, j]
                c.square += e * e
                if first + k >= half:
                    c.late += e * e
                    c.late_rows += 1
                c.absolute += abs(e)
                c.aged += t * abs(e)
                c.effort += u * u
                if c.rows > 0:
                    c.changes += abs(u - c.last)
                c.peak = max(c.peak, abs(u))
                c.last = u
                c.rows += 1


@kernel
def trace(traces, error, torque, valid, limit, band, first, applied):
    """Follow some rows, as for `tally`; `limit` is of the torque, (runs, n) [N m], band [rad]."""
    for r in range(traces.shape[0]):
        for k in range(min(valid[r], applied - first)):
            for j in range(traces.shape[1]):
                c = traces[r, j]
                e = error[k, r, j]
                u = torque[k, r, j]
                if c.rows == 0:
                    c.start = e
                else:
                    c.jumps += (u - c.last) * (u - c.last)
                c.worst = max(c.worst, abs(e))
                c.beyond = max(c.beyond, -e if c.start > 0.0 else e)
                if abs(e) > band:
                    c.settled = first + k + 1
                if abs(u) >= limit[r, j]:
                    c.at_limit += 1
                c.last = u
                c.rows += 1
