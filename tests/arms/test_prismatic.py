"""Joints that slide: metres and newtons, on an arm whose equations fit on a page."""

import numpy as np
import pytest
from robots import joint, link, robot, write

import fpid_pin as fp
from fpid_pin.arms import Arm
from fpid_pin.simulation import limit_report
from fpid_pin.view.shapes import stage

M, INERTIA, CARRIER, G = 1.5, 0.02, 0.3, 9.81
#: A carrier turns about -y (x towards z), with its inertia about the joint; a mass slides along it.
SLIDES = '<limit lower="0.2" upper="1" effort="40" velocity="0.5"/>'
URDF = robot(
    link("base"), link("carrier", 1.0, CARRIER), link("load", M, INERTIA),
    joint("turn", "base", "carrier", axis="0 -1 0", origin="0 0 0",
          extra='<limit lower="-2" upper="2" effort="60" velocity="3"/>'),
    joint("slide", "carrier", "load", "prismatic", SLIDES, "2 0 0", origin="0 0 0"),
)  # fmt: skip
Q, V, A = np.array([0.6, 0.7]), np.array([0.9, -0.4]), np.array([1.3, 2.1])


@pytest.fixture
def crane(tmp_path):
    return Arm.from_urdf(write(tmp_path, URDF))


def by_hand(q, v, a):
    """Torque of the joint that turns [N m] and force of the one that slides [N]."""
    (angle, r), (w, speed) = q, v
    inertia = CARRIER + INERTIA + M * r**2
    torque = inertia * a[0] + 2.0 * M * r * speed * w + M * G * r * np.cos(angle)
    force = M * a[1] - M * r * w**2 + M * G * np.sin(angle)
    return [torque, force]


def test_its_equations_are_those_on_paper(crane):
    assert crane.inverse_dynamics(Q, V, A) == pytest.approx(by_hand(Q, V, A), rel=1e-12)
    assert crane.forward_dynamics(Q, V, by_hand(Q, V, A)) == pytest.approx(A, rel=1e-12)


@pytest.mark.parametrize("dynamics", ["pinocchio", "compiled"])
def test_laws_follow_with_it_and_its_run_can_be_rebuilt(crane, tmp_path, dynamics):
    reference = fp.references.Sinusoid(amplitude=[0.3, 0.1], offset=crane.home)
    experiment = fp.Experiment(crane, reference, duration=2.0, dynamics=dynamics)
    laws = [fp.ComputedTorque(k0=100.0, k1=20.0), fp.suggest_gains(crane)]
    exact, adaptive = fp.simulate(experiment, laws)
    assert exact.metrics.rms_tail.max() < 2e-3
    assert (adaptive.metrics.rms_tail < (0.05, 0.02)).all()
    adaptive.save(tmp_path / "run.npz")
    assert fp.Run.load(tmp_path / "run.npz").arm == crane


def test_limits_that_are_passed_are_told_in_its_units(crane):
    reference = fp.references.Sinusoid(amplitude=[0.0, 0.5], offset=crane.home, frequency=3.0)
    experiment = fp.Experiment(crane, reference, duration=3.0)
    lines = [str(x) for x in limit_report(fp.simulate(experiment, fp.suggest_gains(crane)))]
    assert any(
        line.startswith("slide: beyond its upper position limit of 1 m at") for line in lines
    )
    assert any(line.startswith("slide: beyond its velocity limit of 0.5 m/s at") for line in lines)
    assert not any("rad" in line for line in lines)


@pytest.mark.parametrize(
    ("axes", "planar"),
    [(("1 0 0", "1 1 1"), True), (("1 0 0", "0 1 0", "0 0 1"), False), (("0 0 1",), True)],
)  # fmt: skip
def test_gantries_are_looked_at_across_their_plane(tmp_path, axes, planar):
    parts = [link(f"l{k}") for k in range(len(axes) + 1)]
    for k, axis in enumerate(axes):
        parts.append(joint(f"j{k}", f"l{k}", f"l{k + 1}", "prismatic", SLIDES, axis, "0 0 0"))
    arm = Arm.from_urdf(write(tmp_path, robot(*parts)))
    found = stage([arm], [np.array([arm.lower, arm.upper])])
    assert found.planar is planar
    assert np.isfinite(found.extent).all()
