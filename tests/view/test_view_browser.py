"""Pages as a real browser shows them."""

import io
import threading

import numpy as np
import pytest
from bounded import ended, until, wait_until
from PIL import Image

from fpid_pin import Arm, paper_controller, paper_experiment
from fpid_pin.view import export_html, live, play, report_html

pytestmark = pytest.mark.browser

#: Small: software draws these pages.
SIZE = {"width": 420, "height": 300}
# Only the drawing: panel and clock say the time, too.
BARE = "document.querySelectorAll('#panel, #clock, .dg').forEach((e) => e.remove())"
GROUPS = (
    "for (const k of {groups}) fpidPin.viewer.set_property(['fpid_pin', '1 wave', k], 'visible', "
    "{on}); fpidPin.viewer.set_dirty();"
)


# Resolves when what was asked for until now has been drawn.
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def picture(page):
    page.evaluate(DRAWN)
    image = Image.open(io.BytesIO(page.screenshot()))
    return np.asarray(image.convert("RGB")).astype(int)


def changed(a, b):
    """Part of the pixels that differ visibly."""
    return float((np.abs(a - b).max(axis=2) > 24).mean())


class Visit:
    """A page, what it asked for, and what went wrong in it."""

    def __init__(self, browser, size=None, scheme="light"):
        self.page = browser.new_page(viewport=size or SIZE, color_scheme=scheme)
        self.requests, self.errors = [], []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._console)

    def _console(self, message):
        if message.type == "error":
            self.errors.append(message.text)

    def __enter__(self):
        return self

    def __exit__(self, *rest):
        self.page.close()


@pytest.mark.parametrize("name", ["two_link", "ur5"])
def test_an_exported_page_draws_the_arm_and_moves_it(browser, make_run, tmp_path, name):
    arm = Arm.two_link() if name == "two_link" else Arm.from_example(name)
    run = make_run(arm)
    file = export_html(run, tmp_path / "run.html")
    with Visit(browser) as visit:
        page = visit.page
        page.goto(f"{file.as_uri()}#t=0.2")
        until(page, "window.fpidPin !== undefined")
        page.evaluate(BARE)
        page.evaluate("fpidPin.seek(0.2)")
        first = picture(page)
        assert first.std() > 5.0
        page.evaluate("fpidPin.seek(1.6)")
        later = picture(page)
        assert changed(first, later) > 0.004
        page.evaluate("fpidPin.seek(0.2)")
        assert changed(first, picture(page)) < 1e-3
        everything = ["actual", "desired", "path", "torque"]
        page.evaluate(GROUPS.format(groups=everything, on="false"))
        empty = picture(page)
        for group in everything if name == "two_link" else ["actual"]:
            page.evaluate(GROUPS.format(groups=[group], on="true"))
            assert changed(empty, picture(page)) > (0.01 if group == "actual" else 2e-4), group
            page.evaluate(GROUPS.format(groups=[group], on="false"))
        # Where Pinocchio has it.
        seen = page.evaluate("fpidPin.views[0].arm.tool(fpidPin.views[0].row('q', 30)).toArray()")
        assert seen == pytest.approx(arm.tool_pose(run.q[1000])[:3, 3], abs=1e-6)
        assert visit.requests == [file.as_uri()]
        assert visit.errors == []


def test_both_time_sliders_move_the_arm(browser, wave, tmp_path):
    """Meshcat's own, and ours; play goes on from there."""
    file = export_html(wave, tmp_path / "run.html")
    with Visit(browser) as visit:
        page = visit.page
        page.goto(f"{file.as_uri()}#t=0")
        until(page, "window.fpidPin !== undefined")
        angle = "fpidPin.views[0].arm.turns[0][0].quaternion.toArray()"
        page.evaluate("fpidPin.viewer.animator.time_scrubber.setValue(1.0)")
        until(page, "document.getElementById('time').textContent === 't = 1.00 s of 2.0 s'")
        page.evaluate(DRAWN)
        by_meshcat = page.evaluate(angle)
        page.evaluate("fpidPin.seek(0)")
        page.evaluate(DRAWN)
        assert page.evaluate(angle) != by_meshcat
        page.fill("#seek", "1")
        page.evaluate(DRAWN)
        assert page.evaluate(angle) == pytest.approx(by_meshcat)
        page.click("#play")
        until(page, "fpidPin.viewer.animator.time > 1.2")
        assert page.inner_text("#play") == "Pause"
        assert visit.errors == []


