"""Configuration files: what they say, and every way in which they can be wrong."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.cli.configuration import demo_config, load, parse
from fpid_pin.cli.main import main
from fpid_pin.cli.tune import read_plan
from fpid_pin.exceptions import ConfigError

TEXT = demo_config().text
RECORDED = re.compile(r"(?<=\[reference\]).*?(?=\[\[disturbance)", re.S)
DEEP, AMPLITUDE = "not valid TOML: nested too deeply", "[0.4, 0.6]"


def faults(text):
    with pytest.raises(ConfigError) as caught:
        parse(text, "bad.toml", Path())
    lines = str(caught.value).splitlines()
    assert all(line.startswith("bad.toml: ") for line in lines)
    return [line.removeprefix("bad.toml: ") for line in lines]


def test_the_demo_s_file_is_the_api_s_paper_experiment():
    config = demo_config()
    assert descriptions.to_dict(config.experiment) == descriptions.to_dict(fp.paper_experiment())
    crone = dataclasses.replace(
        fp.paper_controller(), design=fp.fractional.Crone(), name="FPID, CRONE filter"
    )
    laws = [fp.paper_controller(orders) for orders in ("symbol", "sign", "integer")]
    laws.insert(2, crone)
    for controller, law in zip(config.controllers.values(), laws, strict=True):
        actual = descriptions.to_dict(controller)
        for key, value in descriptions.to_dict(law).items():
            assert np.array_equal(*np.broadcast_arrays(actual[key], value)), key


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("integral_order = [0.901, 0.931]", "integral_order = [0.9, 1.7]\nkk = 2.0",
         r"controller.0.integral_order.1: expected a number in \[0, 1\], got 1.7"),
        ("m_x = 5.0", "m_x = true", "controller.0.supervisor.m_x: expected a number, got True"),
        ("step = 1e-3", "step = 5e-324", r"simulation.step: expected a number in \[1e-09, 10\]"),
        ("duration = 20.0", "duration = 1e308", "simulation.duration: expected at most 9e"),
        ("format = 1", "format = 7", "format: expected 1, got 7"),
        ("duration = 20.0", "durations = 20.0", r"simulation.durations: .*did you mean duration\?"),
        ("q0 = [0.0, 0.35]", "q0 = [0.0]", r"simulation.q0: expected shape \(2,\)"),
        ('"two_link"', '"three_link"', r"arm.kind: expected one of .* \(did you mean two_link\?\)"),
        ("[reference]", "[references]", r"references: .*did you mean reference\?"),
        ("kp = [10.0, 12.0]", "kp = [10.0, 12.0, 1.0]", "expected one length for all joints"),
        ("[arm]", "[arm", "not valid TOML"),
        ("amplitude = [1.0, 1.0]", "amplitude = [1.0, 1.0, 1.0]", r"reference q: expected shape"),
        ('name = "integer PID"', 'name = "FPID, orders read by sign"', "a name of its own"),
        ("step = 1e-3", f"step = 1e-3\nseed = {1 << 64}",
         f"simulation.seed: expected a whole number of 64 bits, got {1 << 64}"),
        (re.compile(r"\[\[controller\]\].*", re.S), "", "controller: expected a value, got none"),
        (re.compile("$"), '\n[[condition]]\nname = "x"\nplants = {}',
         r"condition.0.plants: .*did you mean plant\?"),
        (re.compile("$"), "\n[[condition]]\nplant = {}",
         "condition.0.name: expected a value, got none"),
        (re.compile("$"), "\n[plant]\neffort_limit = 0.0",
         "plant.effort_limit: expected a number > 0"),
        (AMPLITUDE, "[" * 5000 + "]" * 5000, DEEP),
        (AMPLITUDE, "{a=" * 5000 + "1" + "}" * 5000, DEEP),
        (AMPLITUDE, "[" * 100 + "]" * 100, "disturbance.0.amplitude: expected numbers, got"),
        (AMPLITUDE, "1" * 5000, "not valid TOML: .* 5000 digits"),
        (re.compile("$"), "\n[" + "a." * 5000 + "a]\nb = 1", DEEP),
        (RECORDED, '\nkind = "recorded"\npath = "/dev/zero"\n', "a CSV file, got no file"),
        (RECORDED, '\nkind = "recorded"\npath = "a\\u0000b"\n', "a CSV file, got no file"),
    ],
)  # fmt: skip
def test_bad_files(old, new, message):
    pattern = old if isinstance(old, re.Pattern) else re.escape(old)
    text = re.sub(pattern, lambda _: new, TEXT, count=1)
    assert text != TEXT
    lines = faults(text)
    assert len(lines) <= 2
    assert any(re.search(message, line) for line in lines), lines


@pytest.mark.parametrize(
    ("fault", "message"),
    [("\nkey{k} = 1", "key0: expected one of .*"), ("[[condition]]\n", "condition.0.name: .*")],
)
def test_of_very_many_faults_the_first_are_told_and_in_linear_time(fault, message):
    """Each was compared with all before it."""
    many = "".join(fault.format(k=k) for k in range(20_000))
    text = f"{TEXT}\n{many}" if "[[" in fault else f"{many}\n{TEXT}"
    lines = faults(text)
    assert re.match(message, lines[0])
    assert len(lines) == 41
    assert lines[-1] == "faults: expected none, got 20000"


CONDITIONS = """
[[condition]]
name = "nominal"

