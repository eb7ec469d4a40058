"""Fractional operators without any robot: a signal sample by sample, against a closed form."""

import numpy as np
from scipy.special import gamma

import fpid_pin as fp
from fpid_pin.fractional import Bank, ExponentialSum

step, order = 1e-3, 0.5  # [s]
t = step * np.arange(2001)
signal, rate = t**2, 2.0 * t
exact = 2.0 / gamma(3.0 - order) * t ** (2.0 - order)  # D^0.5 of t^2

bank = Bank(ExponentialSum(modes=24), order, step=step, horizon=2.0)
streamed = np.array([float(bank.update(f, r)) for f, r in zip(signal, rate, strict=True)])
recorded = fp.fractional.caputo(signal, order, step)
print(f"24 modes, the rate known:  largest error {np.abs(streamed - exact).max():.1e}")
print(f"L1, the whole past:        largest error {np.abs(recorded - exact).max():.1e}")
