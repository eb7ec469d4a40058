"""The playground as a browser runs it: Python's numbers, and hands that find their way."""

import dataclasses
import json
import re
import tomllib
from dataclasses import dataclass

import numpy as np
import pytest
from bounded import until

import fpid_pin as fp
from fpid_pin.cli.configuration import load, parse
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError, DesignError, ExportError
from fpid_pin.view.playground_page import playground_html

DURATION = 4.0
MARKUP = '<img src=x onerror="document.title=1">'


def experiment():
    return fp.paper_experiment(duration=DURATION)


def law(orders="symbol", **changes):
    return dataclasses.replace(fp.paper_controller(orders, supervised=False), **changes)


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("playground") / "page.html"
    laws = [law(name=MARKUP), law("integer"), fp.ComputedTorque(k0=100.0, k1=20.0)]
    fp.view.playground(experiment(), laws, path, title=MARKUP)
    return path


class Visit:
    """A page in a browser: what it asked for, and what went wrong in it."""

    def __init__(self, browser, path, link="", width=1200, height=800):
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, reduced_motion="reduce", has_touch=True
        )
        self.page = self.context.new_page()
        self.requests, self.errors = [], []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._console)
        self.path = path
        self.page.goto(f"{path.as_uri()}{link}")
        self.settled()

    def _console(self, message):
        if message.type == "error":
            self.errors.append(message.text)

    def __enter__(self):
        return self

    def __exit__(self, *stop):
        self.context.close()

    def until(self, expression):
        until(self.page, expression)

    def settled(self):
        self.until("window.playground && playground.state.got > 0 && !playground.state.busy")

    def now(self, key):
        return self.page.evaluate(f"playground.model.now[{json.dumps(key)}]")

    def rms(self):
        return self.page.evaluate("playground.state.runs[0].metrics.rms")

    def text(self, selector):
        return self.page.inner_text(selector)

    def slide(self, key, part):
        """Move a slider as a hand does: on the way, and let go."""
        self.page.evaluate(
            "([key, part]) => { const s = document.getElementById(key); s.value = part;"
            "s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); }",
            [key, part],
        )
        self.settled()

    def whole(self):
        """Run the settings and return every sample."""
        self.page.evaluate("playground.keep(true); playground.ask()")
        self.settled()
        return self.page.evaluate(
            "(({whole, outcome}) => [Object.fromEntries(['q', 'v', 'torque'].map((name) =>"
            " [name, Array.from(whole[name])])), outcome])(playground.state.runs[0])"
        )


@pytest.fixture
def visit(browser, page_file):
    with Visit(browser, page_file) as opened:
        yield opened
        assert opened.errors == []
        assert all(url.startswith(("file:", "blob:", "data:")) for url in opened.requests)


def same_as_python(opened, tmp_path, tolerance=1e-9):
    """Hold a page's run against that of its own TOML, run by Python."""
    text = opened.page.evaluate(
        "playground.toToml(playground.settingsOf(playground.model.now,"
        "playground.model.now.controller))"
    )
    config = parse(text, "copied.toml", tmp_path)
    assert config.experiment.dynamics == "compiled"
    run = fp.simulate(config.experiment, next(iter(config.controllers.values())))
    whole, outcome = opened.whole()
    for name in ("q", "v", "torque"):
        mine = np.array(whole[name], dtype=float).reshape(-1, run.q.shape[1])
        assert mine.shape == run.q.shape
        scale = max(1.0, float(np.abs(getattr(run, name)).max()))
        assert np.abs(mine - getattr(run, name)).max() <= tolerance * scale
    assert outcome["completed"] == run.outcome.completed
    if not run.outcome.completed:
        assert (outcome["joint"], outcome["cause"]) == (run.outcome.joint, run.outcome.cause)
        assert outcome["time"] == pytest.approx(run.outcome.time, abs=1e-9)
    return run


# ---------------------------------------------------------------------- the engine


@pytest.mark.browser
def test_the_pages_run_is_pythons_compiled_run(visit, tmp_path):
    run = same_as_python(visit, tmp_path)
    again = fp.simulate(dataclasses.replace(experiment(), dynamics="compiled"), law())
    assert np.array_equal(run.torque, again.torque)  # the TOML is the description
    metrics = visit.page.evaluate("playground.state.runs[0].metrics")
    for name, values in metrics.items():
        assert np.allclose(values, getattr(run.metrics, name), rtol=1e-9)


@pytest.mark.browser
def test_a_run_that_diverges_says_when_and_why_as_python_does(browser, page_file, tmp_path):
    with Visit(browser, page_file, "#step=0.05&derivative_order=1,1") as opened:
        said = opened.text("#outcome")
        assert re.fullmatch(r"Diverged at [\d.]+ s, joint\d: .*speed.*\.", said)
        run = same_as_python(opened, tmp_path, tolerance=1e-6)
        assert not run.outcome.completed
        opened.page.click("#reset")
        opened.settled()
        assert opened.text("#outcome").startswith("Ran all")


