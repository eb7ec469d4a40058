"""Every description survives its table; every fault in a table is found."""

import dataclasses
import json
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.campaign import Distribution, Scenarios, Uniform
from fpid_pin.checks import Number, PerJoint, Whole
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.disturbances import Cosine, Disturbance, Pulse, Sum
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import Design
from fpid_pin.references import Quintic, Reference, Sinusoid

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
    (Scenarios({"mass": Uniform(low=0.8, high=1.2)}, seed=3), Scenarios),
]


@pytest.mark.parametrize(("thing", "family"), THINGS, ids=lambda x: type(x).__name__)
def test_a_description_survives_its_table(thing, family):
    table = descriptions.to_dict(thing)
    back = descriptions.from_dict(json.loads(json.dumps(table)), family)
    assert type(back) is type(thing)
    assert descriptions.to_dict(back) == table
    for member in dataclasses.fields(thing):
        value = getattr(thing, member.name)
        assert not isinstance(value, np.ndarray) or not value.flags.writeable
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(thing, member.name, 1.0)


def test_a_user_s_own_class_is_named_and_cannot_be_read_back():
    class Own:
        def sample(self, t):
            return (np.zeros((len(t), 2)),) * 3

    experiment = fp.Experiment(fp.Arm.two_link(), Own(), duration=0.1)
    table = descriptions.to_dict(experiment)
    assert table["reference"]["kind"] == "custom"
    with pytest.raises(ArgumentError, match=r"reference.kind: expected one of .* got 'custom'"):
        descriptions.from_dict(table, fp.Experiment)


def lines_of(table, family, path=""):
    faults = []
    assert descriptions.build(table, family, path, faults) is None
    return sorted(map(str, faults))


UNIFORM = {"kind": "uniform", "low": 1, "high": 2}


def test_all_faults_of_a_table_are_found_at_once():
    table = descriptions.to_dict(fp.paper_controller())
    table |= {"kq": 1.0, "integral_order": [0.9, 1.7], "name": 3, "regressors": "lwa"}
    table["supervisor"] = table["supervisor"] | {"m_x": True, "target": -1}
    del table["ki"]
    lines = lines_of(table, fp.Controller, "controller.0")
    unknown = lines.pop(2)
    assert unknown.startswith("controller.0.kq: expected one of the keys scale, feedforward, ")
    assert unknown.endswith(", got 'kq'")
    assert lines == [
        "controller.0.integral_order.1: expected a number in [0, 1], got 1.7",
        "controller.0.ki: expected a value, got none",
        "controller.0.name: expected a text, got 3",
        "controller.0.regressors: expected one of law, integer, got 'lwa' (did you mean law?)",
        "controller.0.supervisor.m_x: expected a number, got True",
        "controller.0.supervisor.target: expected a number > 0, got -1",
    ]


@pytest.mark.parametrize(
    ("cls", "fields", "line"),
    [
        (fp.Plant, {"dry_friction": [1, -1]},
         "plant.dry_friction.1: expected a number >= 0, got -1"),
        (fp.Plant, {"viscous_friction": [1, 1], "dry_friction": [1, 1, 1]}, "plant.dry_friction: "
         "expected one length for all joints, (2,) as viscous_friction, got (3,)"),
        (Pulse, {"torque": 1, "start": 2, "end": 1},
         "disturbance.end: expected more than start (2), got 1.0"),
        (Quintic, {"start": 0, "end": 1, "duration": 0},
         "reference.duration: expected a number > 0, got 0"),
        (fp.Sensors, {"delay": 0.5}, "sensors.delay: expected a whole number, got 0.5"),
        (fp.Sensors, {"delay": -1},
         "sensors.delay: expected a whole number in [0, 1e+06], got -1"),
        (fp.Sensors, {"velocity_bias": float("inf")},
         "sensors.velocity_bias: expected a number finite, got inf"),
        (fp.Sensors, {"velocity": "measure"}, "sensors.velocity: expected one of measured, "
         "differentiated, got 'measure' (did you mean measured?)"),
        (fp.Supervisor, {"m_x": 5, "reference_bound": 1, "weight": [1, 2]},
         "supervisor.weight: expected shape (2, 2), got shape (2,)"),
        (fp.Safeguards, {"maximum": [[1.0], [2.0]]},
         "safeguards.maximum: expected shape (n,) or (3, n), got shape (2, 1)"),
        (QuadraticCost, {"w1": -1}, "cost.w1: expected a number >= 0, got -1"),
        (fp.Pid, {"kp": 1, "ki": [1, 1], "kd": [1, 1, 1]},
         "kd: expected one length for all joints, (2,) as ki, got (3,)"),
        (fp.ComputedTorque, {"scale": "inertial"},
         "scale: expected one of none, inertia, got 'inertial' (did you mean inertia?)"),
        (fp.ComputedTorque, {"scale": [1, 0]}, "scale.1: expected a number > 0, got 0"),
    ],
)  # fmt: skip
def test_arguments_and_tables_are_refused_in_the_same_line(cls, fields, line):
    with pytest.raises(ArgumentError) as caught:
        cls(**fields)
    assert str(caught.value) == line
    path = cls._path
    told = lines_of({"kind": cls._kind} | fields, cls, path)
    assert told == [line]


