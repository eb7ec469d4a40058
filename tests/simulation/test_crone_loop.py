"""The paper's own realisation, a CRONE filter, in the closed loop."""

import dataclasses

import numpy as np
import pytest
from paper_by_hand import LONG, PUBLISHED, OustaloupCascade, closed_loop

import fpid_pin as fp

BANDS = [(1e-1, 1e2, 2), (1e-2, 1e3, 5), (1e-3, 1e4, 10)]


@pytest.mark.parametrize(
    ("band", "orders"), list(zip(BANDS, (PUBLISHED, LONG, PUBLISHED), strict=True)), ids=str
)
def test_the_experiment_runs_as_with_the_published_filter_in_series(band, orders):
    """Sections in series by matrix exponentials, against modes in parallel: rounding is left.

    The series loses the digits of (high/low)^mu, 600 to 20,000. Found over 5 s: at most
    9.5e-14 rad, 2.1e-12 of the torque, 3e-12 of a gain.
    """
    law = dataclasses.replace(
        fp.paper_controller(), integral_order=orders[0], derivative_order=orders[1],
        design=fp.fractional.Crone(*band),
    )  # fmt: skip
    run = fp.simulate(fp.paper_experiment(duration=5.0), law)
    hand = closed_loop(
        OustaloupCascade(*band), step=1e-3, duration=5.0, orders=orders, corrected=True
    )
    assert np.abs(run.q - hand.q).max() < 1e-12
    assert np.abs(run.torque - hand.torque).max() < 2e-11 * np.abs(hand.torque).max()
    assert np.abs(run.s - hand.s).max() < 1e-11
    for gains, expected in zip((run.kp, run.ki, run.kd), hand.gains.swapaxes(0, 1), strict=True):
        assert np.abs(gains - expected).max() < 3e-11
