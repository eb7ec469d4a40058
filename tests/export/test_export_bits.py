"""The exported C, compiled strictly, gives the torques of the simulation."""

import dataclasses

import numpy as np
import pytest
from bounded import finished
from exported import guarded_panda, random_law, simulated, write

import fpid_pin as fp
from fpid_pin.export import build

SANE = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g")
STEP = 1e-3


def torques(folder, tmp_path, flags=()):
    program = build.compile_check(folder, tmp_path / "check", flags)
    found = build.compare(program, folder / "vectors.bin", tmp_path / "torques.bin")
    return np.fromfile(tmp_path / "torques.bin"), found


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("flags", [(), SANE], ids=["optimised", "sanitised"])
@pytest.mark.parametrize("which", ["paper", "supervised", "panda"])
def test_twenty_thousand_ticks_are_equal_to_the_last_bit(which, flags, tmp_path):
    if which == "panda":
        controller, arm = guarded_panda()
        proof = write(controller, arm, STEP, 20_000, tmp_path / "c")
        limited = np.abs(proof.torque) == arm.effort_limit
        assert limited.any(axis=0).all()
        assert not limited.all(axis=0).any()
    else:
        # The supervisor stands by, all through the paper's experiment.
        controller, arm = fp.paper_controller(supervised=which == "supervised"), fp.Arm.two_link()
        proof = simulated(controller)
        write(controller, arm, STEP, 20_000, tmp_path / "c", proof)
    assert len(proof.torque) >= 20_000
    found, _ = torques(tmp_path / "c", tmp_path, flags)
    assert np.array_equal(found, proof.torque.ravel())


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("seed", range(30))
def test_random_laws_are_equal_to_the_last_bit(seed, tmp_path):
    proof = write(*random_law(seed), 3000, tmp_path / "c")
    assert np.isfinite(proof.torque).all()
    found, _ = torques(tmp_path / "c", tmp_path, SANE if seed % 10 == 0 else ())
    assert np.array_equal(found, proof.torque.ravel())


def law_with(**others):
    return fp.AdaptiveFpid(
        kp=60.0, ki=30.0, kd=12.0, integral_order=0.9, derivative_order=0.8, learning_rate=2.0,
        **others,
    )  # fmt: skip


PAPER = fp.Supervisor(m_x=1.1, reference_bound=1.0, kind="paper", disturbance_bound=0.5)
WITH_MODEL = {
    "computed torque": fp.ComputedTorque(k0=100.0, k1=20.0),
    "feedforward": law_with(feedforward=True),
    "observer": law_with(observer=80.0),
    "quiet": law_with(feedforward=True, observer=100.0, supervisor=fp.Supervisor.quiet(1.3, 1.0)),
    "reserve": law_with(supervisor=fp.Supervisor(1.2, 1.0, disturbance_bound=0.3, lookahead=0.01)),
    "paper": law_with(supervisor=PAPER),
    "paper, ramped": law_with(
        supervisor=dataclasses.replace(PAPER, gravity_bound=30.0, boundary_layer=0.5)
    ),
}


# On the UR5 the reserve is more than this step can promise, which is warned of.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize(
    ("name", "arm"),
    [
        ("computed torque", "panda"), ("feedforward", "two_link"), ("observer", "ur5"),
        ("quiet", "two_link"), ("quiet", "panda"), ("quiet", "ur5"), ("reserve", "ur5"),
        ("paper", "two_link"), ("paper", "ur5"), ("paper", "panda"), ("paper, ramped", "two_link"),
    ],
)  # fmt: skip
def test_with_the_model_torques_are_within_1e_12_of_the_largest(name, arm, tmp_path):
    arm = fp.Arm.two_link() if arm == "two_link" else fp.Arm.from_example(arm)
    controller = WITH_MODEL[name]
    proof = write(controller, arm, STEP, 2000, tmp_path / "c")
    found, _ = torques(tmp_path / "c", tmp_path, SANE if arm.n == 6 else ())
    peak = np.abs(proof.torque).max()
    assert np.abs(found - proof.torque.ravel()).max() < 1e-12 * peak
    if getattr(controller, "supervisor", None) is not None:
        bare = dataclasses.replace(controller, supervisor=None)
        alone = write(bare, arm, STEP, 2000, tmp_path / "bare").torque
        assert np.abs(alone - proof.torque).max() > 0.01 * peak, "the supervisor never acted"


@pytest.mark.usefixtures("gcc")
def test_an_observer_beside_the_papers_supervisor_in_a_closed_loop(tmp_path):
    """Where torques have no effect, the two drive each other up: it takes a plant."""
    sharp = dataclasses.replace(PAPER, m_x=1.02)
    controller = law_with(observer=50.0, feedforward=True, supervisor=sharp)
    proof = simulated(controller)
    write(controller, fp.Arm.two_link(), STEP, 20_000, tmp_path / "c", proof)
    found, _ = torques(tmp_path / "c", tmp_path)
    assert np.abs(found - proof.torque.ravel()).max() < 1e-12 * np.abs(proof.torque).max()


@pytest.mark.usefixtures("gcc")
def test_float_compiles_as_strictly_and_is_nearly_the_same(tmp_path):
    for name, controller in (("law", law_with()), ("model", WITH_MODEL["quiet"])):
        folder = tmp_path / name
        proof = write(controller, fp.Arm.from_example("ur5"), STEP, 2000, folder)
        found, _ = torques(folder, tmp_path, ("-DFPID_SINGLE", *SANE))
        error = np.abs(found - proof.torque.ravel()).max() / np.abs(proof.torque).max()
        assert 0.0 < error < 1e-3


@pytest.mark.usefixtures("gcc")
def test_the_example_compiles_and_comes_to_its_target(tmp_path):
    write(law_with(), fp.Arm.two_link(), STEP, 10, tmp_path / "c")
    program = tmp_path / "example"
    names = [str(tmp_path / "c" / f"{n}.c") for n in ("example", "fpid", "fpid_parameters")]
    finished([build.compiler(), *build.FLAGS, *names, "-o", str(program), "-lm"], check=True)
    said = finished([str(program)], check=True).stdout
    assert [abs(float(line.split()[4]) - 0.1) < 0.02 for line in said.splitlines()] == [True] * 2
