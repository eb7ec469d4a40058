"""What figures of merit are made of, a row at a time: sums, peaks, and the path itself."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel


@kernel(inline=True)
def measure_row(c, e, u, k, half, h):
    """Add row k of one joint, with error e and torque u; `half` is the row that the half begins."""
    c.square += e * e
    if k >= half:
        c.late += e * e
        c.late_rows += 1
    c.absolute += abs(e)
    c.aged += k * h * abs(e)
    c.effort += u * u
    if c.rows > 0:
        c.changes += abs(u - c.last)
        c.jumps += (u - c.last) * (u - c.last)
    else:
        c.start = e
    c.peak = max(c.peak, abs(u))
    c.worst = max(c.worst, abs(e))
    c.beyond = max(c.beyond, -e if c.start > 0.0 else e)
    if abs(e) > c.band:
        c.settled = k + 1
    if abs(u) >= c.limit:
        c.at_limit += 1
    c.last = u
    c.rows += 1


@kernel
def measure_joints(sums, reference, motion, k, number, half, h):
    """Add row k of blocks of reference and motion, the row of that `number` of its run."""
    for j in range(sums.size):
        error = reference[0, k, j] - motion[0, k, j]
        measure_row(sums[j], error, motion[2, k, j], number, half, h)


@kernel
def measure_rows(sums, reference, motion, half, h):
    """Add all rows of a recorded run, in one block."""
    for k in range(motion.shape[1]):
        measure_joints(sums, reference, motion, k, k, half, h)