# ---------------------------------------------------------------------- hands


@pytest.mark.browser
def test_a_slider_moves_the_run_and_undo_takes_it_back(visit):
    before = visit.rms()
    assert visit.page.is_disabled("#undo")
    visit.slide("integral_order", 0.3)
    assert visit.now("0.integral_order") == [0.3, 0.3]
    after = visit.rms()
    assert after != before
    visit.slide("kp", 0.75)
    visit.page.click("#undo")
    visit.page.keyboard.press("Control+z")
    visit.settled()
    assert visit.now("0.integral_order") == [0.901, 0.931]
    assert visit.rms() == before
    visit.page.click("#redo")
    visit.settled()
    assert visit.rms() == after
    visit.page.click("#reset")
    assert visit.page.is_disabled("#reset")


@pytest.mark.browser
def test_a_keyboard_moves_sliders_joint_by_joint(visit):
    visit.page.locator(".opener").first.click()
    visit.page.focus("#integral_order-1")
    for _ in range(3):
        visit.page.keyboard.press("ArrowLeft")
    visit.settled()
    assert visit.now("0.integral_order") == [0.901, 0.928]
    visit.page.fill("[aria-label^='μ, as a number']", "0.5")
    visit.page.keyboard.press("Tab")
    visit.settled()
    assert visit.now("0.derivative_order") == [0.5, 0.5]
    visit.page.fill("[aria-label^='μ, as a number']", "1.7")
    visit.page.keyboard.press("Tab")
    assert "expected 0 to 1" in visit.text("#message")
    assert visit.now("0.derivative_order") == [0.5, 0.5]


@pytest.mark.browser
def test_a_pinned_run_stays_beside_the_one_that_moves(visit):
    visit.page.click("#pin")
    visit.settled()
    visit.slide("kp", 1.0)
    row = visit.page.inner_text("#metrics tr >> nth=0").split("\t")
    assert row[1] != row[2]
    assert re.fullmatch(r"[+−][\d.]+ %", row[3].strip())
    visit.page.click("#unpin")
    assert visit.page.evaluate("playground.state.pinned") is None


@pytest.mark.browser
def test_several_laws_are_on_the_plots_at_once(visit, tmp_path):
    assert visit.page.evaluate("playground.plots.error.curves.length") == 2  # the joints
    visit.page.check("#beside input >> nth=1")
    visit.page.check("#beside input >> nth=2")
    visit.settled()
    # One joint, a colour for each law.
    curves = "playground.plots.error.curves.map(({kind}) => kind)"
    assert visit.page.evaluate(curves) == [0, 1, 2]
    assert visit.page.evaluate("playground.state.runs.map((r) => r.controller)") == [0, 1, 2]
    assert "computed torque" in visit.text("#metrics-head")
    # What all share moves all, what is a law's own that law alone.
    runs = "playground.state.runs.map((r) => r.metrics.rms[0])"
    before = visit.page.evaluate(runs)
    visit.slide("kp", 0.9)
    after = visit.page.evaluate(runs)
    assert [a != b for a, b in zip(before, after, strict=True)] == [True, False, False]
    visit.slide("payload", 0.3)
    last = visit.page.evaluate(runs)
    assert all(a != b for a, b in zip(after, last, strict=True))
    # The sliders are those of the law that is chosen; the others stay on the plots.
    visit.page.select_option("#controller", "2")
    visit.settled()
    assert visit.page.locator("#integral_order").count() == 0
    assert visit.page.locator("#k0").count() == 1
    assert visit.page.evaluate("playground.state.runs.length") == 3
    same_as_python(visit, tmp_path)


@pytest.mark.browser
def test_a_link_that_makes_no_sense_says_so_and_is_ignored(browser, page_file):
    with Visit(browser, page_file, "#kp=1&nonsense=2") as opened:
        said = opened.text("#message")
        assert "kp: expected 2 numbers" in said
        assert "nonsense: no such setting" in said
        assert opened.page.is_disabled("#reset")
        assert opened.errors == []


@pytest.mark.browser
def test_the_address_carries_settings_and_pinned_run(visit, browser):
    visit.page.click("#pin")
    visit.settled()
    visit.slide("derivative_order", 0.6)
    visit.slide("velocity_noise", 0.5)
    link = visit.page.evaluate("location.hash")
    want = visit.page.evaluate("[playground.model.now, playground.model.pinned]")
    with Visit(browser, visit.path, link) as other:
        assert other.page.evaluate("[playground.model.now, playground.model.pinned]") == want
        assert other.rms() == visit.rms()


