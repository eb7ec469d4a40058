"""The sums behind the figures of merit, a row at a time: what integrals and peaks are made of."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout

#: Sums over the rows of one joint: e^2, e^2 of the late half, |e|, t |e|, u^2, |u_k - u_(k-1)|; the
#: largest |u|, the last u; how many rows there were, and how many of them late.
SUM = layout("square late absolute aged effort changes peak last", "rows late_rows")


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
