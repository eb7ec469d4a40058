"""The fractional derivative D^alpha of one signal, sample by sample, in constant memory.

Each mode obeys x' = -p x + f'. Between two samples the rate is the quadratic that takes both
measured rates and integrates to the measured change of f, so that over a step

    m_k = (f_k - f_(k-1))/h - (f'_k + f'_(k-1))/2
    x_k = E x_(k-1) + b1 f'_k + b0 f'_(k-1) + b2 m_k
    y_k = c1 f'_k + c0 f'_(k-1) + c2 m_k + sum_i g_i E_i x_i,(k-1)

with E = exp(-p h). A trailing underscore is the value one sample ago.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout

#: An operator: its order; the weights c1, c0, c2 of the newest step; its start (what its modes
#: hold of f(0), and its output for each unit of it); dD/dalpha, where orders move; and the row of
#: the poles that are its own.
OPERATOR = layout("order c1 c0 c2 rest kick slope", "row")
#: A pole over one step: E and b1, b0, b2.
POLE = layout("decay b1 b0 b2")
#: A mode of one operator: its weight g and its value x.
MODE = layout("weight x")


@kernel(inline=True)
def begin(op, modes, f, rate):
    """Return D^alpha f at t = 0, where the initialisation decides, and set the modes to it."""
    for i in range(modes.size):
        modes[i].x = op.rest * f
    y = op.kick * f
    if op.order == 0.0:
        y = f
    elif op.order == 1.0:
        y = rate
    return y


@kernel(inline=True)
def derivative(op, poles, modes, f, f_, rate, rate_, h):
    """Return D^alpha f at this sample, eq. (4), and move the modes on to it."""
    m = (f - f_) / h - 0.5 * (rate + rate_)
    y = op.c1 * rate + op.c0 * rate_ + op.c2 * m
    for i in range(modes.size):
        mode = modes[i]
        pole = poles[i]
        past = pole.decay * mode.x
        y += mode.weight * past
        mode.x = past + pole.b1 * rate + pole.b0 * rate_ + pole.b2 * m
    if op.order == 0.0:
        y = f
    elif op.order == 1.0:
        y = rate
    return y


@kernel(inline=True)
def output(table, a, modes, poles, rate, rate_, m):
    """Return what the operator of node a of a table of orders gives at this sample."""
    y = table[a, 0] * rate + table[a, 1] * rate_ + table[a, 2] * m
    for i in range(modes.size):
        y += table[a, 3 + i] * poles[i].decay * modes[i].x
    return y


@kernel(inline=True)
def moving(op, table, poles, modes, f, f_, rate, rate_, h):
    """Return D^alpha f for an order that moves, as `derivative` does, and write dD/dalpha.

    `table` has c1, c0, c2 and the modes' weights at equally spaced orders from 0 to 1. The modes
    are the same for all orders: the outputs at the four nodes around alpha are interpolated by a
    cubic, whose slope is the derivative with respect to the order.
    """
    m = (f - f_) / h - 0.5 * (rate + rate_)
    last = table.shape[0] - 1
    first = min(max(int(op.order * last) - 1, 0), last - 3)
    t = op.order * last - first  # 0 to 3; the nodes are at 0, 1, 2, 3
    y0 = output(table, first, modes, poles, rate, rate_, m)
    y1 = output(table, first + 1, modes, poles, rate, rate_, m)
    y2 = output(table, first + 2, modes, poles, rate, rate_, m)
    y3 = output(table, first + 3, modes, poles, rate, rate_, m)
    # Newton's form, by forward differences.
    d1 = y1 - y0
    d2 = y2 - 2.0 * y1 + y0
    d3 = y3 - 3.0 * y2 + 3.0 * y1 - y0
    y = y0 + t * (d1 + (t - 1.0) * (d2 / 2.0 + (t - 2.0) * d3 / 6.0))
    slope = d1 + (2.0 * t - 1.0) * d2 / 2.0 + (3.0 * t * t - 6.0 * t + 2.0) * d3 / 6.0
    op.slope = slope * last
    for i in range(modes.size):
        pole = poles[i]
        mode = modes[i]
        past = pole.decay * mode.x
        mode.x = past + pole.b1 * rate + pole.b0 * rate_ + pole.b2 * m
    return y


@kernel
def sample(started, ops, poles, modes, f, f_, rate, rate_, held, out, h):
    """Take one sample of many signals, (channels,); those that are `held` stand still."""
    for c in range(ops.size):
        op = ops[c]
        if not started:
            out[c] = begin(op, modes[c], f[c], rate[c])
        elif not held[c]:
            out[c] = derivative(op, poles[op.row], modes[c], f[c], f_[c], rate[c], rate_[c], h)
        f_[c] = f[c]
        rate_[c] = rate[c]


@kernel
def record(ops, poles, modes, f, rate, rate_, out, h):
    """Write D^alpha of recorded signals, (N, channels), into `out`.

    In row k, `rate` and `rate_` are the rates at the ends of the step that leads to it.
    """
    for c in range(ops.size):
        op = ops[c]
        out[0, c] = begin(op, modes[c], f[0, c], rate[0, c])
        for k in range(1, f.shape[0]):
            out[k, c] = derivative(
                op, poles[op.row], modes[c], f[k, c], f[k - 1, c], rate[k, c], rate_[k, c], h
            )
