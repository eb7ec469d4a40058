"""Whatever a page's settings say, its run is that of its own TOML: in node, many at once."""

import dataclasses
import json
import re
import shutil
from dataclasses import dataclass

import numpy as np
import pytest
from bounded import FULL, finished
from own_laws import Mit

import fpid_pin as fp
from fpid_pin.cli.configuration import parse
from fpid_pin.view.document import asset

#: Runs are short: settings that are chaotic have no time to show it.
DURATION = 0.25
ASK = """
function run(changes) {
  const now = {...fresh(), ...changes}, S = settingsOf(now, now.controller);
  const {q, v, torque, metrics, outcome} = simulate(S);
  return {toml: toToml(S), q: [...q], v: [...v], torque: [...torque], metrics, outcome,
    link: fromLink(toLink(now, null)).now, now};
}
function refuse(link) {
  const {now, faults} = fromLink(link);
  return [faults, same(now, fresh())];
}
const [, , path, question] = process.argv;
const asked = JSON.parse(require("fs").readFileSync(path));
const read = (link) => fromLink(link).now;
process.stdout.write(JSON.stringify(asked.map({run, refuse, read}[question])));
"""
GUARD = fp.Supervisor.quiet(m_x=3.0, reference_bound=1.5)


def fpid(**others):
    return fp.AdaptiveFpid(
        kp=(60.0, 30.0), ki=30.0, kd=(12.0, 6.0), integral_order=(0.9, 0.8), derivative_order=0.8,
        learning_rate=2.0, **others,
    )  # fmt: skip


@fp.described("played_law")
@dataclass(frozen=True, eq=False)
class Played(Mit):
    """A law of one's own: gain and order move; one of its fields is no number."""

    kind_of_use: str = "any"


@fp.described("entangled_law")
@dataclass(frozen=True, eq=False)
class Entangled(fp.Controller):
    """A law whose number is no multiple of a field: a page has no slider for it."""

    frequency: float = 8.0
    damping: float = 0.8

    def numbers(self, arm, step, horizon):
        return {"kp": self.frequency**2, "kd": 2.0 * self.damping * self.frequency}

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.e_dot


LAWS = [
    fp.paper_controller(supervised=False),
    fpid(feedforward=True, observer=60.0, initialisation="grunwald_letnikov"),
    fpid(supervisor=dataclasses.replace(GUARD, kind="paper", observer=0.0, trigger=0.0),
         safeguards=fp.Safeguards(minimum=1.0, maximum=80.0, sigma=0.05),
         derivative_on="measurement"),
    fpid(order_learning_rate=0.02, initialisation="grunwald_letnikov", regressors="integer"),
    fp.Pid(kp=60.0, ki=20.0, kd=(9.0, 4.0), scale="inertia", feedforward=True),
    fp.ComputedTorque(k0=100.0, k1=20.0, ki=5.0, observer=50.0, supervisor=dataclasses.replace(
        GUARD, observer=50.0)),
    fp.SlotineLi(slope=5.0, damping=8.0, leakage=0.1),
    Played(), Entangled(),
]  # fmt: skip
NAMES = ["paper", "kick", "guarded", "moving", "pid", "torque", "slotine", "own", "entangled"]


