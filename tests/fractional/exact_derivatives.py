"""Closed forms of Caputo derivatives, by mpmath at 30 digits."""

import mpmath as mp
import numpy as np


def of_sin(order, t, frequency=1.0):
    """Im of (i w)^a exp(i w t) gamma(1 - a, i w t)/Gamma(1 - a)."""
    if t == 0:
        return 0.0
    with mp.workdps(30):
        a, z = mp.mpf(order), mp.mpc(0, frequency) * mp.mpf(t)
        lower = 1 - mp.gammainc(1 - a, z) / mp.gamma(1 - a)
        return float(mp.im((mp.mpc(0, frequency)) ** a * mp.exp(z) * lower))


def of_exp(order, t):
    """-t^(1-a)/Gamma(2-a) 1F1(1, 2-a, -t), for exp(-t)."""
    with mp.workdps(30):
        a, t = mp.mpf(order), mp.mpf(t)
        return float(-(t ** (1 - a)) / mp.gamma(2 - a) * mp.hyp1f1(1, 2 - a, -t))


def of_power(order, t, power):
    """Gamma(b+1)/Gamma(b+1-a) t^(b-a), for t^b."""
    with mp.workdps(30):
        a, b = mp.mpf(order), mp.mpf(power)
        return float(mp.gamma(b + 1) / mp.gamma(b + 1 - a) * mp.mpf(t) ** (b - a))


def table(function, orders, times):
    """Values (times, orders)."""
    return np.array([[function(float(a), float(t)) for a in orders] for t in times])


def stream(bank, value, rate=None):
    """Feed samples (N, ...) to a bank and return its outputs (N, ...)."""
    out = np.empty_like(value)
    for k in range(len(value)):
        bank.update(value[k], None if rate is None else rate[k], out[k, ...])
    return out
