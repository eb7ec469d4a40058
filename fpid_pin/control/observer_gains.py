"""Gains of the disturbance observer."""

from __future__ import annotations

import math

from fpid_pin import checks

#: Largest bandwidth of an observer, times the step. There what it estimates, once cancelled, still
#: bears two samples of delay that nobody told it of, or a model 5.7 times too heavy; from 1.4 on
#: two samples make it unstable. The noise of xi is 0.44 sigma/step there where that of speeds is
#: sigma, and 0.016 at 0.1.
FASTEST = 1.0


def observer_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Return the gains of `kernels.observer`, 1 - p^2 and (1 - p)^2/h; 0 for no bandwidth.

    Raises
    ------
    ArgumentError
        An observer faster than the sampling allows.
    """
    if bandwidth * step > FASTEST + 1e-9:
        expected = f"at most {FASTEST:g}/step ({FASTEST / step:g} rad/s)"
        raise checks.ArgumentError("observer", expected, f"{bandwidth:g} rad/s")
    pole = math.exp(-bandwidth * step)
    return 1.0 - pole**2, (1.0 - pole) ** 2 / step