class Page:
    """The scripts of a page that need no window, in node."""

    def __init__(self, folder, job, laws):
        if shutil.which("node") is None:
            pytest.skip("no node")
        text = fp.view.playground(job, laws).text
        tables = "\n".join(re.findall(r"<script>(const (?:ENGINE|PAGE) = \{.*?\};)</script>", text))
        engine = re.search(r'id="engine">(.*?)</script>', text, re.DOTALL).group(1)
        self.table = json.loads(re.search(r"PAGE = (\{.*\});", tables, re.DOTALL).group(1))
        self.folder, self.script = folder, folder / "page.js"
        settings = asset("playground_settings.js").replace('"use strict";', "", 1)
        parts = ["const self = {};", tables, settings, engine, ASK]
        self.script.write_text("\n".join(parts), encoding="utf-8")

    def ask(self, question, asked):
        """Return the page's answer to each: a `run`; a link, to `refuse` it or to `read` it."""
        path = self.folder / "asked.json"
        path.write_text(json.dumps(asked))
        done = finished(["node", str(self.script), str(path), question])
        assert done.returncode == 0, done.stderr[-1000:]
        return json.loads(done.stdout)

    def check(self, asked):
        """Hold runs against those of their own TOML, run by Python; return these."""
        runs = []
        for changes, mine in zip(asked, self.ask("run", asked), strict=True):
            assert mine["link"] == mine["now"], changes
            config = parse(mine["toml"], "copied.toml", self.folder)
            assert config.experiment.dynamics == "compiled"
            run = fp.simulate(config.experiment, next(iter(config.controllers.values())))
            for name in ("q", "v", "torque"):
                want = getattr(run, name)
                found = np.array(mine[name], dtype=float).reshape(want.shape)
                scale = max(1.0, float(np.abs(want).max()))
                assert np.abs(found - want).max() <= 1e-9 * scale, (changes, name)
            outcome = mine["outcome"]
            assert outcome["completed"] == run.outcome.completed, changes
            if not run.outcome.completed:
                assert outcome["joint"] == run.outcome.joint
                assert outcome["cause"] == run.outcome.cause
                assert outcome["time"] == pytest.approx(run.outcome.time, abs=1e-9)
            else:
                for name, values in mine["metrics"].items():
                    assert np.allclose(values, getattr(run.metrics, name), rtol=1e-8), changes
            runs.append(run)
        return runs


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    job = fp.paper_experiment(duration=DURATION)
    return Page(tmp_path_factory.mktemp("page"), job, LAWS)


def controls_of(page, law):
    """Return the sliders of a law and those that all share, by key."""
    groups = [*page.table["laws"][law]["groups"], *page.table["groups"]]
    start = page.table["start"]
    controls = [control for group in groups for control in group["controls"]]
    return {c["key"] if c["key"] in start else f"{law}.{c['key']}": c for c in controls}


def places_of(control, start, steps):
    """Return two values of a slider, as its setting has them; of a switch the other one."""
    scale, low, high = control["scale"], control["low"], control["high"]
    if scale == "switch":
        return [not start]
    if scale == "stops":
        return [steps[0], steps[-2]]
    if scale == "gain":
        factors = np.array([0.4, 1.9])
        return [(factor * np.array(start)).tolist() for factor in factors]
    if scale in ("log", "log0", "limit"):
        low = control["least"] or low
        found = [low * (high / low) ** 0.4, low * (high / low) ** 0.7]
    else:
        found = [low + 0.3 * (high - low), low + 0.8 * (high - low)]
    if control["key"] == "delay":
        found = [float(round(x)) for x in found]
    return [[x, 0.9 * x] if isinstance(start, list) else x for x in found]


