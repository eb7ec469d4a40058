import pickle

import numpy as np
import pytest

from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.fractional import (
    L1,
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
        assert type(copy) is type(design)
        assert repr(copy) == repr(design)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_coefficients_have_the_shape_of_the_orders(design):
    order = np.linspace(0.0, 1.0, 6).reshape(2, 3)
    c = design.coefficients(order, step=1e-2, horizon=1.0)
    assert c.weights.shape[1:] == (2, 3)
    assert np.isfinite(c.weights).all()
    assert np.array_equal(c.order, order)


@pytest.mark.parametrize("design", DESIGNS, ids=repr)
def test_a_design_starts_its_own_bank(design):
    bank = design.bank([0.3, 0.6], step=1e-2, horizon=1.0, initialisation="riemann_liouville")
    assert bank.design is design
    assert bank.shape == (2,)
    assert bank.update(np.ones(2), np.zeros(2)).shape == (2,)