@pytest.mark.browser
def test_the_toml_to_copy_is_one_that_the_command_runs(visit, tmp_path):
    visit.slide("payload", 0.2)
    visit.page.click("#toml")
    path = tmp_path / "copied.toml"
    path.write_text(visit.page.input_value("#given"), encoding="utf-8")
    assert tomllib.loads(path.read_text())["controller"][0]["name"] == MARKUP
    assert load(path).title == MARKUP
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 0
    visit.page.click("#close")


@pytest.mark.browser
def test_names_with_markup_in_them_stay_text(visit):
    assert visit.text("h1") == MARKUP
    assert visit.page.evaluate("document.title") == MARKUP
    assert visit.page.evaluate("document.querySelectorAll('img').length") == 0
    assert MARKUP in visit.page.evaluate(
        "[...document.querySelectorAll('option')].map(o => o.text)"
    )


@pytest.mark.browser
def test_every_preset_runs_and_says_what_to_look_for(visit):
    count = visit.page.evaluate("document.querySelectorAll('#preset option').length")
    assert count >= 11
    for k in range(count - 1):
        visit.page.select_option("#preset", str(k))
        visit.settled()
        assert len(visit.text("#message")) > 20
        assert visit.text("#outcome")[:3] in ("Ran", "Div")


@pytest.mark.browser
def test_on_a_phone_all_is_in_reach_and_nothing_sticks_out(browser, page_file):
    with Visit(browser, page_file, width=400, height=800) as opened:
        wide = "document.documentElement.scrollWidth <= 400"
        assert opened.page.evaluate(wide)
        for view in ("torque", "signal", "arm", "table", "error"):
            opened.page.tap(f"label:has(#view-{view})")
            assert opened.page.is_visible(f"#{view}")
            assert opened.page.evaluate(wide)
        slider = opened.page.locator("#kp")
        slider.scroll_into_view_if_needed()
        box = slider.bounding_box()
        assert box["height"] >= 32  # a finger's
        opened.page.touchscreen.tap(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
        opened.settled()
        assert opened.now("0.kp")[0] > 10.0
        assert opened.page.locator("#error").bounding_box()["y"] >= 0  # stays in sight


@pytest.mark.browser
def test_everything_to_be_moved_has_a_name(visit):
    nameless = visit.page.evaluate(
        "[...document.querySelectorAll('input, select, button, textarea')].filter(e =>"
        " !e.closest('.dg') && !(e.labels?.length"
        " || e.getAttribute('aria-label') || e.textContent.trim()))"
        ".map(e => e.outerHTML)"
    )
    assert nameless == []


@pytest.mark.browser
def test_in_a_notebooks_frame_it_works_the_same(browser, tmp_path):
    shown = fp.view.playground(experiment(), law())
    assert shown.path is None
    path = tmp_path / "notebook.html"
    path.write_text(f"<!doctype html><body>{shown._repr_html_()}</body>", encoding="utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("#outcome", has_text="Ran all").wait_for(timeout=120_000)
    page.close()


# ---------------------------------------------------------------------- making it


def test_the_page_is_small_and_without_addresses(page_file):
    text = page_file.read_text(encoding="utf-8")
    assert page_file.stat().st_size < 1.6e6
    assert "connect-src" not in text.partition("</head>")[0]
    assert "Leon Sorokin" in text  # uPlot's licence


@dataclass(frozen=True, eq=False)
class InPython(fp.Controller):
    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return q_ref - q


@pytest.mark.parametrize(
    ("controller", "error", "said"),
    [
        (InPython(), ExportError, "law by its functions"),
        (law(design=fp.fractional.Crone(1e-2, 1e3, 3)), DesignError, "shared poles"),
    ],
)
def test_what_a_page_cannot_hold_is_refused_in_a_line(controller, error, said):
    with pytest.raises(error, match=said):
        playground_html(experiment(), controller)


def test_rk4_is_refused():
    with pytest.raises(ArgumentError, match="semi_implicit_euler"):
        playground_html(dataclasses.replace(experiment(), integrator="rk4"), law())


def test_the_command_leaves_out_what_a_page_cannot_hold(tmp_path, capsys):
    from fpid_pin.cli.configuration import demo_config

    config = tmp_path / "demo.toml"
    config.write_text(demo_config().text, encoding="utf-8")
    html = tmp_path / "page.html"
    assert main(["playground", str(config), "--html", str(html)]) == 0
    out, err = capsys.readouterr()
    assert "page.html" in out
    assert "FPID, CRONE filter: design: expected one with shared poles" in err
    assert main(["playground", str(config), "--controller", "nobody"]) == 2
    assert "--controller" in capsys.readouterr().err
