import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.fractional import (
    L1,
    Bank,
    Crone,
    Design,
    ExponentialSum,
    GrunwaldLetnikov,
    RefinedOustaloup,
)

DESIGNS = [
    ExponentialSum(),
    ExponentialSum(tolerance=1e-6),
    Crone(0.1, 100.0, 3, 0.5),
    RefinedOustaloup(0.1, 100.0, 3),
    GrunwaldLetnikov(),
    GrunwaldLetnikov(memory=0.5),
    L1(),
]


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_a_design_survives_its_table_and_pickling(design):
    for copy in (from_dict(to_dict(design), Design), pickle.loads(pickle.dumps(design))):
        assert copy == design
        assert hash(copy) == hash(design)
        assert repr(copy) == repr(design)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_coefficients_have_the_shape_of_the_orders(design):
    order = np.linspace(0.0, 1.0, 6).reshape(2, 3)
    c = design.coefficients(order, step=1e-2, horizon=1.0)
    assert c.weights.shape[1:] == (2, 3)
    assert np.isfinite(c.weights).all()
    assert np.array_equal(c.order, order)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_a_bank_starts_from_any_design(design):
    bank = Bank(design, [0.3, 0.6], step=1e-2, horizon=1.0, initialisation="riemann_liouville")
    assert bank.design is design
    assert bank.shape == (2,)
    assert bank.update(np.ones(2), np.zeros(2)).shape == (2,)


def test_designs_are_equal_where_kind_and_fields_are():
    for k, one in enumerate(DESIGNS):
        assert [one == other for other in DESIGNS] == [k == j for j in range(len(DESIGNS))]
    assert ExponentialSum(24) == ExponentialSum()
    assert Crone(1, 10, 2) == Crone(1.0, 10.0, 2)
    assert L1(memory=1) == L1(1.0)
    assert len({GrunwaldLetnikov(), GrunwaldLetnikov(), L1(), Crone(), RefinedOustaloup()}) == 4


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
    assert hash(one) != hash(Plain())
    assert Sized(3) == Sized(3)
    assert hash(Sized(3)) == hash(Sized(3))
    assert Sized(3) != Sized(4)
    bank = Bank(one, 0.5, step=1e-2, horizon=1.0)
    other = Bank(ExponentialSum(8), 0.5, step=1e-2, horizon=1.0)
    for k in range(20):
        assert bank.update(np.sin(k), np.cos(k)) == other.update(np.sin(k), np.cos(k))
