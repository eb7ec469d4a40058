"""The kernels printed as JavaScript give the bits of numba's, in node."""

import numpy as np
import pytest
from exported import HORIZON, guarded_panda, random_law, simulated

import fpid_pin as fp
from fpid_pin.export import javascript, vectors
from fpid_pin.export.kinds import words
from fpid_pin.export.parts import law_of
from fpid_pin.export.printer import Program

RUN = """
const fs = require('fs');
const given = (name) => { const b = fs.readFileSync(name); return new Float64Array(b.buffer, b.byteOffset, b.length / 8); };
const start = given(process.argv[2]), inputs = given(process.argv[3]);
const M = new Float64Array(start);
const ticks = inputs.length / (5 * FPID_JOINTS);
const out = new Float64Array(ticks * FPID_JOINTS);
for (let k = 0; k < ticks; k++) {
    M.set(inputs.subarray(k * 5 * FPID_JOINTS, (k + 1) * 5 * FPID_JOINTS), AT_INPUTS);
    tick();
    out.set(M.subarray(AT_TORQUE, AT_TORQUE + FPID_JOINTS), k * FPID_JOINTS);
}
fs.writeFileSync(process.argv[4], Buffer.from(out.buffer));
"""  # noqa: E501


def script(law):
    """Return a program that ticks a law, and its memory at t = 0."""
    program = Program(javascript.JavaScript())
    memory, places, at = [], {}, 0
    for name, values in law.memory().items():
        if not name.endswith("]"):
            memory.append(words(values))
            places[name], at = at, at + memory[-1].size
    calls = []
    for call in law.calls:
        name = program.add(call.kernel, [law.kind(a) for a in call.arguments])
        given = [str(places[a]) if isinstance(a, str) else repr(a) for a in call.arguments]
        calls.append(f"{name}({', '.join(given)});")
    constants = {**law.extents, "AT_INPUTS": places["inputs"], "AT_TORQUE": places["torque"]}
    lines = [f"const {name} = {value};" for name, value in constants.items()]
    tick = "const tick = () => { " + " ".join(calls) + " };"
    text = "\n".join([*lines, javascript.HELPERS, program.text, tick, RUN])
    return text, np.concatenate(memory)


def in_node(node, tmp_path, controller, arm, step, inputs):
    text, memory = script(law_of(controller, arm, step, HORIZON))
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


def test_with_the_model_torques_are_within_1e_12_of_the_largest(node, tmp_path):
    controller = fp.AdaptiveFpid(
        kp=60.0, ki=30.0, kd=12.0, integral_order=0.9, derivative_order=0.8, feedforward=True,
        observer=100.0, supervisor=fp.Supervisor.quiet(1.3, 1.0),
    )  # fmt: skip
    arm = fp.Arm.from_example("ur5")
    inputs = vectors.signals(arm, 1e-3, 2000)
    proof = vectors.answers(controller, arm, 1e-3, HORIZON, inputs)
    found = in_node(node, tmp_path, controller, arm, 1e-3, inputs)
    assert np.abs(found - proof.torque).max() < 1e-12 * np.abs(proof.torque).max()
