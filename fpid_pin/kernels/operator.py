"""The fractional derivative D^alpha of one signal, sample by sample, in constant memory.

Each mode obeys x' = -p x + f'. Between two samples the rate is the quadratic that takes both
measured rates and integrates to the measured change of f, so that over a step

    m_k = (f_k - f_(k-1))/h - (f'_k + f'_(k-1))/2
    x_k = E x_(k-1) + b1 f'_k + b0 f'_(k-1) + b2 m_k
    y_k = c1 f'_k + c0 f'_(k-1) + c2 m_k + sum_i g_i E_i x_i,(k-1)

with E = exp(-p h). A trailing underscore is the value one sample ago.
"""

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.functions import winds_up
from fpid_pin.kernels.records import DERIVATIVE, INTEGRAL_OF_ERROR


def initialise(op, modes, f, rate):
    """Return D^alpha f at t = 0, where the initialisation decides, and set the modes to it."""
    for i in range(modes.size):
        modes[i].x = op.initial_mode * f
    y = op.initial_output * f
    if op.order == 0.0:
        y = f
    elif op.order == 1.0:
        y = rate
    return y


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


def variable_order_derivative(op, table, poles, modes, f, f_, rate, rate_, h):
    """Return D^alpha f for an order that varies, as `derivative` does, and write dD/dalpha.

    `table` has c1, c0, c2 and the modes' weights, (3 + modes, nodes), at equally spaced orders from
    0 to 1. The modes are the same for all orders: the outputs at the four nodes around alpha are
    interpolated by a cubic, whose slope is the derivative with respect to the order. Towards alpha
    = 0 it tends to f - f(0), Caputo's limit, unless the modes hold f(0) from their start.
    """
    last = table.shape[1] - 1
    # Whole for the printed C as well, whose floor is not.
    a = min(max(int(math.floor(op.order * last)) - 1, 0), last - 3)  # noqa: RUF046
    t = op.order * last - a  # 0 to 3; the nodes are at 0, 1, 2, 3
    m = (f - f_) / h - 0.5 * (rate + rate_)
    y0 = table[0, a] * rate + table[1, a] * rate_ + table[2, a] * m
    y1 = table[0, a + 1] * rate + table[1, a + 1] * rate_ + table[2, a + 1] * m
    y2 = table[0, a + 2] * rate + table[1, a + 2] * rate_ + table[2, a + 2] * m
    y3 = table[0, a + 3] * rate + table[1, a + 3] * rate_ + table[2, a + 3] * m
    for i in range(modes.size):
        pole = poles[i]
        mode = modes[i]
        past = pole.decay * mode.x
        y0 += table[3 + i, a] * past
        y1 += table[3 + i, a + 1] * past
        y2 += table[3 + i, a + 2] * past
        y3 += table[3 + i, a + 3] * past
        mode.x = past + pole.b1 * rate + pole.b0 * rate_ + pole.b2 * m
    # Newton's form, by forward differences.
    d1 = y1 - y0
    d2 = y2 - 2.0 * y1 + y0
    d3 = y3 - 3.0 * y2 + 3.0 * y1 - y0
    slope = d1 + (2.0 * t - 1.0) * d2 / 2.0 + (3.0 * t * t - 6.0 * t + 2.0) * d3 / 6.0
    op.previous_sensitivity = op.sensitivity
    op.sensitivity = slope * last
    return y0 + t * (d1 + (t - 1.0) * (d2 / 2.0 + (t - 2.0) * d3 / 6.0))


def advance_operator(op, table, poles, modes, numbers, started, held, cut, h):
    """Take one sample of an operator of a law and write its output.

    `numbers` are the law's of this joint, among them signal, rate and output; `started` says
    whether this is not the first sample, `held` whether integrals are held, as while the paper's
    supervisor acts. So are those that would wind up a torque that was cut by `cut`.
    """
    f = numbers[op.source]
    stays = False
    if op.kind == DERIVATIVE:
        if op.rate >= 0:
            rate = numbers[op.rate]
        else:
            # The rate is taken to be constant over the step.
            rate = (f - op.f_) / h if started else 0.0
            op.rate_ = rate
    elif op.kind == INTEGRAL_OF_ERROR:
        rate = numbers[op.rate]
        stays = held or winds_up(cut, rate)
    else:
        rate = f
        stays = held or winds_up(cut, op.sign * f)
        if started and not stays:
            op.total += 0.5 * h * (f + op.rate_)
        f = op.total
    if op.order_column >= 0:
        order = numbers[op.order_column]
        op.order = order if op.kind == DERIVATIVE else 1.0 - order
    if not started:
        numbers[op.output] = initialise(op, modes, f, rate)
    elif stays:
        pass
    elif op.variable:
        numbers[op.output] = variable_order_derivative(
            op, table, poles, modes, f, op.f_, rate, op.rate_, h
        )
    else:
        numbers[op.output] = derivative(op, poles, modes, f, op.f_, rate, op.rate_, h)
    if op.order_column >= 0:
        # lambda = 1 - alpha for integrals. One sample old, as noise of a measured rate would
        # otherwise be in two factors of one product.
        slope = op.previous_sensitivity
        numbers[op.output + 1] = slope if op.kind == DERIVATIVE else -slope
    op.f_ = f
    op.rate_ = rate


@kernel
def sample(started, ops, poles, modes, f, f_, rate, rate_, out, h):
    """Take one sample of many signals, (channels,)."""
    for c in range(ops.size):
        op = ops[c]
        if not started:
            out[c] = initialise(op, modes[c], f[c], rate[c])
        else:
            out[c] = derivative(op, poles[op.row], modes[c], f[c], f_[c], rate[c], rate_[c], h)
        f_[c] = f[c]
        rate_[c] = rate[c]


@kernel
def record(ops, poles, modes, f, f_, rate, rate_, out, h):
    """Write D^alpha of recorded signals, (N, channels), into `out`.

    In row k, `rate` and `rate_` are the rates at the ends of the step that leads to it; `f_` is
    room, (channels,).
    """
    for k in range(f.shape[0]):
        sample(k > 0, ops, poles, modes, f[k], f_, rate[k], rate_[k], out[k], h)