[[condition]]
name = "payload"
plant = { payload = 0.5, viscous_friction = 0.2 }

[[condition]]
name = "noise"
sensors = { velocity_noise = 0.05 }
disturbance = [
    { kind = "pulse", torque = 1.0, start = 1.0, end = 2.0 },
    { kind = "cosine", amplitude = 0.1 },
]
"""


def test_conditions_replace_parts_of_the_nominal_experiment():
    config = parse(TEXT + CONDITIONS, "c.toml", Path())
    assert list(config.conditions) == ["nominal", "payload", "noise"]
    nominal, payload, noise = config.conditions.values()
    q = np.array([0.2, 0.3])
    heavier = payload.resolved.arm.gravity_vector(q) - payload.arm.gravity_vector(q)
    expected = 0.5 * 9.8 * np.array([np.cos(0.2) + 0.8 * np.cos(0.5), 0.8 * np.cos(0.5)])
    assert np.allclose(heavier, expected, rtol=1e-12)
    assert payload.plant.disturbance is not None
    assert noise.sensors.velocity_noise == 0.05
    assert len(noise.plant.disturbance.parts) == 2
    assert nominal.sensors is None


def test_a_circle_of_the_tool_is_one_of_the_configuration_s_arm():
    head = 'format = 1\n[arm]\nkind = "planar"\nlengths = [1, 1, 1]\nmasses = [1, 1, 1]\n'
    circle = '[reference]\nkind = "tool_circle"\nradius = 0.1\nperiod = 2.0\n'
    law = '[[controller]]\nkind = "none"\n'
    found = parse(head + circle + law, "c.toml", Path()).experiment
    assert found.reference.arm == found.arm == fp.Arm.planar([1, 1, 1], [1, 1, 1])
    other = '[reference.arm]\nkind = "planar"\nlengths = [1, 1, 2]\nmasses = [1, 1, 1]\n'
    found = parse(head + circle + other + law, "c.toml", Path()).experiment
    assert found.reference.arm == fp.Arm.planar([1, 1, 2], [1, 1, 1])


@pytest.mark.parametrize("content", [None, TEXT, TEXT + '"a\\nb" = 1'])
def test_a_path_with_a_line_end_in_it_makes_no_line(tmp_path, content, capsys):
    path = tmp_path / "a\nb\x1b[2J.toml"
    if content is not None:
        path.write_text(content.replace('"integer PID"', r'"integer\nPID"'))
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"fpid-pin: {tmp_path}/a\\nb\\x1b[2J.toml: ")


EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("compare_*.toml")), ids=lambda p: p.name)
def test_every_controller_runs_under_every_condition(path):
    found = load(path)
    assert len(found.controllers) >= 6
    assert len(found.conditions) >= 5
    pairs = [(e, c) for e in found.conditions.values() for c in found.controllers.values()]
    experiments = [dataclasses.replace(e, duration=0.02) for e, _ in pairs]
    runs = fp.simulate(experiments, [controller for _, controller in pairs])
    assert all(run.outcome.completed for run in runs)
    assert {run.name for run in runs} == set(found.controllers)


def test_the_search_s_example_is_the_paper_s():
    plan = read_plan(load(EXAMPLES / "tune_two_link.toml"))
    settings = plan.table.settings
    assert (settings.population, settings.generations) == (60, 80)
    assert (settings.crossover, settings.mutation) == (0.75, 0.03)
    assert (plan.cost.w1, plan.cost.w2) == (1.0, 0.0)