@pytest.mark.filterwarnings("ignore::fpid_pin.FpidWarning")
@pytest.mark.parametrize("law", range(len(LAWS)), ids=NAMES)
def test_every_slider_from_every_preset_is_as_its_toml(page, law):
    start, asked = page.table["start"], []
    controls = controls_of(page, law)
    assert len(page.table["presets"]) > 10
    presets = page.ask("read", [preset["now"] for preset in page.table["presets"]])
    for k, preset in enumerate(presets):
        # What a preset says of the first law it says of this one, where that has such a setting.
        changed = {key: value for key, value in preset.items() if value != start[key]}
        own = {re.sub(r"^0\.", f"{law}.", key): value for key, value in changed.items()}
        base = {key: value for key, value in own.items() if key in start} | {"controller": law}
        for number, (key, control) in enumerate(controls.items()):
            values = places_of(control, base.get(key, start[key]), page.table["steps"])
            # From the description to both places, but of what all laws share only by the first, on
            # which presets are; else to one of them, sliders taking turns. FULL: all to both.
            if k == 0 and law > 0 and not key.startswith(f"{law}.") and not FULL:
                values = values[(number + law) % 2 - 1 :][:1]
            if k > 0 and not FULL:
                now = (number + k) % (4 if law == 0 else 12) == 0
                values = values[k // 2 % 2 - 1 :][:1] if now else []
            asked += [{**base, key: value} for value in values]
    page.check(asked)


def test_a_law_has_a_slider_for_each_field_that_is_a_number(page):
    fields = {c["key"] for c in controls_of(page, NAMES.index("own")).values()}
    assert fields >= {"kp", "kd", "mu", "rate", "supervised"}
    assert "kind_of_use" not in fields
    fields = {c["key"] for c in controls_of(page, NAMES.index("slotine")).values()}
    assert fields >= {"slope", "damping", "adaptation_rate", "initial", "leakage"}
    fields = {c["key"] for c in controls_of(page, NAMES.index("entangled")).values()}
    assert "frequency" not in fields
    assert "damping" in fields


def test_orders_that_come_to_move_have_the_bounds_of_the_description(page):
    start = page.table["start"]["0.integral_order"]
    asked = [
        {"0.order_learning_rate": 0.05},
        {"0.order_learning_rate": 0.5, "0.derivative_order": [0.1, 0.2]},
        {"0.order_learning_rate": 0.5, "0.integral_order": [0.0, start[1]]},
    ]
    for run in page.check(asked):
        assert run.signals["integral_order"].min() >= 0.02
        assert run.signals["derivative_order"].min() >= 0.3


def test_orders_a_rounding_beside_0_and_1_are_the_described_ones(page):
    beside = [5e-324, 1.0 - 2.0**-53]
    page.check([{"0.derivative_order": beside, "0.integral_order": beside[::-1]}])


def test_a_start_from_before_begins_with_the_kick_of_its_order_and_step(page):
    asked = [{}, {"1.derivative_order": [0.6, 0.7]}, {"step": 0.002}, {"step": 0.01}]
    runs = page.check([{"controller": 1, **changes} for changes in asked])
    first = [np.abs(run.torque[0]).max() for run in runs]
    assert len({round(x, 6) for x in first}) == 4, "a kick depends on order and step"


def test_an_arm_with_limits_and_friction_and_a_reference_without_a_formula(tmp_path):
    arm = fp.Arm.from_example("ur5")
    plant = fp.Plant(payload={"mass": 1.0, "com": (0.05, 0.02, 0.1)})
    still = fp.references.Hold(0.2)
    job = fp.Experiment(arm, still, q0=arm.home, plant=plant, duration=DURATION)
    page = Page(tmp_path, job, [fp.suggest_gains(arm, bandwidth=10.0)])
    assert page.table["steps"] == [job.step]
    friction = [1.0, 1.0, 1.0, 0.5, 0.5, 0.2]
    page.check([{}, {"payload": 2.0, "dry_friction": friction, "viscous_friction": friction}])
    # Presets fit any arm.
    links = [x[kind] for x in page.table["presets"] for kind in ("now", "pinned") if x[kind]]
    assert [faults for faults, _ in page.ask("refuse", links)] == [[]] * len(links)


def test_an_fpid_is_offered_beside_feedforward_and_observer_and_with_orders_1(tmp_path):
    job, law = fp.paper_experiment(duration=5.0), fp.paper_controller(supervised=False)
    page = Page(tmp_path, job, [law])
    names = [law.name, "FPID + feedforward + observer", "integer PID + feedforward + observer"]
    assert [one["name"] for one in page.table["laws"]] == names
    alone, best, integer = page.check([{"controller": k} for k in range(3)])
    assert best.metrics.ise.sum() < 0.5 * alone.metrics.ise.sum()
    assert np.array_equal(best.controller.integral_order, law.integral_order)
    assert np.all(np.array(integer.controller.derivative_order) == 1.0)
    assert integer.controller.observer == best.controller.observer > 0.0
    for preset in page.table["presets"]:
        if preset["needs"] in ("best", "both"):
            laws = [page.ask("read", [preset[x]])[0]["controller"] for x in ("now", "pinned")]
            assert laws == ([1, 0] if preset["name"] == "Feedforward and observer" else [1, 2])
    # Beside a supervisor's observer there is no other.
    short = dataclasses.replace(job, duration=DURATION)
    guarded = Page(tmp_path, short, [dataclasses.replace(law, supervisor=GUARD)])
    for run in guarded.check([{"controller": k} for k in (1, 2)]):
        assert run.controller.bandwidth == GUARD.observer
    # Whoever brings such a law is offered no more.
    assert len(Page(tmp_path, job, [law, best.controller]).table["laws"]) == 2


def test_a_link_is_refused_by_name(page):
    links = {
        "kp=1": "kp: expected 2 numbers", "kp=1,x": "kp: expected 2 numbers",
        "integral_order=2,2": "integral_order: expected 0 to 1", "step=0.3": "step: expected one",
        "nonsense=1": "nonsense: no such setting",
    }  # fmt: skip
    for (_, want), (faults, same) in zip(
        links.items(), page.ask("refuse", list(links)), strict=True
    ):
        assert [fault.startswith(want) for fault in faults] == [True]
        assert same, "and ignored"
