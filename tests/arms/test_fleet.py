"""Many arms in lockstep: the same numbers as one by one, the same bits however they are cut."""

import numpy as np
import pytest

from fpid_pin.arms import Arm, Fleet, fleet
from fpid_pin.exceptions import ArgumentError

METHODS = {
    "forward_dynamics": 3,
    "inverse_dynamics": 3,
    "gravity": 1,
    "coriolis": 2,
    "mass_times": 2,
    "inverse_mass_times": 2,
    "inverse_mass_matrix": 1,
}
RUNS = 64
every_method = pytest.mark.parametrize("method", METHODS)


def plants(name, kind):
    """64 plants: one arm, 64 different ones, or stretches of equal ones between different ones."""
    arm = Arm.two_link() if name == "two_link" else Arm.from_example(name)
    if kind == "same":
        return [arm] * RUNS
    rng = np.random.default_rng(1)
    arms = [arm.perturbed(rng, com=0.01, inertia=0.1) for _ in range(RUNS)]
    if kind == "mixed":
        arms[5:40] = [arms[5]] * 35
        arms[50:52] = [arm.with_gravity(3.7), arm.with_payload(0.5)]
    return arms


def inputs(n, method, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(RUNS, n)) for _ in range(METHODS[method])]


def compute(arms, method, arrays, armature=None):
    runs, n = arrays[0].shape
    shape = (runs, n, n) if method == "inverse_mass_matrix" else (runs, n)
    out = np.full(shape, np.nan)
    getattr(Fleet(arms, runs, armature=armature), method)(*arrays, out)
    return out


