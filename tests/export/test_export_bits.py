"""The exported C, compiled strictly, and the JavaScript give the torques of the simulation."""

import dataclasses
import re
import shutil

import numpy as np
import pytest
from bounded import finished
from exported import (
    CHAOTIC,
    HORIZON,
    OTHERS,
    PLAIN,
    arm_of,
    fpid,
    random_law,
    recorded,
    simulated_by,
    write,
)

import fpid_pin as fp
from fpid_pin.export import build, javascript
from fpid_pin.export.kinds import INT, bundle, real, words
from fpid_pin.export.law import by_name, start
from fpid_pin.export.printer import Program
from fpid_pin.kernels import tick

SANE = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g", "-O1")
LAWS = PLAIN | OTHERS


def torques(folder, flags=()):
    """Return what the compiled C answers to the vectors; it restarts half way."""
    program = build.compile_check(folder, folder / "check", flags)
    build.check(program, folder / "vectors.bin", folder / "torques.bin")
    return np.fromfile(folder / "torques.bin")


def off(found, proof):
    """Return the largest difference of torques, as a part of the largest torque."""
    return np.abs(found - proof.torque.ravel()).max() / np.abs(proof.torque).max()


# On the larger arms the reserve is more than this step can promise, which is warned of.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("robot", ["two_link", "ur5", "panda"])
@pytest.mark.parametrize("name", LAWS)
def test_every_law_is_the_loops_over_twenty_thousand_ticks(
    name, robot, tmp_path, monkeypatch, node
):
    """Strictly compiled: a function that is printed but not used would be refused."""
    controller = LAWS[name]
    arm = arm_of(robot, controller)
    proof = recorded(controller, arm, 20_000)
    limited = np.abs(proof.torque) == arm.effort_limit
    assert limited.any()
    assert not limited.all()
    folder, most = write(controller, arm, tmp_path / "c", proof), 0.0 if name in PLAIN else 1e-12
    if robot == "two_link":
        # In single precision, too.
        single = torques(folder, ("-DFPID_SINGLE", "-O1"))[: 2000 * arm.n]
        first = proof.torque.ravel()[: single.size]
        assert 0.0 < np.abs(single - first).max() < 1e-3 * np.abs(first).max()
    if robot == "ur5" and shutil.which("clang"):
        monkeypatch.setattr(build, "compiler", lambda: shutil.which("clang"))
    assert off(torques(folder, SANE if robot == "ur5" else ()), proof) <= most
    if robot == "ur5":
        found = in_node(node, tmp_path, controller, arm, proof.inputs[:2000])
        assert np.abs(found - proof.torque[:2000]).max() <= most * np.abs(proof.torque).max()
    if getattr(controller, "supervisor", None) is not None and robot == "two_link":
        bare = recorded(dataclasses.replace(controller, supervisor=None), arm, 2000).torque
        assert off(bare.ravel(), proof._replace(torque=proof.torque[:2000])) > 0.01


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", CHAOTIC)
def test_laws_that_are_chaotic_on_prescribed_inputs_in_a_closed_loop(name, tmp_path):
    controller, arm = CHAOTIC[name], fp.Arm.two_link()
    proof = simulated_by(controller)
    assert len(proof.torque) >= 20_000
    assert off(torques(write(controller, arm, tmp_path / "c", proof)), proof) <= 1e-12


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("seed", range(10))
def test_random_laws_are_equal_to_the_last_bit(seed, tmp_path, node):
    controller, arm, step = random_law(seed)
    proof = recorded(controller, arm, 3000, step)
    assert np.isfinite(proof.torque).all()
    folder = write(controller, arm, tmp_path / "c", proof, step)
    assert np.array_equal(torques(folder), proof.torque.ravel())
    found = in_node(node, tmp_path, controller, arm, proof.inputs, step)
    assert np.array_equal(found, proof.torque)


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("supervised", [False, True])
def test_the_papers_experiment_has_the_same_bits_in_c_and_javascript(supervised, tmp_path, node):
    # The supervisor stands by, all through the experiment.
    controller, arm = fp.paper_controller(supervised=supervised), fp.Arm.two_link()
    proof = simulated_by(controller)
    folder = write(controller, arm, tmp_path / "c", proof)
    assert np.array_equal(torques(folder), proof.torque.ravel())
    if not supervised:
        found = in_node(node, tmp_path, controller, arm, proof.inputs)
        assert np.array_equal(found, proof.torque)


