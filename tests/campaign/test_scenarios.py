"""What is uncertain and how it is drawn, and that docs/campaigns.md shows what works."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from studies import UNCERTAIN, study

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.campaign import Choices, LogUniform, Normal, Scenarios, Study, Uniform
from fpid_pin.campaign.study import QUANTITIES
from fpid_pin.cli.campaign import read_campaign
from fpid_pin.cli.commands import app
from fpid_pin.cli.configuration import demo_config, parse
from fpid_pin.exceptions import ArgumentError

SAMPLINGS = ("sobol", "latin_hypercube")
LAWS = {"pd": fp.PdGravity(kp=50.0, kd=10.0)}


def sampled(spreads, runs, **options):
    return study(uncertain=spreads, **options).samples(0, runs)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_marginals_are_what_was_asked_for(sampling):
    # Random points would fail each of these at 1 in 1000; these are nearer than random ones.
    samples = sampled(
        {
            "mass": Uniform(low=0.8, high=1.2, shared=True),
            "payload": Normal(mean=0.2, std=0.3),
            "disturbance_frequency": LogUniform(low=0.1, high=50.0, shared=True),
            "q0": Normal(mean=1.0, std=0.1, shared=True),
        },
        2000,
        sampling=sampling,
    )
    truth = (
        stats.uniform(0.8, 0.4),
        stats.truncnorm(-0.2 / 0.3, np.inf, 0.2, 0.3),
        stats.loguniform(0.1, 50.0),
        stats.norm(1.0, 0.1),
    )
    for column, law in zip(samples.T, truth, strict=True):
        assert stats.kstest(column, law.cdf).pvalue > 1e-3


def test_choices_are_equally_likely():
    delays = sampled({"delay": Choices(values=[0, 1, 5])}, 3 * 1024)[:, 0]
    values, counts = np.unique(delays, return_counts=True)
    assert values.tolist() == [0.0, 1.0, 5.0]
    assert counts == pytest.approx(1024, rel=0.02)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_a_runs_sample_depends_on_the_seed_and_its_number_alone(sampling):
    whole = sampled(UNCERTAIN, 1000, sampling=sampling)
    cuts = [0, 1, 7, 255, 256, 257, 700, 1000]
    fresh = [study(sampling=sampling).samples(a, b) for a, b in itertools.pairwise(cuts)]
    assert np.concatenate(fresh).tobytes() == whole.tobytes()
    late = study(sampling=sampling)
    assert late.samples(900, 901).tobytes() == whole[900:901].tobytes()
    assert late.samples(3, 4).tobytes() == whole[3:4].tobytes()
    assert not np.array_equal(sampled(UNCERTAIN, 1000, sampling=sampling, seed=4), whole)


def test_every_quantity_is_in_its_experiment_and_the_belief_stays():
    bound = study()
    sample = bound.samples(5, 6)[0]
    value = dict(zip(bound.parameters, sample, strict=True))
    nominal, true = bound.experiment, bound.experiment_of(5, sample)
    assert true.arm is nominal.arm
    assert true.reference is nominal.reference
    plant = true.plant.arm
    masses = [body.mass for body in list(plant.model.inertias)[1:]]
    # The paper's links weigh 1 kg each; the payload hangs from the second.
    assert masses[0] == pytest.approx(value["mass.0"], rel=1e-12)
    assert masses[1] == pytest.approx(value["mass.1"] + value["payload"], rel=1e-12)
    assert list(true.plant.viscous_friction) == [value[f"viscous_friction.{j}"] for j in (0, 1)]
    assert float(true.plant.disturbance.amplitude) == value["disturbance_amplitude"]
    assert float(true.plant.disturbance.frequency) == float(nominal.plant.disturbance.frequency)
    assert list(true.sensors.position_noise) == [value[f"position_noise.{j}"] for j in (0, 1)]
    assert true.sensors.delay == value["delay"]
    assert list(true.q0) == [value["q0.0"], value["q0.1"]]
    assert list(true.v0) == list(nominal.v0)
    seeds = {bound.experiment_of(k, sample).seed for k in range(50)}
    assert len(seeds) == 50


def test_reference_and_inertia_vary():
    spreads = {
        "reference_amplitude": Uniform(low=0.5, high=1.5),
        "reference_phase": Uniform(low=0.0, high=1.0, shared=True),
        "inertia": Uniform(low=0.5, high=2.0),
        "dry_friction": Uniform(low=0.0, high=0.5),
        "v0": Uniform(low=-1.0, high=1.0),
    }
    arm = fp.Arm.planar(lengths=(1.0, 0.8), masses=(1.0, 2.0), rods=True)
    experiment = fp.Experiment(arm, fp.references.Sinusoid(), duration=1.0)
    made = Study(experiment, LAWS, Scenarios(spreads))
    sample = made.samples(2, 3)[0]
    value = dict(zip(made.parameters, sample, strict=True))
    true = made.experiment_of(2, sample)
    assert float(true.reference.phase) == value["reference_phase"]
    assert list(true.reference.amplitude) == [value[f"reference_amplitude.{j}"] for j in (0, 1)]
    for j in (0, 1):
        before, after = (a.model.inertias[j + 1] for a in (arm, true.plant.arm))
        assert after.mass == before.mass
        factor = value[f"inertia.{j}"]
        assert np.allclose(after.inertia, factor * before.inertia, rtol=1e-12)


def test_a_normal_is_cut_where_the_quantity_ends():
    samples = sampled({"mass": Normal(mean=0.1, std=1.0), "delay": Normal(mean=1, std=2)}, 1024)
    assert (samples[:, :2] > 0.0).all()
    assert (samples[:, 2] >= 0.0).all()
    assert np.array_equal(samples[:, 2], np.round(samples[:, 2]))


@pytest.mark.parametrize(
    ("spreads", "words"),
    [
        ({"mass": Uniform(low=-0.2, high=1.0)}, r"uncertain\.mass\.low: expected a number > 0"),
        ({"payload": Normal(mean=-1.0, std=1.0)}, r"uncertain\.payload\.mean: .*>= 0"),
        ({"payload": Uniform(low=0.0, high=[1.0, 2.0])}, "payload.high: expected one number"),
        ({"paylod": Uniform(low=0.0, high=1.0)}, "did you mean payload"),
        ({}, "at least one quantity"),
        ({"mass": Uniform(low=0.5, high=[1.0, 2.0, 3.0])}, r"mass\.high: expected shape \(2,\)"),
        ({"q0": Uniform(low=0.0, high=[1.0, 2.0], shared=True)}, r"q0\.high: expected one number"),
    ],
)
def test_impossible_values_are_refused_with_the_key(spreads, words):
    with pytest.raises(ArgumentError, match=words):
        study(uncertain=spreads)


def test_distributions_refuse_what_is_none():
    for kind, numbers, words in (
        (Uniform, {"low": 1.0, "high": 1.0}, "high: expected more than low"),
        (LogUniform, {"low": 0.0, "high": 1.0}, "low: expected a number > 0"),
        (Normal, {"mean": 0.0, "std": 0.0}, "std"),
        (Uniform, {"low": [0, 1], "high": [1, 2, 3]}, r"high: .*\(2,\) as low, got \(3,\)"),
    ):
        with pytest.raises(ArgumentError, match=words):
            kind(**numbers)


def test_an_experiment_without_the_quantity_is_refused():
    hold = fp.Experiment(fp.Arm.two_link(), fp.references.Hold((0.1, 0.2)), duration=1.0)
    for key, words in (
        ("reference_amplitude", "a reference with amplitude .*hold"),
        ("disturbance_amplitude", r"kind cosine\), got none"),
    ):
        with pytest.raises(ArgumentError, match=rf"uncertain\.{key}: .*{words}"):
            Study(hold, LAWS, Scenarios({key: Uniform(low=0.1, high=1.0)}))


def test_every_quantity_is_known_to_an_experiment():
    spreads = {key: Uniform(low=1.0, high=1.5) for key in QUANTITIES}
    bound = study(uncertain=spreads)
    assert len(bound.parameters) == bound.samples(0, 3).shape[1]
    assert bound.experiment_of(0, bound.samples(0, 1)[0]).sensors.delay in (1, 2)


@pytest.mark.parametrize("points", [None, [[0.5] * 12]])
def test_scenarios_go_through_a_table(points):
    first = study(points=points)
    again = descriptions.from_dict(json.loads(first.text), type(first))
    assert again.text == first.text
    assert again.samples(0, 1).tobytes() == first.samples(0, 1).tobytes()
    assert study(seed=4, points=points).text != first.text


PAGE = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text(encoding="utf-8")


def test_the_pages_configuration_is_one(tmp_path):
    (table,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    study, runs = read_campaign(parse(demo_config().text + table, "page.toml", tmp_path))
    assert runs == 10_000
    assert study.experiment.dynamics == "compiled"
    assert "viscous_friction.1" in study.parameters


def test_the_pages_table_has_every_quantity():
    rows = PAGE[PAGE.index("| key |") :].split("\n\n")[0]
    named = set()
    for cell in re.findall(r"^\| (`.*?) \|", rows, re.MULTILINE):
        first, *others = re.findall(r"`(\w+)`", cell)
        named.add(first)
        prefix = first.partition("_")[0]
        named |= {f"{prefix}{name}" if name.startswith("_") else name for name in others}
    assert named == set(QUANTITIES)


def test_the_pages_commands_are_there():
    import typer.main

    group = typer.main.get_command(app).commands["campaign"]
    told = set(re.findall(r"fpid-pin campaign (\w+)", PAGE))
    assert told == set(group.commands)
    for line in re.findall(r"^    fpid-pin campaign .*$", PAGE, re.MULTILINE):
        options = {o for p in group.commands[line.split()[2]].params for o in p.opts}
        assert set(re.findall(r"(?<=\s)--[a-z-]+", line.partition("#")[0])) <= options, line
