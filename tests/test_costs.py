"""Metrics and costs of a trajectory: closed forms, and what a full record says."""

import dataclasses
import pickle

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.costs import FromRows, MetricCost, SettlingCost, ToolCost
from fpid_pin.descriptions import from_dict, to_dict
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import cost_of, metrics_of

ARM = fp.Arm.two_link().with_limits(effort=(10.0, np.inf))
STEP = 1e-3


def made(error, torque, arm=ARM):
    """Return a run with this error and torque, (N, n) both; the last row is not counted."""
    return fp.Run.from_arrays(
        STEP * np.arange(len(error)), -error, np.zeros_like(error), torque, arm=arm
    )


T = STEP * np.arange(5001)
#: e^(-2t) cos(6t) has its largest opposite value where its derivative is 0 first; e^(-t) has none.
RINGING = np.stack([np.exp(-2 * T) * np.cos(6 * T), np.exp(-T)], axis=1)


def test_overshoot_of_a_damped_oscillation():
    at = (np.pi - np.arctan(1 / 3)) / 6  # tan(6t) = -1/3, beyond the first zero
    m = made(RINGING, np.zeros((5001, 2))).metrics
    assert m.overshoot == pytest.approx([-np.exp(-2 * at) * np.cos(6 * at), 0.0], abs=1e-5)
    assert m.peak_error.tolist() == [1.0, 1.0]
    assert (made(-RINGING, np.zeros((5001, 2))).metrics.overshoot == m.overshoot).all()


def test_a_joint_that_starts_within_the_band_has_nothing_to_overshoot():
    error = np.stack([0.005 + T, 0.02 - T], axis=1)
    m = made(error, np.zeros_like(error)).metrics
    assert m.overshoot == pytest.approx([0.0, T[-2] - 0.02])


@pytest.mark.parametrize("band", [0.01, 0.05])
def test_settling_time_of_an_exponential(band):
    m = metrics_of(made(RINGING, np.zeros((5001, 2))), band=band)
    expected = np.log(1 / band)
    assert m.settling_time[1] == pytest.approx(expected, abs=1.01 * STEP)
    e = np.abs(RINGING[:-1, 0])
    assert m.settling_time[0] == pytest.approx(STEP * (np.flatnonzero(e > band)[-1] + 1))


def test_what_stays_within_the_band_settles_at_once_and_what_leaves_it_never():
    error = np.stack([np.full(5001, 0.009), 1e-2 * T], axis=1)
    assert made(error, 0 * error).metrics.settling_time.tolist() == [0.0, np.inf]


def test_share_of_time_at_the_torque_s_limit():
    torque = np.clip(20.0 * np.sin(2 * np.pi * T), -10.0, 10.0)
    m = made(RINGING, np.stack([torque, torque], axis=1)).metrics
    # |20 sin| >= 10 for two thirds of a period.
    assert m.saturated == pytest.approx([2 / 3, 0.0], abs=2e-3)


def test_a_drive_s_limit_counts_where_it_is_the_lower_one():
    arm = fp.Arm.two_link()
    plant = fp.Plant(effort_limit=(3.0, 2.0))
    run = fp.simulate(
        dataclasses.replace(fp.paper_experiment(duration=0.5), plant=plant), fp.paper_controller()
    )
    at = np.abs(run.torque[:-1]) >= [3.0, 2.0]
    assert run.metrics.saturated == pytest.approx(at.mean(axis=0))
    assert at.any()
    assert (plant.effort_limit < arm.effort_limit).all()


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.paper_experiment(duration=1.5), fp.paper_controller())


def test_tool_error_is_that_of_plane_trigonometry(run):
    """The paper's arm: links of 1 and 0.8 m; angles from x, the second relative to the first."""

    def tip(q):
        a, b = q[:, 0], q.sum(axis=1)
        return np.stack([np.cos(a) + 0.8 * np.cos(b), np.sin(a) + 0.8 * np.sin(b)], axis=1)

    far = np.linalg.norm(tip(run.q) - tip(run.q_ref), axis=1)
    assert run.tool_error == pytest.approx(far, abs=1e-12)
    assert cost_of(run, ToolCost()) == pytest.approx(np.sqrt((far[:-1] ** 2).mean()), rel=1e-9)
    assert cost_of(run, ToolCost("peak")) == pytest.approx(far[:-1].max(), rel=1e-9)


def test_settling_cost_is_the_slowest_joint_s_and_the_duration_where_none_comes():
    settled = made(RINGING, np.zeros((5001, 2)))
    assert cost_of(settled, SettlingCost()) == settled.metrics.settling_time.max()
    assert cost_of(settled, SettlingCost(band=1e-4)) == pytest.approx(5.0)


def weigh(state, rows):
    return state + rows.step * float((rows.error**2).sum())


def longest(state, rows):
    state[0] = max(state[0], float(np.abs(rows.signals["u_fpid"]).max()))
    state[1] += len(rows.t)
    return state


def first_of(state):
    return state[0]


ISE = FromRows(0.0, weigh)
PEAK = FromRows([0.0, 0], longest, first_of, signals="u_fpid")
COSTS = [
    ISE,
    MetricCost("ise"),
    PEAK,
    ToolCost(),
    SettlingCost(),
    MetricCost("rms", joints="worst"),
]


def test_a_cost_of_rows_is_what_the_record_says(run):
    assert cost_of(run, ISE) == pytest.approx(run.metrics.ise.sum(), rel=1e-12)
    assert cost_of(run, PEAK) == np.abs(run.u_fpid[:-1]).max()
    assert PEAK.start == [0.0, 0]  # each run had a copy


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FromRows(0.0, 5), "cost.step: expected a function, got 5"),
        (lambda: ToolCost("mean"), "cost.measure: expected one of rms, peak, got 'mean'"),
        (lambda: MetricCost("rms", joints="all"), "cost.joints: expected one of sum, worst, rms"),
        (lambda: ISE.of(None), r"cost: expected a run \(simulation.cost_of\) or evaluate"),
        (lambda: cost_of(made(RINGING, RINGING), FromRows("a", longest_text)),
         "cost: expected a number, got str"),
    ],
)  # fmt: skip
def test_what_is_no_cost_is_told_in_one_line(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def longest_text(state, rows):
    return state


def test_costs_survive_a_pickle_and_those_built_in_a_table():
    for cost in COSTS:
        assert repr(pickle.loads(pickle.dumps(cost))) == repr(cost)
    for cost in (ToolCost("peak"), SettlingCost(0.02), MetricCost("overshoot", joints="worst")):
        assert to_dict(from_dict(to_dict(cost), fp.costs.Cost)) == to_dict(cost)
    assert to_dict(ISE)["repr"] == f"FromRows(0.0, {__name__}.weigh, None, ())"


def test_joints_are_summed_squared_or_the_worst_one_counts(run):
    rms = run.metrics.rms
    assert MetricCost("rms").of(run.metrics) == pytest.approx(rms.sum())
    assert MetricCost("rms", joints="worst").of(run.metrics) == rms.max()
    weighted = MetricCost("rms", joint_weights=(1.0, 5.0), joints="worst")
    assert weighted.of(run.metrics) == (rms * [1.0, 5.0]).max()
    assert MetricCost("rms", joints="rms").of(run.metrics) == pytest.approx((rms**2).mean() ** 0.5)
