"""Texts stay texts and numbers numbers, in JSON that knows neither inf nor NaN."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fpid_pin as fp
from fpid_pin.references import Hold
from fpid_pin.simulation import run_table
from fpid_pin.simulation.run_table import from_json, to_json

URDF = """<robot name="nan"><link name="base"/>
<link name="a"><inertial><mass value="1"/><origin xyz="1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="1"/><origin xyz="1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="inf" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
<joint name="nan" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>
"""

SPELT = ("inf", "-inf", "nan")
texts = st.text(max_size=4) | st.sampled_from([*SPELT, "$text", "\\inf", "Infinity"])
leaves = texts | st.floats() | st.integers() | st.booleans() | st.none()
tables = st.dictionaries(
    texts.filter(lambda key: key != "$text"),
    st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(
        texts.filter(lambda key: key != "$text"), inner), max_leaves=12),
)  # fmt: skip


@given(tables)
def test_any_table_comes_back(table):
    text = to_json(table)
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    # repr tells inf from "inf", and is the same for NaN and NaN.
    assert repr(from_json(text)) == repr(table)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[" * 3000 + "]" * 3000, "nested too deeply"),
        ("[" * 200 + "]" * 200, "nested too deeply"),
        ('{"a": ' * 200 + "1" + "}" * 200, "nested too deeply"),
        ("[" + "[]," * 1_500_000 + "[]]", "too large for its text"),
        ("[" + "{}," * 450_000 + "{}]", "too large for its text"),
        ("1" * 400, "beyond the range of floats"),
        ("1" * 5000, "integer string conversion"),
        ('["\\ud800"]', "surrogates not allowed"),
        ('{"\\ud800": 1}', "surrogates not allowed"),
        ('{"name": "\\ud800"}', "surrogates not allowed"),
        ("{", "Expecting property name"),
    ],
)
def test_what_no_table_of_ours_is_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        from_json(text)


def test_a_recorded_motion_is_never_too_large_however_long(monkeypatch):
    monkeypatch.setattr(run_table, "MOST_MEMORY", 0)
    for n in (2, 7):
        rows = np.random.default_rng(0).normal(size=(1000, n)).tolist()
        assert from_json(to_json({"positions": rows})) == {"positions": rows}


def test_a_file_of_before_texts_were_told_apart_is_read_as_it_was():
    table = from_json('{"effort_limit": ["inf", "-inf"], "end": "nan", "name": "inf", "n": 2}')
    assert table["effort_limit"] == [np.inf, -np.inf]
    assert np.isnan(table["end"])
    assert table["name"] == "inf"


@pytest.mark.parametrize("name", SPELT)
def test_a_controller_may_be_called_what_a_number_is_called(tmp_path, name):
    law = fp.AdaptiveFpid(1.0, 1.0, 1.0, name=name)
    run = fp.simulate(fp.Experiment(fp.Arm.two_link(), Hold(0.1), duration=0.01), law)
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    assert back.name == back.controller.name == name


def test_a_joint_may_be_called_what_a_number_is_called(tmp_path):
    (tmp_path / "inf.urdf").write_text(URDF)
    arm = fp.Arm.from_urdf(tmp_path / "inf.urdf", lock={"nan": 0.5}).with_payload(1.0, frame="inf")
    run = fp.simulate(fp.Experiment(arm, Hold(0.1), duration=0.01), fp.Pid(1.0, 1.0, 1.0))
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    assert back.arm.joint_names == ("inf",)
