import exact_derivatives as exact
import mpmath as mp
import numpy as np
import pytest
from scipy import signal

from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional import Bank, Crone, RefinedOustaloup, frequency_response
from fpid_pin.fractional.interop import continuous_modes

STEP = 1e-3


@pytest.mark.parametrize("order", [0.05, 0.5, 0.93])
@pytest.mark.parametrize(("low", "high", "n"), [(1e-2, 1e3, 5), (1e-4, 1e4, 10), (0.3, 7.0, 1)])
def test_zeros_poles_and_gain_are_those_of_the_published_formula(low, high, n, order):
    zeros, poles, gain = Crone(low, high, n).zpk(order)
    with mp.workdps(30):
        for k in range(-n, n + 1):
            for found, sign in ((zeros, -1), (poles, 1)):
                exponent = (k + n + mp.mpf(1 + sign * mp.mpf(order)) / 2) / (2 * n + 1)
                want = -mp.mpf(low) * (mp.mpf(high) / mp.mpf(low)) ** exponent
                assert abs(found[k + n] / want - 1) < 1e-12
        assert abs(gain / mp.mpf(high) ** mp.mpf(order) - 1) < 1e-12


@pytest.mark.parametrize("order", [0.01, 0.3, 0.7, 0.99])
@pytest.mark.parametrize(
    "design", [Crone(1e-2, 1e3, 5), Crone(1e-4, 1e4, 10), RefinedOustaloup(1e-2, 1e3, 5)], ids=repr
)
def test_partial_fractions_equal_the_zeros_and_poles(design, order):
    poles, weights = continuous_modes(design, order, step=STEP, horizon=20.0)
    omega = np.geomspace(1e-5, 1e5, 60)
    s = 1j * omega[:, None]
    got = (weights * s / (s + poles)).sum(axis=1)
    want = signal.freqs_zpk(*design.zpk(order), omega)[1]
    assert np.abs(got / want - 1).max() < 1e-10


@pytest.mark.parametrize("order", [0.05, 0.5, 0.95])
def test_oustaloup_weights_are_positive_and_all_modes_decay(order):
    for n in (1, 5, 10, 30):
        c = Crone(1e-4, 1e4, n).coefficients(order, step=STEP, horizon=20.0)
        assert (c.weights > 0).all()
        assert c.poles[0] == 0.0
        assert (c.poles[1:] > 0).all()


@pytest.mark.parametrize("order", [0.3, 0.9])
def test_eight_decades_with_n_10_stay_stable_and_within_1e_minus_9_of_the_zpk_response(order):
    """The zpk product against sin(w t) f, inverted numerically from its Laplace transform."""
    design = Crone(1e-4, 1e4, 10)
    omega, samples = 3.0, 4001
    t = np.arange(samples) * STEP
    value, rate = np.sin(omega * t), omega * np.cos(omega * t)
    bank = Bank(design, order, step=STEP, horizon=4.0)
    got = exact.stream(bank, value, rate)
    zeros, poles, gain = design.zpk(order)
    with mp.workdps(40):
        zs, ps = [mp.mpf(z) for z in zeros], [mp.mpf(p) for p in poles]

        def transform(s):
            h = mp.mpf(gain)
            for z, p in zip(zs, ps, strict=True):
                h *= (s - z) / (s - p)
            return h * omega / (s * s + omega * omega)

        for k in (500, 2000, 4000):
            want = float(mp.invertlaplace(transform, mp.mpf(t[k]), method="talbot", degree=40))
            assert abs(got[k] - want) < 1e-9 * omega**order
    # Stable: left alone at f = 0 again, nothing grows over a million steps.
    decay = np.exp(poles * STEP)
    assert (decay < 1.0).all()


def test_widening_by_a_decade_removes_most_of_the_error_at_the_edges():
    edges = np.array([1e-2, 1e3])
    narrow, wide = (
        frequency_response(
            Crone(1e-2, 1e3, 5, w), 0.7, edges, step=1e-4, horizon=20.0
        ) / (1j * edges) ** 0.7
        for w in (0.0, 1.0)
    )  # fmt: skip
    assert (np.abs(np.angle(narrow, deg=True)) > 25).all()
    assert (np.abs(np.angle(wide, deg=True)) < 5).all()
    assert (np.abs(np.abs(narrow) - 1) > 0.2).all()
    assert (np.abs(np.abs(wide) - 1) < 0.06).all()


@pytest.mark.parametrize("order", [0.3, 0.6, 0.9])
def test_the_refined_filter_has_no_gain_bias_in_mid_band_as_the_published_one_has(order):
    design = RefinedOustaloup(1e-2, 1e3, 5)
    omega = np.geomspace(0.5, 20.0, 50)
    zeros, poles, gain = design.zpk(order)
    response = signal.freqs_zpk(zeros, poles, gain, omega)[1] / (1j * omega) ** order
    assert np.abs(np.log(np.abs(response))).mean() < 0.01
    # The published numerator and denominator, with its gain (d high/b)^alpha.
    b, d, low, high = 10.0, 9.0, 1e-2, 1e3
    k = np.arange(-5, 6)
    s = 1j * omega[:, None]
    z = low * (high / low) ** ((k + 5 + 0.5 * (1 - order)) / 11)
    p = low * (high / low) ** ((k + 5 + 0.5 * (1 + order)) / 11)
    s1 = s[:, 0]
    extra = (d * s1**2 + b * high * s1) / (d * (1 - order) * s1**2 + b * high * s1 + d * order)
    published = (d * high / b) ** order * extra * ((s + z) / (s + p)).prod(axis=1)
    ours = signal.freqs_zpk(zeros, poles, gain, omega)[1]
    assert np.allclose(ours / published, (b / d) ** order, rtol=1e-10, atol=0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"low": 10.0, "high": 1.0}, "band: expected low < high, got low = 10, high = 1"),
        ({"low": 0.0}, "low: expected a number > 0, got 0"),
        ({"n": 0}, "n: expected a whole number in"),
        ({"widening": -1.0}, "widening: expected a number in"),
    ],
)
@pytest.mark.parametrize("design", [Crone, RefinedOustaloup])
def test_bad_arguments_are_named(design, arguments, words):
    with pytest.raises(ArgumentError, match=words):
        design(**arguments)


def test_a_refined_filter_whose_poles_would_be_complex_is_refused():
    with pytest.raises(DesignError, match="upper end gives real poles"):
        Bank(RefinedOustaloup(1e-3, 0.5, 2), 0.5, step=STEP)


@pytest.mark.parametrize("order", [5e-324, 1e-16, 1e-6, 1 - 1e-6, 1 - 2**-53])
@pytest.mark.parametrize("design", [Crone(1e-2, 1e3, 5), RefinedOustaloup(1e-2, 1e3, 4)], ids=repr)
def test_orders_next_to_the_ends_are_filters_close_to_them(design, order):
    omega = np.array([1.0, 10.0])
    got = frequency_response(design, order, omega, step=STEP, horizon=20.0)
    assert np.abs(got / (1j * omega) ** order - 1).max() < 0.02