@every_method
@pytest.mark.parametrize("kind", ["same", "different", "mixed"])
@pytest.mark.parametrize("name", ["two_link", "panda"])
def test_same_bits_in_chunks_of_any_size(name, kind, method):
    arms = plants(name, kind)
    arrays = inputs(arms[0].n, method)
    armature = np.random.default_rng(2).uniform(0, 0.01, (RUNS, arms[0].n))
    whole = compute(arms, method, arrays, armature)
    for size in (1, 3, 17, 60):
        # Every chunk of the larger sizes, every fifth or so of the smaller.
        for start in range(0, RUNS, size * max(1, 6 // size)):
            rows = slice(start, start + size)
            part = compute(arms[rows], method, [a[rows] for a in arrays], armature[rows])
            assert np.array_equal(part, whole[rows])


def test_bits_do_not_depend_on_place_or_companions():
    arms = plants("panda", "different")
    arrays = inputs(7, "forward_dynamics")
    whole = compute(arms, "forward_dynamics", arrays)
    order = np.random.default_rng(3).permutation(RUNS)
    shuffled = [np.ascontiguousarray(a[order]) for a in arrays]
    assert np.array_equal(
        compute([arms[i] for i in order], "forward_dynamics", shuffled), whole[order]
    )


@pytest.mark.parametrize("size", [7, 16, 28, 100])
def test_bits_do_not_depend_on_the_forest_s_size(size, monkeypatch):
    arms = plants("panda", "different")
    arrays = inputs(7, "forward_dynamics")
    whole = compute(arms, "forward_dynamics", arrays)
    monkeypatch.setattr(fleet, "FOREST_SIZE", size)
    assert np.array_equal(compute(arms, "forward_dynamics", arrays), whole)


def test_one_plant_has_the_same_bits_alone_and_among_others():
    arms = plants("panda", "different")
    arrays = inputs(7, "forward_dynamics")
    among = compute(arms, "forward_dynamics", arrays)
    alone = compute([arms[9]] * RUNS, "forward_dynamics", arrays)
    assert np.array_equal(among[9], alone[9])


@pytest.mark.parametrize("kind", ["same", "mixed"])
@pytest.mark.parametrize("name", ["two_link", "panda", "talos_arm"])
def test_fleet_computes_what_the_arms_do(name, kind):
    arms = plants(name, kind)
    n = arms[0].n
    q, v, x = inputs(n, "forward_dynamics")
    truth = {
        "forward_dynamics": ((q, v, x), lambda a, k: a.forward_dynamics(q[k], v[k], x[k])),
        "inverse_dynamics": ((q, v, x), lambda a, k: a.inverse_dynamics(q[k], v[k], x[k])),
        "gravity": ((q,), lambda a, k: a.gravity_vector(q[k])),
        "coriolis": ((q, v), lambda a, k: a.coriolis_matrix(q[k], v[k]) @ v[k]),
        "mass_times": ((q, x), lambda a, k: a.mass_matrix(q[k]) @ x[k]),
        "inverse_mass_times": ((q, x), lambda a, k: np.linalg.solve(a.mass_matrix(q[k]), x[k])),
        "inverse_mass_matrix": ((q,), lambda a, k: np.linalg.inv(a.mass_matrix(q[k]))),
    }
    assert set(truth) == set(METHODS)
    for method, (arrays, one) in truth.items():
        expected = np.array([one(arm, k) for k, arm in enumerate(arms)])
        np.testing.assert_allclose(compute(arms, method, arrays), expected, rtol=1e-7, atol=1e-9)


def test_armature_is_added_to_the_mass_matrix_and_not_to_the_arm():
    arm = Arm.from_example("talos_arm")
    before = arm.armature.copy()
    q, x = inputs(7, "mass_times")
    extra = np.linspace(0.0, 0.3, 7)
    with_it = compute([arm], "mass_times", (q, x), extra)
    without = compute([arm], "mass_times", (q, x))
    np.testing.assert_allclose(with_it - without, extra * x, atol=1e-12)
    assert np.array_equal(arm.armature, before)


def test_inverse_mass_matrix_of_some_runs():
    arms = plants("panda", "different")
    (q,) = inputs(7, "inverse_mass_matrix")
    whole = compute(arms, "inverse_mass_matrix", (q,))
    rows = np.array([3, 40, 7])
    some = np.empty((3, 7, 7))
    Fleet(arms, RUNS).inverse_mass_matrix(q, some, rows=rows)
    assert np.array_equal(some, whole[rows])
    assert np.array_equal(whole, whole.transpose(0, 2, 1))


def test_output_may_be_an_input():
    for kind in ("same", "different"):
        arms = plants("two_link", kind)
        q, v, tau = inputs(2, "forward_dynamics")
        expected = compute(arms, "forward_dynamics", (q, v, tau))
        Fleet(arms, RUNS).forward_dynamics(q, v, tau, tau)
        assert np.array_equal(tau, expected)


def test_equal_arms_share_one_model():
    arm = Arm.from_example("ur5")
    arms = [Arm.from_example("ur5") for _ in range(3)] + [arm.with_friction(dry=1.0)]
    assert len(Fleet(arms, 4)._models) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda a, b: Fleet([a, a], 3), r"arms: expected 1 or 3 \(one a run\), got 2"),
        (lambda a, b: Fleet([a, b], 2), r"same number of joints in all runs, got \[2, 6\]"),
        (lambda a, b: Fleet([], 1), r"arms: expected 1 or 1"),
        (lambda a, b: Fleet(["ur5"], 1), "arms: expected arms, got str"),
        (lambda a, b: Fleet([a], 0), "runs: expected a whole number >= 1, got 0"),
        (lambda a, b: Fleet([a], 2, armature=[1, 2, 3]), r"armature: expected shape \(2,\) or"),
        (lambda a, b: Fleet([a], 2, armature=-1.0), r"armature: expected a number >= 0"),
    ],
)
def test_bad_fleets_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make(Arm.two_link(), Arm.from_example("ur5"))


def test_wrong_arrays_are_refused_before_pinocchio_reads_beyond_them():
    fleet_of_two = Fleet([Arm.two_link()], 2)
    good = np.zeros((2, 2))
    for k in range(4):
        arrays = [good.copy() for _ in range(4)]
        arrays[k] = np.zeros((1, 2))
        with pytest.raises(ArgumentError, match=r"shape \(2, 2\)"):
            fleet_of_two.forward_dynamics(*arrays)
    for out in (np.zeros((2, 2), order="F"), np.zeros((2, 2), dtype=np.float32)):
        with pytest.raises(ArgumentError, match="out: expected a C-contiguous float64 array"):
            fleet_of_two.forward_dynamics(good, good, good, out)
    with pytest.raises(ArgumentError, match=r"\(2, 2, 2\)"):
        fleet_of_two.inverse_mass_matrix(good, good)
