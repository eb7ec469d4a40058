"""What all designs have in common, and the filters."""

import pickle
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import pytest
from scipy import signal

from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import Bank, Crone, Design, ExponentialSum
from fpid_pin.fractional.design import modes_of

STEP = 1e-3
DESIGNS = [
    ExponentialSum(),
    ExponentialSum(tolerance=1e-6),
    Crone(0.1, 100.0, 3, 0.5),
]


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_a_design_survives_its_table_and_pickling_and_takes_orders_of_any_shape(design):
    for copy in (from_dict(to_dict(design), Design), pickle.loads(pickle.dumps(design))):
        assert copy == design
        assert hash(copy) == hash(design)
        assert repr(copy) == repr(design)
    assert [design == other for other in DESIGNS].count(True) == 1
    order = np.linspace(0.0, 1.0, 6).reshape(2, 3)
    weights = design.coefficients(order, step=1e-2, horizon=1.0).weights
    assert weights.shape[1:] == (2, 3)
    assert np.isfinite(weights).all()


def test_a_design_of_ones_own_is_equal_to_itself_or_as_it_says():
    class Plain(Design):
        def coefficients(self, order, *, step, horizon):
            return ExponentialSum(8).coefficients(order, step=step, horizon=horizon)

    @dataclass(frozen=True)
    class Sized(Plain):
        size: int

    one = Plain()
    assert one == one
    assert one != Plain()
    assert Sized(3) == Sized(3)
    assert hash(Sized(3)) == hash(Sized(3))
    assert Sized(3) != Sized(4)
    own, built_in = (Bank(d, 0.5, step=1e-2, horizon=1.0) for d in (one, ExponentialSum(8)))
    for k in range(20):
        assert own.update(np.sin(k), np.cos(k)) == built_in.update(np.sin(k), np.cos(k))


@pytest.mark.parametrize("order", [0.05, 0.5, 0.93])
@pytest.mark.parametrize(("low", "high", "n"), [(1e-2, 1e3, 5), (1e-4, 1e4, 10), (0.3, 7.0, 1)])
def test_a_filter_is_that_of_the_published_formula_and_its_modes_are_the_same(low, high, n, order):
    design = Crone(low, high, n)
    zeros, poles, gain = design.zpk(order)
    with mp.workdps(30):
        for k in range(-n, n + 1):
            for found, sign in ((zeros, -1), (poles, 1)):
                exponent = (k + n + mp.mpf(1 + sign * mp.mpf(order)) / 2) / (2 * n + 1)
                want = -mp.mpf(low) * (mp.mpf(high) / mp.mpf(low)) ** exponent
                assert abs(found[k + n] / want - 1) < 1e-12
        assert abs(gain / mp.mpf(high) ** mp.mpf(order) - 1) < 1e-12
    modes = design.coefficients(order, step=STEP, horizon=20.0)
    p, weights = modes.poles, modes.weights
    assert (weights > 0).all()
    assert p[0] == 0.0
    assert (p[1:] > 0).all()
    omega = np.geomspace(1e-5, 1e5, 60)
    s = 1j * omega[:, None]
    got = (weights * s / (s + p)).sum(axis=1)
    assert np.abs(got / signal.freqs_zpk(zeros, poles, gain, omega)[1] - 1).max() < 1e-10


def test_widening_by_a_decade_removes_most_of_the_error_at_the_edges():
    edges = np.array([1e-2, 1e3])
    narrow, wide = (
        modes_of(Crone(1e-2, 1e3, 5, w), 0.7, step=1e-4, horizon=20.0).response(edges)
        / (1j * edges) ** 0.7
        for w in (0.0, 1.0)
    )
    assert (np.abs(np.angle(narrow, deg=True)) > 25).all()
    assert (np.abs(np.angle(wide, deg=True)) < 5).all()
    assert (np.abs(np.abs(narrow) - 1) > 0.2).all()
    assert (np.abs(np.abs(wide) - 1) < 0.06).all()


def test_orders_next_to_the_ends_are_filters_close_to_them():
    order, omega = np.array([5e-324, 1e-16, 1e-6, 1 - 1e-6, 1 - 2**-53]), np.array([1.0, 10.0])
    got = modes_of(Crone(1e-2, 1e3, 5), order, step=STEP, horizon=20.0).response(omega)
    assert np.abs(got / (1j * omega[:, None]) ** order - 1).max() < 0.02


@pytest.mark.parametrize(
    ("design", "arguments", "words"),
    [
        (Crone, {"low": 10.0, "high": 1.0}, "band: expected low < high, got low = 10, high = 1"),
        (ExponentialSum, {"modes": 0}, r"modes: expected a whole number in \[1, 128\], got 0"),
        (ExponentialSum, {"modes": 3, "tolerance": 1e-3}, "either modes or tolerance, got both"),
    ],
)
def test_bad_arguments_are_named(design, arguments, words):
    with pytest.raises(ArgumentError, match=words):
        design(**arguments)
