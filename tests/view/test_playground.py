"""The playground as a browser runs it: Python's numbers, and hands that find their way."""

import dataclasses
import json
import re
from contextlib import contextmanager

import numpy as np
import pytest
from bounded import until
from own_laws import PythonPd

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config, load
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError, DesignError, ExportError

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


class Playground:
    """A playground in a browser."""

    def __init__(self, page):
        self.page = page
        self.settled()

    def settled(self):
        until(self.page, "state.got > 0 && !state.busy")

    def now(self, key):
        return self.page.evaluate(f"model.now[{json.dumps(key)}]")

    def rms(self):
        return self.page.evaluate("state.runs[0].metrics.rms")

    def click(self, selector):
        self.page.click(selector)
        self.settled()

    def slide(self, key, part):
        """Move a slider as a hand does: on the way, and let go."""
        self.page.evaluate(
            "([key, part]) => { const s = document.getElementById(key); s.value = part;"
            "s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); }",
            [key, part],
        )
        self.settled()


@pytest.fixture(scope="module")
def open_playground(visit, page_file):
    @contextmanager
    def opened(link="", width=1100, **options):
        address = f"{page_file.as_uri()}{link}"
        options = {"size": (width, 640), "reduced_motion": "reduce"} | options
        with visit(address, "window.playground !== undefined", **options) as page:
            yield Playground(page)

    return opened


@pytest.fixture(scope="module")
def opened(open_playground):
    with open_playground() as opened:
        yield opened


@pytest.fixture
def play(opened):
    """Return the page as it is when it has just been opened."""
    opened.page.evaluate(
        "element('joint').value = 'all';"
        "Object.assign(model, {past: [], future: [], committed: null});"
        "model.load(fresh(), null); model.commit();"
    )
    opened.settled()
    return opened


@pytest.mark.browser
def test_a_link_s_run_diverges_and_its_nonsense_is_said(open_playground):
    with open_playground("#step=0.05&derivative_order=1,1&nonsense=2") as play:
        assert "nonsense: no such setting" in play.page.inner_text("#message")
        said = play.page.inner_text("#outcome")
        assert re.fullmatch(r"Diverged at [\d.]+ s, joint\d: .*speed.*\.", said)
        play.click("#reset")
        assert play.page.inner_text("#outcome").startswith("Ran all")


@pytest.mark.browser
def test_a_slider_moves_the_run_and_undo_takes_it_back(play):
    before = play.rms()
    assert play.page.is_disabled("#undo")
    play.slide("integral_order", 0.3)
    assert play.now("0.integral_order") == [0.3, 0.3]
    after = play.rms()
    assert after != before
    play.slide("kp", 0.75)
    play.page.click("#undo")
    play.page.keyboard.press("Control+z")
    play.settled()
    assert play.now("0.integral_order") == [0.901, 0.931]
    assert play.rms() == before
    play.click("#redo")
    assert play.rms() == after
    play.click("#reset")
    assert play.page.is_disabled("#reset")


@pytest.mark.browser
def test_a_keyboard_moves_sliders_joint_by_joint_and_all_have_names(play):
    page = play.page
    page.locator(".opener").first.click()
    page.focus("#integral_order-1")
    for _ in range(3):
        page.keyboard.press("ArrowLeft")
    play.settled()
    assert play.now("0.integral_order") == [0.901, 0.928]
    for text in ("0.5", "1.7"):
        page.fill("[aria-label^='μ, as a number']", text)
        page.keyboard.press("Tab")
        play.settled()
        assert play.now("0.derivative_order") == [0.5, 0.5]
    assert "expected 0 to 1" in page.inner_text("#message")
    nameless = page.evaluate(
        "[...document.querySelectorAll('input, select, button, textarea')].filter(e =>"
        " !e.closest('.dg') && !(e.labels?.length"
        " || e.getAttribute('aria-label') || e.textContent.trim()))"
        ".map(e => e.outerHTML)"
    )
    assert nameless == []


@pytest.mark.browser
def test_a_pinned_run_stays_beside_the_one_that_moves_and_the_address_has_both(
    play, open_playground
):
    page, settings = play.page, "[model.now, model.pinned]"
    play.click("#pin")
    play.slide("kp", 1.0)
    row = page.inner_text("#metrics tr >> nth=0").split("\t")
    assert row[1] != row[2]
    assert re.fullmatch(r"[+−][\d.]+ %", row[3].strip())
    play.slide("velocity_noise", 0.5)
    with open_playground(page.evaluate("location.hash")) as other:
        assert other.page.evaluate(settings) == page.evaluate(settings)
        assert other.rms() == play.rms()
    play.click("#unpin")
    assert page.evaluate("state.pinned") is None


@pytest.mark.browser
def test_the_marks_of_an_axis_differ_where_a_gain_hardly_moves(play):
    marks = play.page.evaluate(
        "new Promise((done) => { const plot = plots.signal;"
        "plot.show(plot.curves.map((c) => ({...c, values: TIMES.map((t) => 100 + 1e-3 * t)})));"
        "requestAnimationFrame(() => done(plot.chart.axes[1]._values)); })"
    )
    assert len(set(marks)) == len(marks) > 2


