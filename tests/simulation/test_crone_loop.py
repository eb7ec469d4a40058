"""The paper's own realisation, a CRONE filter, in the closed loop."""

import dataclasses

import numpy as np
import pytest
from paper_by_hand import (
    LONG,
    PUBLISHED,
    OustaloupCascade,
    ProductIntegration,
    closed_loop,
)

import fpid_pin as fp

BANDS = [(1e-1, 1e2, 2), (1e-2, 1e3, 5), (1e-3, 1e4, 10)]


def simulated(band, orders, duration):
    low, high, n = band
    law = dataclasses.replace(
        fp.paper_controller(),
        integral_order=orders[0],
        derivative_order=orders[1],
        design=fp.fractional.Crone(low, high, n),
    )
    return fp.simulate(fp.paper_experiment(duration=duration), law)


@pytest.mark.parametrize(
    ("band", "orders"), list(zip(BANDS, (PUBLISHED, LONG, PUBLISHED), strict=True)), ids=str
)
def test_the_experiment_runs_as_with_the_published_filter_in_series(band, orders):
    """Sections in series by matrix exponentials, against modes in parallel: rounding is left.

    The series loses the digits of (high/low)^mu, 600 to 20,000. Found over 5 s: at most
    9.5e-14 rad, 2.1e-12 of the torque, 3e-12 of a gain.
    """
    run = simulated(band, orders, 5.0)
    hand = closed_loop(
        OustaloupCascade(*band), step=1e-3, duration=5.0, orders=orders, corrected=True
    )
    assert np.abs(run.q - hand.q).max() < 1e-12
    assert np.abs(run.torque - hand.torque).max() < 2e-11 * np.abs(hand.torque).max()
    assert np.abs(run.s - hand.s).max() < 1e-11
    for gains, expected in zip((run.kp, run.ki, run.kd), hand.gains.swapaxes(0, 1), strict=True):
        assert np.abs(gains - expected).max() < 3e-11


def test_wider_filters_come_nearer_to_the_operator_of_the_paper_s_equations():
    """Each decade more at either end takes nine tenths of the difference away.

    Largest difference of the angles from the kernel integrated over the whole past, 4 s:
    5.2e-2, 5.4e-3, 5.5e-4 rad.
    """
    exact = closed_loop(ProductIntegration, step=1e-3, duration=4.0, corrected=True)
    gaps = np.array([np.abs(simulated(b, PUBLISHED, 4.0).q - exact.q).max() for b in BANDS])
    assert (gaps[1:] < gaps[:-1] / 7.0).all()
    assert gaps[-1] < 7e-4
