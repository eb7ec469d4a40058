"""The exported C, compiled strictly, gives the torques of the simulation."""

import dataclasses
import re
import shutil

import numpy as np
import pytest
from bounded import finished
from exported import OTHERS, PAPER, PLAIN, fpid, guarded_panda, random_law, simulated, write

import fpid_pin as fp
from fpid_pin.export import build

SANE = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g", "-O1")
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


COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]


def arm_of(name):
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    # Reached at times, so that what is held is held.
    return arm.with_limits(effort=20.0 + 1.5 * np.abs(arm.gravity_vector(arm.home)).max())


# On the UR5 the reserve is more than this step can promise, which is warned of.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("arm", ["two_link", "ur5"])
@pytest.mark.parametrize("name", [*PLAIN, *OTHERS])
def test_every_law_is_the_loops_in_double_and_nearly_in_float(
    name, arm, compiler, tmp_path, monkeypatch
):
    """Compiled strictly: a function that is printed but not used would be refused."""
    monkeypatch.setattr(build, "compiler", lambda: shutil.which(compiler))
    controller, arm = (PLAIN | OTHERS)[name], arm_of(arm)
    proof = write(controller, arm, STEP, 2000, tmp_path / "c")
    flags = SANE if arm.n == 2 and compiler == "gcc" else ()
    found, _ = torques(tmp_path / "c", tmp_path, flags)
    peak = np.abs(proof.torque).max()
    assert np.abs(found - proof.torque.ravel()).max() <= (0.0 if name in PLAIN else 1e-12 * peak)
    single, _ = torques(tmp_path / "c", tmp_path, ("-DFPID_SINGLE", "-O1"))
    assert 0.0 < np.abs(single - proof.torque.ravel()).max() < 1e-3 * peak
    if getattr(controller, "supervisor", None) is not None:
        bare = dataclasses.replace(controller, supervisor=None)
        alone = write(bare, arm, STEP, 2000, tmp_path / "bare").torque
        assert np.abs(alone - proof.torque).max() > 0.01 * peak, "the supervisor never acted"


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", ["quiet", "paper", "Slotine-Li", "own"])
def test_the_model_of_a_panda(name, tmp_path):
    proof = write(OTHERS[name], arm_of("panda"), STEP, 2000, tmp_path / "c")
    found, _ = torques(tmp_path / "c", tmp_path)
    peak = np.abs(proof.torque).max()
    assert np.abs(found - proof.torque.ravel()).max() <= 1e-12 * peak


def test_only_what_a_law_uses_is_printed(tmp_path):
    write(PLAIN["PID"], fp.Arm.two_link(), STEP, 2, tmp_path / "c")
    text = (tmp_path / "c" / "fpid.h").read_text() + (tmp_path / "c" / "fpid.c").read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    for word in ("body", "modes", "mass", "ipow", "solve_tree", "estimates"):
        assert word not in text


@pytest.mark.usefixtures("gcc")
def test_an_observer_beside_the_papers_supervisor_in_a_closed_loop(tmp_path):
    """Where torques have no effect, the two drive each other up: it takes a plant."""
    sharp = dataclasses.replace(PAPER, m_x=1.02)
    controller = fpid(observer=50.0, feedforward=True, supervisor=sharp)
    proof = simulated(controller)
    write(controller, fp.Arm.two_link(), STEP, 20_000, tmp_path / "c", proof)
    found, _ = torques(tmp_path / "c", tmp_path)
    assert np.abs(found - proof.torque.ravel()).max() < 1e-12 * np.abs(proof.torque).max()


@pytest.mark.usefixtures("gcc")
def test_the_example_compiles_and_comes_to_its_target(tmp_path):
    write(fpid(), fp.Arm.two_link(), STEP, 10, tmp_path / "c")
    program = tmp_path / "example"
    names = [str(tmp_path / "c" / f"{n}.c") for n in ("example", "fpid", "fpid_parameters")]
    finished([build.compiler(), *build.FLAGS, *names, "-o", str(program), "-lm"], check=True)
    said = finished([str(program)], check=True).stdout
    assert [abs(float(line.split()[4]) - 0.1) < 0.02 for line in said.splitlines()] == [True] * 2
