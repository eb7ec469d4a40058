"""How long a run is must not be felt before it ends: one fit of the operator up to 20 s."""

import numpy as np
import pytest

import fpid_pin as fp

NAMES = ("t", "q", "v", "torque", "kp", "ki", "kd", "s", "lyapunov")


@pytest.mark.parametrize(
    ("orders", "short", "long", "dynamics"),
    [("symbol", 1.0, 2.0, "pinocchio"), ("symbol", 5.0, 20.0, "compiled"),
     ("sign", 0.01, 20.0, "compiled"), ("integer", 1.0, 2.0, "compiled")],
)  # fmt: skip
def test_two_durations_agree_to_the_bit_where_both_run(orders, short, long, dynamics):
    """No tolerance: up to the shorter's end they are the same arithmetic on the same numbers."""
    law = fp.paper_controller(orders)
    one, other = (
        fp.simulate(fp.paper_experiment(duration=d).with_dynamics(dynamics), law)
        for d in (short, long)
    )
    rows = len(one.t)
    assert rows == round(short / one.step) + 1
    for name in NAMES:
        first, second = getattr(one, name), getattr(other, name)[:rows]
        away = np.abs(first - second).max()
        assert np.array_equal(first, second), f"{name}: up to {away:.2g} apart"