def test_every_number_of_a_built_in_kind_declares_its_check():
    """So that a reference of the configuration can say its unit, default and bounds."""
    families = (fp.Controller, Cost, Design, Disturbance, Distribution, Reference, fp.Experiment,
                fp.Plant, fp.Sensors, fp.Supervisor, fp.Safeguards)  # fmt: skip
    seen = set()
    for family in families:
        for kind, cls in descriptions.kinds(family).items():
            if not cls.__module__.startswith("fpid_pin.") or issubclass(cls, Arm):
                continue
            for key in descriptions.keys(cls).values():
                seen.add(f"{kind}.{key.name}")
                text = key.plain is not None and key.name in ("name", "title")
                assert key.checks or key.family or text, f"{kind}.{key.name}"
    assert {"adaptive_fpid.kp", "pulse.end", "crone.n", "plant.arm", "uniform.low"} <= seen
    kp, arm = descriptions.keys(fp.Pid)["kp"], descriptions.keys(fp.Plant)["arm"]
    assert (kp.checks[0].unit, kp.checks[0].bounds, kp.required) == ("N m/rad", {"low": 0.0}, True)
    assert (arm.family, arm.optional, arm.default) == (Arm, True, None)


def test_a_law_of_one_s_own_may_declare_checks_or_none():
    class Solver:
        pass

    @dataclass(frozen=True, eq=False)
    class Own(fp.Controller):
        kp: ArrayLike
        gain: Annotated[ArrayLike, PerJoint("N m", low=0.0)]
        solver: Solver  # a name that only this function knows
        count: Annotated[int, Whole(low=1)] = 3
        width: Annotated[float | None, Number("s", above=0.0)] = None
        rate: float = 1.0

    given = np.array([1.0, 2.0])
    own = Own(kp=[-1, 2], gain=given, solver=None, rate=(1.0, 2.0))
    assert own.kp == [-1, 2]
    assert own.rate == (1.0, 2.0)
    assert (own.gain == given).all()
    assert not own.gain.flags.writeable
    assert not np.shares_memory(own.gain, given)
    for changes, line in [
        ({"gain": (1.0, -1.0)}, "gain.1: expected a number >= 0, got -1"),
        ({"count": 0}, "count: expected a whole number >= 1, got 0"),
        ({"width": 0}, "width: expected a number > 0, got 0"),
        ({"observer": -1}, "observer: expected a number >= 0, got -1"),
    ]:
        with pytest.raises(ArgumentError) as caught:
            dataclasses.replace(own, **changes)
        assert str(caught.value) == line


@pytest.mark.parametrize(
    ("table", "family", "lines"),
    [
        (3, fp.Controller, ["description: expected a table, got 3"]),
        ({"kind": "adaptive_fpd"}, fp.Controller, ["(did you mean adaptive_fpid?)"]),
        ({"kind": "cosine"}, Reference, ["kind: expected one of "]),
        ({"parts": 1}, Sum, ["parts: expected a list of tables ([[parts]]), got 1"]),
        ({}, Scenarios, ["uncertain: expected a table, got none"]),
        ({"uncertain": 1}, Scenarios, ["uncertain: expected a table, got 1"]),
        ({"uncertain": {"mass": {"kind": "uniform", "low": -1, "high": 1}, "delai": UNIFORM,
                        "delay": {"kind": "unifrom"}, "x.mass": UNIFORM}},
         Scenarios,
         ["uncertain.mass.low: expected a number > 0, got -1", "(did you mean delay?)",
          "uncertain.delay.kind: expected one of", "uncertain.x.mass: expected one of"]),
    ],
)  # fmt: skip
def test_every_fault_of_a_member_has_its_path(table, family, lines):
    told = lines_of(table, family)
    assert len(told) == len(lines)
    for line in lines:
        assert any(line in text for text in told), told


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


@pytest.mark.parametrize("name", ["Joint", "Frame", "Shape", "Chain", "Gene", "Reference"])
def test_a_class_of_one_s_own_may_be_called_as_one_of_ours(name):
    """Families go by the class: a law called `Joint` once made arms' tables want a kind."""
    arm = Arm.from_model(Arm.two_link().model)
    references = descriptions.kinds(Reference)
    own = type(name, (fp.Controller,), {"torque": staticmethod(lambda c: 2.0 * c.e)})
    descriptions.described(f"my_{name}")(dataclass(frozen=True, eq=False)(own))
    assert descriptions.from_dict(descriptions.to_dict(arm), Arm) == arm
    assert descriptions.kinds(Reference) == references
    assert isinstance(descriptions.from_dict({"kind": f"my_{name}"}, fp.Controller), fp.Controller)
    space = fp.tuning.Space(kp={"low": 1, "high": 2})
    assert repr(space) == "Space(kp=(1, 2))"


def test_a_field_called_kind_does_not_hide_the_description_s():
    table = descriptions.to_dict(fp.Supervisor(3.0, 1.0, kind="paper"))
    assert (table["kind"], table["variant"]) == ("supervisor", "paper")
    assert descriptions.from_dict(table, fp.Supervisor).kind == "paper"


def test_a_description_prints_what_is_not_as_it_is_by_default():
    law = fp.suggest_gains(fp.Arm.from_example("ur5"))
    lines = str(law).splitlines()
    assert lines[0] == "AdaptiveFpid"
    assert len(lines) <= 15
    assert max(map(len, lines)) <= 100
    found = dict(line.strip().split(maxsplit=1) for line in lines[1:])
    assert found["kp"] == "100 N m/rad"  # all joints alike
    assert found["scale"].startswith("[4.377 5.152 ")
    assert "k0" not in found
    assert str(fp.Plant()) == "Plant"