@pytest.mark.browser
def test_several_laws_are_on_the_plots_at_once(play):
    page = play.page
    assert page.evaluate("plots.error.curves.length") == 2  # the joints
    page.check("#beside input >> nth=1")
    page.check("#beside input >> nth=2")
    play.settled()
    # One joint, a colour for each law.
    curves = "plots.error.curves.map(({kind}) => kind)"
    assert page.evaluate(curves) == [0, 1, 2]
    assert page.evaluate("state.runs.map((r) => r.controller)") == [0, 1, 2]
    assert "computed torque" in page.inner_text("#metrics-head")
    # What all share moves all, what is a law's own that law alone.
    runs = "state.runs.map((r) => r.metrics.rms[0])"
    before = page.evaluate(runs)
    play.slide("kp", 0.9)
    after = page.evaluate(runs)
    assert [a != b for a, b in zip(before, after, strict=True)] == [True, False, False]
    play.slide("payload", 0.3)
    last = page.evaluate(runs)
    assert all(a != b for a, b in zip(after, last, strict=True))
    # The sliders are those of the law that is chosen; the others stay on the plots.
    page.select_option("#controller", "2")
    play.settled()
    assert page.locator("#integral_order").count() == 0
    assert page.locator("#k0").count() == 1
    assert page.evaluate("state.runs.length") == 3


@pytest.mark.browser
def test_the_command_runs_the_toml_to_copy_as_the_page_does(play, tmp_path):
    """By its figures of merit; `test_playground_settings.py` compares each sample, in node."""
    play.slide("payload", 0.2)
    play.page.click("#toml")
    path, out = tmp_path / "copied.toml", tmp_path / "out"
    path.write_text(play.page.input_value("#given"), encoding="utf-8")
    play.page.click("#close")
    assert load(path).title == MARKUP
    assert list(load(path).controllers) == [MARKUP]
    assert main(["run", str(path), "--no-figures", "--out", str(out)]) == 0
    run = fp.Run.load(next(out.glob("*.npz")))
    for name, values in play.page.evaluate("state.runs[0].metrics").items():
        assert np.allclose(values, getattr(run.metrics, name), rtol=1e-9), name


@pytest.mark.browser
def test_on_a_phone_all_is_in_reach_and_nothing_sticks_out(open_playground):
    with open_playground(width=400, has_touch=True) as play:
        page, wide = play.page, "document.documentElement.scrollWidth <= 400"
        assert page.evaluate(wide)
        for view in ("torque", "signal", "arm", "table", "error"):
            page.tap(f"label:has(#view-{view})")
            assert page.is_visible(f"#{view}")
            assert page.evaluate(wide)
        slider = page.locator("#kp")
        slider.focus()  # as by the tab key, which must not leave it below the view
        box = slider.bounding_box()
        assert box["height"] >= 32  # a finger's
        page.touchscreen.tap(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
        play.settled()
        assert play.now("0.kp")[0] > 10.0
        assert page.locator("#error").bounding_box()["y"] >= 0  # stays in sight


@pytest.mark.browser
def test_in_a_notebooks_frame_it_works_the_same(visit, tmp_path):
    shown = fp.view.playground(experiment(), law())
    assert shown.path is None
    path = tmp_path / "notebook.html"
    path.write_text(f"<!doctype html><body>{shown._repr_html_()}</body>", encoding="utf-8")
    with visit(path.as_uri(), "true") as page:
        outcome = page.frame_locator("iframe").locator("#outcome", has_text="Ran all")
        outcome.wait_for(timeout=120_000)


def test_the_page_is_small_and_without_addresses(page_file):
    text = page_file.read_text(encoding="utf-8")
    assert page_file.stat().st_size < 1.6e6
    assert "connect-src" not in text.partition("</head>")[0]
    assert "Leon Sorokin" in text  # uPlot's licence


@pytest.mark.parametrize(
    ("job", "controller", "error", "said"),
    [
        (experiment(), PythonPd(1.0, 1.0), ExportError, "law by its functions"),
        (experiment(), law(design=fp.fractional.Crone(1e-2, 1e3, 3)), DesignError, "shared poles"),
        (dataclasses.replace(experiment(), integrator="rk4"), law(), ArgumentError, "semi_impl"),
    ],
)  # fmt: skip
def test_what_a_page_cannot_hold_is_refused_in_a_line(job, controller, error, said):
    with pytest.raises(error, match=said):
        fp.view.playground(job, controller)


def test_the_command_leaves_out_what_a_page_cannot_hold(tmp_path, capsys):
    config = tmp_path / "demo.toml"
    config.write_text(demo_config().text, encoding="utf-8")
    html = tmp_path / "page.html"
    assert main(["playground", str(config), "--html", str(html)]) == 0
    out, err = capsys.readouterr()
    assert "page.html" in out
    assert "FPID, CRONE filter: design: expected one with shared poles" in err
