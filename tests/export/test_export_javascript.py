"""The kernels printed as JavaScript give the bits of numba's, in node."""

import numpy as np
import pytest
from exported import HORIZON, OTHERS, guarded_panda, random_law, simulated

import fpid_pin as fp
from fpid_pin.export import javascript, vectors
from fpid_pin.export.kinds import INT, bundle, real, words
from fpid_pin.export.law import stand_ins, start
from fpid_pin.export.printer import Program
from fpid_pin.kernels import tick

RUN = """
const fs = require('fs');
const given = (name) => { const b = fs.readFileSync(name); return new Float64Array(b.buffer, b.byteOffset, b.length / 8); };
const M = new Float64Array(given(process.argv[2])), inputs = given(process.argv[3]);
const ticks = inputs.length / (5 * JOINTS), out = new Float64Array(ticks * JOINTS);
for (let k = 0; k < ticks; k++) {
    M.set(inputs.subarray(k * 5 * JOINTS, (k + 1) * 5 * JOINTS), INPUTS);
    TICK(INPUTS, TORQUE, k == 0 ? 7 : 15);
    out.set(M.subarray(TORQUE, TORQUE + JOINTS), k * JOINTS);
}
fs.writeFileSync(process.argv[4], Buffer.from(out.buffer));
"""  # noqa: E501


def script(state):
    """Return a program that ticks a law, and its memory at t = 0."""
    memory, places, at = [], {}, 0
    for name, values in {**state.c._asdict(), "inputs": state.inputs, "out": state.torque}.items():
        # A joint's record and its numbers are one and the same.
        places[name] = places["joints"] if name == "numbers" else at
        if name != "numbers":
            memory.append(words(state.joints if name == "joints" else values))
            at += memory[-1].size
    texts = {name: str(place) for name, place in places.items()}
    values = {**state.c._asdict(), "joints": state.joints}
    arrays = bundle("controller", values, texts)
    program = Program(javascript.JavaScript(), stand_ins(state.controller))
    kinds = [arrays, real(5, state.n), real(state.n), INT]
    name = program.add(tick.tick_parts, kinds).name
    constants = {
        "JOINTS": state.n,
        "INPUTS": places["inputs"],
        "TORQUE": places["out"],
        "TICK": name,
    }
    lines = [f"const {name} = {value};" for name, value in constants.items()]
    text = "\n".join([*lines, javascript.HELPERS, program.text, RUN])
    return text, np.concatenate(memory)


def in_node(node, tmp_path, controller, arm, step, inputs):
    text, memory = script(start(controller, arm, step, HORIZON))
    paths = [tmp_path / name for name in ("run.js", "memory.bin", "inputs.bin", "out.bin")]
    paths[0].write_text(text)
    memory.tofile(paths[1])
    np.ascontiguousarray(inputs).tofile(paths[2])
    node(*paths)
    return np.fromfile(paths[3]).reshape(-1, arm.n)


def test_the_papers_experiment_has_the_same_bits(node, tmp_path):
    proof = simulated(fp.paper_controller(supervised=False))
    controller, arm = fp.paper_controller(supervised=False), fp.Arm.two_link()
    found = in_node(node, tmp_path, controller, arm, 1e-3, proof.inputs)
    assert len(found) >= 20_000
    assert np.array_equal(found, proof.torque)


@pytest.mark.parametrize("seed", [None, 1, 2, 3, 5, 8])
def test_other_laws_have_the_same_bits(seed, node, tmp_path):
    controller, arm, step = (*guarded_panda(), 1e-3) if seed is None else random_law(seed)
    inputs = vectors.signals(arm, step, 3000)
    proof = vectors.answers(controller, arm, step, HORIZON, inputs)
    assert np.array_equal(in_node(node, tmp_path, controller, arm, step, inputs), proof.torque)


# A Panda bears less than the reserve asks, which is warned of.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.parametrize("name", OTHERS)
def test_with_the_model_torques_are_within_1e_12_of_the_largest(name, node, tmp_path):
    controller, arm = OTHERS[name], fp.Arm.from_example("ur5" if name != "reserve" else "panda")
    inputs = vectors.signals(arm, 1e-3, 2000)
    proof = vectors.answers(controller, arm, 1e-3, HORIZON, inputs)
    found = in_node(node, tmp_path, controller, arm, 1e-3, inputs)
    assert np.abs(found - proof.torque).max() < 1e-12 * np.abs(proof.torque).max()