@pytest.mark.usefixtures("gcc")
@pytest.mark.parametrize("name", ["FPID, quiet", "Slotine-Li"])
def test_valgrind_finds_no_read_of_what_was_not_written(name, tmp_path):
    if shutil.which("valgrind") is None:
        pytest.skip("no valgrind")
    controller, arm = LAWS[name], fp.Arm.from_example("ur5")
    folder = write(controller, arm, tmp_path / "c", recorded(controller, arm, 200))
    program = build.compile_check(folder, folder / "check", ("-g",))
    command = ["valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full"]
    done = finished([*command, str(program), str(folder / "vectors.bin")])
    assert done.returncode == 0, done.stderr


@pytest.mark.usefixtures("gcc")
def test_with_32_bits_and_sse_the_bits_are_the_same(tmp_path):
    controller, arm = PLAIN["FPID"], fp.Arm.two_link()
    proof = recorded(controller, arm, 20_000)
    folder, flags = (
        write(controller, arm, tmp_path / "c", proof),
        ("-m32", "-msse2", "-mfpmath=sse"),
    )
    (folder / "none.c").write_text("#include <math.h>\nint main(void) { return 0; }\n")
    wanted = [build.compiler(), *flags, str(folder / "none.c"), "-o", str(folder / "none")]
    if finished(wanted).returncode:
        pytest.skip("the compiler has no libraries of 32 bits")
    assert np.array_equal(torques(folder, flags), proof.torque.ravel())


def test_only_what_a_law_uses_is_printed(tmp_path):
    arm = fp.Arm.two_link()
    folder = write(PLAIN["PID"], arm, tmp_path / "c", recorded(PLAIN["PID"], arm, 2))
    text = (folder / "fpid.h").read_text() + (folder / "fpid.c").read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    for word in ("body", "modes", "mass", "ipow", "solve_symmetric", "estimates"):
        assert word not in text


@pytest.mark.usefixtures("gcc")
def test_the_example_compiles_and_comes_to_its_target(tmp_path):
    arm = fp.Arm.two_link()
    folder = write(fpid(), arm, tmp_path / "c", recorded(fpid(), arm, 2))
    names = [str(folder / f"{name}.c") for name in ("example", "fpid", "fpid_parameters")]
    program = str(folder / "program")
    finished([build.compiler(), *build.FLAGS, *names, "-o", program, "-lm"], check=True)
    said = finished([program], check=True).stdout
    assert [abs(float(line.split()[4]) - 0.1) < 0.02 for line in said.splitlines()] == [True] * 2


# ------------------------------------------------------------------------- in node

RUN = """
const fs = require('fs');
const given = (name) => new Float64Array(new Uint8Array(fs.readFileSync(name)).buffer);
const M = given(process.argv[2]), inputs = given(process.argv[3]);
const ticks = inputs.length / (5 * JOINTS), out = new Float64Array(ticks * JOINTS);
for (let k = 0; k < ticks; k++) {
    M.set(inputs.subarray(k * 5 * JOINTS, (k + 1) * 5 * JOINTS), INPUTS);
    TICK(INPUTS, TORQUE, k == 0 ? 7 : 15);
    out.set(M.subarray(TORQUE, TORQUE + JOINTS), k * JOINTS);
}
fs.writeFileSync(process.argv[4], Buffer.from(out.buffer));
"""


def in_node(node, tmp_path, controller, arm, inputs, step=1e-3):
    """Return the torques of a law printed as JavaScript."""
    state = start(controller, arm, step, HORIZON)
    values = {**state.c._asdict(), "joints": state.joints}
    memory, places, at = [], {}, 0
    for name, array in {**values, "inputs": state.inputs, "out": state.torque}.items():
        # A joint's record and its numbers are one and the same.
        places[name] = places["joints"] if name == "numbers" else at
        if name != "numbers":
            memory.append(words(array))
            at += memory[-1].size
    texts = {name: str(place) for name, place in places.items()}
    program = Program(javascript.JavaScript(), by_name(state.controller))
    kinds = [bundle("controller", values, texts), real(5, state.n), real(state.n), INT]
    known = {
        "TICK": program.add(tick.tick_parts, kinds).name, "JOINTS": state.n,
        "INPUTS": places["inputs"], "TORQUE": places["out"],
    }  # fmt: skip
    lines = [f"const {name} = {value};" for name, value in known.items()]
    paths = [tmp_path / name for name in ("run.js", "memory.bin", "inputs.bin", "out.bin")]
    paths[0].write_text("\n".join([*lines, javascript.HELPERS, program.text, RUN]))
    np.concatenate(memory).tofile(paths[1])
    np.ascontiguousarray(inputs).tofile(paths[2])
    node(*paths)
    return np.fromfile(paths[3]).reshape(-1, arm.n)