def test_runs_stand_side_by_side_under_their_captions(browser, make_run, two_link, tmp_path):
    runs = [make_run(two_link, name=name) for name in ("integer", "fractional")]
    file = export_html(runs, tmp_path / "run.html")
    with Visit(browser, {"width": 400, "height": 700}) as visit:
        page = visit.page
        page.goto(f"{file.as_uri()}#t=1")
        until(page, "window.fpidPin !== undefined")
        page.evaluate(DRAWN)
        centres = page.evaluate(
            "fpidPin.views.map((v) => v.label.getWorldPosition(v.label.position.clone())"
            ".project(fpidPin.viewer.camera).toArray())"
        )
        assert centres[0][0] < centres[1][0] - 0.4
        assert all(-1 < x < 1 and -1 < y < 1 for x, y, _ in centres)
        assert page.locator("#runs h2").all_text_contents() == ["integer", "fractional"]


def test_a_report_is_readable_at_any_width(browser, make_run, two_link, tmp_path):
    runs = [make_run(two_link, name="integer", integer=True), make_run(two_link, name="other")]
    file = report_html(runs, tmp_path / "report.html", title="Report", config_text="a = 1")
    with Visit(browser, {"width": 400, "height": 900}) as visit:
        page = visit.page
        page.goto(file.as_uri())
        for width, scheme in ((400, "dark"), (1400, "light")):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme=scheme)
            page.evaluate(DRAWN)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            for selector, count in (("table", 2), ("figure svg", 5), ("iframe", 1), ("pre", 1)):
                boxes = [item.bounding_box() for item in page.locator(selector).all()]
                assert len(boxes) == count, selector
                for box in boxes:
                    assert box["height"] > 20, selector
                    assert 0 <= box["x"] < box["x"] + box["width"] <= width + 1, selector
            assert page.locator("td").first.is_visible()
            paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
            assert page.evaluate("getComputedStyle(document.body).color") != paper
        until(page.frames[1], "window.fpidPin !== undefined")
        assert visit.requests == [file.as_uri()]
        assert visit.errors == []


def test_the_long_table_of_a_six_joint_report_is_folded_and_fits_the_page(
    browser, make_run, tmp_path
):
    arm = Arm.from_example("ur5")
    runs = [make_run(arm, name="one"), make_run(arm, name="another", lag=0.6)]
    file = report_html(runs, tmp_path / "report.html", title="Report", figures={})
    with Visit(browser, {"width": 1280, "height": 900}) as visit:
        page = visit.page
        page.goto(file.as_uri())
        table = page.locator("details table")
        assert not table.is_visible()
        page.click("details summary")
        box, frame = table.bounding_box(), page.locator("details .wide").bounding_box()
        assert box["x"] + box["width"] <= frame["x"] + frame["width"] <= 1280
        order = page.locator("section").evaluate_all("all => all.map(one => one.id)")
        assert order == ["replay", "figures-of-merit", "versions"]
        assert visit.errors == []


def in_thread(work):
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_a_live_view_shows_the_loop_and_takes_a_push(browser):
    said, reports = [], []

    def session():
        reports.append(
            live(paper_experiment(), paper_controller(), duration=200.0, open_browser=False,
                 priority=False, announce=said.append)
        )  # fmt: skip

    thread = in_thread(session)
    with Visit(browser) as visit:
        page = visit.page
        assert wait_until(lambda: any("http" in text for text in said))
        url = next(text for text in said if "http" in text).split()[1]
        page.goto(url)
        until(page, "window.fpidPin !== undefined && fpidPin.frames() > 5")
        first = picture(page)
        page.keyboard.press("2")
        page.keyboard.press("-")
        assert wait_until(lambda: changed(first, picture(page)) > 0.005)
        assert wait_until(lambda: any(" N m on " in text for text in said))
        page.keyboard.press("q")
        assert ended(thread)
        until(page, "!document.getElementById('message').hidden")
        assert {request.partition(":")[0] for request in visit.requests} == {"http"}
        assert visit.requests == [url]
    (_, joint, torque), *_ = reports[0].pushes
    assert (joint, torque < 0.0) == ("joint2", True)


def test_play_gives_a_browser_the_page_and_ends(browser, make_run, two_link):
    said, over = [], []
    run = make_run(two_link, duration=1.0)
    thread = in_thread(lambda: over.append(play(run, open_browser=False, announce=said.append)))
    with Visit(browser) as visit:
        page = visit.page
        assert wait_until(lambda: said)
        page.goto(next(text for text in said if "http" in text).split()[1])
        assert ended(thread)
        assert over == [None]
        # It needs nobody any more.
        until(page, "window.fpidPin !== undefined && fpidPin.viewer.animator.time > 0.2")
        assert visit.errors == []
