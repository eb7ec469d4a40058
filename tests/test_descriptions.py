"""Every description survives its table; every fault in a table is found."""

import dataclasses
import json

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.disturbances import Cosine, Disturbance, Pulse, Sum
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Reference, Sinusoid

THINGS = [
    (fp.paper_experiment(), fp.Experiment),
    (fp.paper_controller(), fp.Controller),
    (fp.paper_controller("sign", supervised=False), fp.Controller),
    (fp.ComputedTorque(k0=(1.0, 2.0)), fp.Controller),
    (Sinusoid(0.3, (1.0, 2.0), 0.5), Reference),
    (Sum((Pulse(1.0, 0.5), Cosine((0.4, 0.6)))), Disturbance),
    (fp.Plant(arm=fp.Arm.planar([1.0], [2.0]), dry_friction=0.1), fp.Plant),
    (fp.Sensors(delay=3, velocity_noise=0.1), fp.Sensors),
    (fp.Safeguards(maximum=(50.0, 60.0), sigma=0.01), fp.Safeguards),
    (QuadraticCost(w2=0.0), Cost),
]


def flat(table):
    return json.dumps(table, sort_keys=True, default=str)


@pytest.mark.parametrize(("thing", "family"), THINGS, ids=lambda x: type(x).__name__)
def test_a_description_survives_its_table(thing, family):
    table = descriptions.to_dict(thing)
    back = descriptions.from_dict(json.loads(json.dumps(table)), family)
    assert type(back) is type(thing)
    assert flat(descriptions.to_dict(back)) == flat(table)


@pytest.mark.parametrize("thing", [thing for thing, _ in THINGS[:2]])
def test_descriptions_are_frozen(thing):
    field = dataclasses.fields(thing)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(thing, field, 1.0)
    for member in dataclasses.fields(thing):
        value = getattr(thing, member.name)
        if isinstance(value, np.ndarray):
            assert not value.flags.writeable


def test_a_user_s_own_class_is_named_and_cannot_be_read_back():
    class Own:
        def sample(self, t):
            return (np.zeros((len(t), 2)),) * 3

    experiment = fp.Experiment(fp.Arm.two_link(), Own(), duration=0.1)
    table = descriptions.to_dict(experiment)
    assert table["reference"]["kind"] == "custom"
    with pytest.raises(ArgumentError, match=r"reference.kind: expected one of .* got 'custom'"):
        descriptions.from_dict(table, fp.Experiment)


def test_all_faults_of_a_table_are_found_at_once():
    table = descriptions.to_dict(fp.paper_controller())
    table |= {"kq": 1.0, "integral_order": [0.9, 1.7], "name": 3}
    table["supervisor"] = table["supervisor"] | {"m_x": True}
    faults = []
    descriptions.build(table, fp.Controller, "controller.0", faults)
    lines = sorted(str(fault) for fault in faults)
    assert [line.split(":")[0] for line in lines] == [
        "controller.0.integral_order.1",
        "controller.0.kq",
        "controller.0.name",
        "controller.0.supervisor.m_x",
    ]


def test_families_are_kept_apart():
    with pytest.raises(ArgumentError, match="kind: expected one of"):
        descriptions.from_dict({"kind": "cosine", "amplitude": 1.0}, Reference)
    with pytest.raises(ArgumentError, match=r"did you mean adaptive_fpid\?"):
        descriptions.from_dict({"kind": "adaptive_fpd", "kp": 1.0}, fp.Controller)
    with pytest.raises(ArgumentError, match="expected a table, got 3"):
        descriptions.from_dict(3, fp.Controller)
    with pytest.raises(ArgumentError, match="ki: expected a value, got none"):
        descriptions.from_dict({"kind": "adaptive_fpid", "kp": 1.0, "kd": 1.0}, fp.Controller)


def test_a_name_that_is_taken_stays_so():
    with pytest.raises(ArgumentError, match=r"kind: expected a name that is not taken, got 'pid'"):

        @descriptions.described("pid")
        @dataclasses.dataclass(frozen=True, eq=False)
        class Own(fp.Controller):
            pass

    for _ in range(2):  # a cell of a notebook that is run again

        @descriptions.described("own_name_of_a_test")
        @dataclasses.dataclass(frozen=True, eq=False)
        class Again(fp.Controller):
            pass


def test_a_field_called_kind_does_not_hide_the_description_s():
    table = descriptions.to_dict(fp.Supervisor(3.0, 1.0, kind="paper"))
    assert (table["kind"], table["variant"]) == ("supervisor", "paper")
    assert descriptions.from_dict(table, fp.Supervisor).kind == "paper"
