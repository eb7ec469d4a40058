"""Whatever a page's settings say, its run is that of its own TOML: in node, many at once."""

import dataclasses
import json
import re
import shutil

import numpy as np
import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.cli.config import parse
from fpid_pin.view.document import asset
from fpid_pin.view.playground_page import playground_html

#: Runs are short: settings that are chaotic have no time to show it.
DURATION = 0.25
ASK = """
const asked = JSON.parse(require("fs").readFileSync(process.argv[2]));
const said = asked.map((changes) => {
  const S = {...fresh(changes.controller ?? 0), ...changes};
  const {q, v, torque, metrics, outcome} = simulate(S);
  return {toml: toToml(S), q: [...q], v: [...v], torque: [...torque], metrics, outcome};
});
process.stdout.write(JSON.stringify(said));
"""
GUARD = fp.Supervisor.quiet(m_x=3.0, reference_bound=1.5)


def fpid(**others):
    return fp.AdaptiveFpid(
        kp=(60.0, 30.0), ki=30.0, kd=(12.0, 6.0), integral_order=(0.9, 0.8), derivative_order=0.8,
        learning_rate=2.0, **others,
    )  # fmt: skip


LAWS = [
    fp.paper_controller(supervised=False),
    fpid(feedforward=True, observer=60.0, initialisation="grunwald_letnikov"),
    fpid(supervisor=dataclasses.replace(GUARD, kind="paper", observer=0.0, trigger=0.0),
         safeguards=fp.Safeguards(minimum=1.0, maximum=80.0, sigma=0.05)),
    fpid(order_learning_rate=0.02, initialisation="grunwald_letnikov", regressors="integer"),
]  # fmt: skip


class Page:
    """The scripts of a page that need no window, in node."""

    def __init__(self, folder, job, laws):
        if shutil.which("node") is None:
            pytest.skip("no node")
        text = playground_html(job, laws)
        tables = re.search(r"const SCENE = .*?;(?=\n|</script>)", text, re.DOTALL).group()
        engine = re.search(r'id="engine">(.*?)</script>', text, re.DOTALL).group(1)
        self.table = json.loads(re.search(r"PAGE = (\{.*\});", tables, re.DOTALL).group(1))
        self.folder, self.script = folder, folder / "page.js"
        settings = asset("playground_settings.js").replace('"use strict";', "", 1)
        parts = ["const self = {};", tables, settings, engine, ASK]
        self.script.write_text("\n".join(parts), encoding="utf-8")

    def run(self, asked):
        """Return what the page makes of settings, each a change of a described controller's."""
        path = self.folder / "asked.json"
        path.write_text(json.dumps(asked))
        command = ["node", str(self.script), str(path)]
        done = finished(command, timeout=240)
        assert done.returncode == 0, done.stderr[-1000:]
        return json.loads(done.stdout)

    def check(self, asked):
        """Hold runs against those of their own TOML, run by Python; return these."""
        runs = []
        for changes, mine in zip(asked, self.run(asked), strict=True):
            config = parse(mine["toml"], "copied.toml", self.folder)
            assert config.experiment.dynamics == "compiled"
            run = fp.simulate(config.experiment, next(iter(config.controllers.values())))
            for name in ("q", "v", "torque"):
                want = getattr(run, name)
                found = np.array(mine[name], dtype=float).reshape(want.shape)
                scale = max(1.0, float(np.abs(want).max()))
                assert np.abs(found - want).max() <= 1e-9 * scale, (changes, name)
            assert mine["outcome"]["completed"] == run.outcome.completed, changes
            if run.outcome.completed:
                for name, values in mine["metrics"].items():
                    assert np.allclose(values, getattr(run.metrics, name), rtol=1e-8), changes
            runs.append(run)
        return runs


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    job = fp.paper_experiment(duration=DURATION)
    return Page(tmp_path_factory.mktemp("page"), job, LAWS)


def places_of(control, start, steps):
    """Return two values of a slider, as its setting has them; of a switch the other one."""
    scale, low, high = control["scale"], control["low"], control["high"]
    if scale == "switch":
        return [not start]
    if scale == "stops":
        return [steps[0], steps[-2]]
    if scale == "gain":
        return [[0.4 * x for x in start], [1.9 * x for x in start]]
    if scale in ("log", "log0", "limit"):
        low = control["least"] or low
        found = [low * (high / low) ** 0.4, low * (high / low) ** 0.7]
    else:
        found = [low + 0.3 * (high - low), low + 0.8 * (high - low)]
    if control["key"] == "delay":
        found = [float(round(x)) for x in found]
    return [[x, 0.9 * x] if isinstance(start, list) else x for x in found]


@pytest.mark.filterwarnings("ignore::fpid_pin.FpidWarning")
@pytest.mark.parametrize("controller", range(len(LAWS)))
def test_every_slider_from_every_preset_is_as_its_toml(page, controller):
    controls = [c for group in page.table["groups"] for c in group["controls"]]
    start, asked = page.table["starts"][controller], []
    assert len(controls) > 20
    assert len(page.table["presets"]) > 10
    for k, preset in enumerate(page.table["presets"]):
        base = {**preset["now"], "controller": controller}
        for control in controls:
            key = control["key"]
            values = places_of(control, base.get(key, start[key]), page.table["steps"])
            # From the description to both places, else to one of them.
            asked += [
                {**base, key: value} for value in (values if k == 0 else values[k % 2 - 1 :][:1])
            ]
    page.check(asked)


def test_orders_that_come_to_move_have_the_bounds_of_the_description(page):
    start = page.table["starts"][0]["integral_order"]
    asked = [
        {"order_learning_rate": 0.05}, {"order_learning_rate": 0.5, "derivative_order": [0.1, 0.2]},
        {"order_learning_rate": 0.5, "integral_order": [0.0, start[1]]},
    ]  # fmt: skip
    for run in page.check(asked):
        assert run.signals["integral_order"].min() >= 0.02
        assert run.signals["derivative_order"].min() >= 0.3


def test_a_start_from_before_begins_with_the_kick_of_its_order_and_step(page):
    asked = [{}, {"derivative_order": [0.6, 0.7]}, {"step": 0.002}, {"step": 0.01}]
    runs = page.check([{"controller": 1, **changes} for changes in asked])
    first = [np.abs(run.torque[0]).max() for run in runs]
    assert len({round(x, 6) for x in first}) == 4, "a kick depends on order and step"
