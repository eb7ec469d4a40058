"""Pages as a real browser shows them."""

import io
import threading

import numpy as np
import pytest
from bounded import ended, until, wait_until
from PIL import Image

from fpid_pin import Arm, paper_controller, paper_experiment
from fpid_pin.simulation import Comparison
from fpid_pin.view import export_html, live, play, report_html

pytestmark = pytest.mark.browser

LOADED = "window.fpidPin !== undefined"
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


@pytest.mark.parametrize("name", ["two_link", "ur5"])
def test_an_exported_page_draws_the_arm_and_moves_it(visit, make_run, tmp_path, name):
    arm = Arm.two_link() if name == "two_link" else Arm.from_example(name)
    run = make_run(arm)
    file = export_html(run, tmp_path / "run.html")
    with visit(f"{file.as_uri()}#t=0.2") as page:
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
        rows = f"fpidPin.views[0].tracks[0].sampleValues.subarray({30 * arm.n}, {31 * arm.n})"
        seen = page.evaluate(f"fpidPin.views[0].arm.tool({rows}).toArray()")
        assert seen == pytest.approx(arm.tool_pose(run.q[30 * 33])[:3, 3], abs=1e-6)


def test_a_page_slides_and_turns_joints_as_pinocchio_does(visit, scara_run, tmp_path):
    file = export_html(scara_run, tmp_path / "run.html")
    with visit(f"{file.as_uri()}#t=0.1") as page:
        page.evaluate("fpidPin.seek(0.1)")
        page.evaluate(DRAWN)
        view, q = "fpidPin.views[0].arm", scara_run.q[100]
        at = page.evaluate(f"{view}.turns.map(([turn]) => turn.position.length())")
        assert at == pytest.approx([0.0, abs(q[1]), abs(q[2])], abs=1e-4)
        tool = page.evaluate(f"{view}.tool({q.tolist()}).toArray()")
        assert tool == pytest.approx(scara_run.arm.tool_pose(q)[:3, 3], abs=1e-6)
        assert page.evaluate("fpidPin.views[0].arcs.length") == 3


def test_both_time_sliders_move_the_arms_that_stand_under_their_captions(
    visit, make_run, two_link, tmp_path
):
    """Meshcat's own slider, and ours; play goes on from there."""
    runs = [make_run(two_link, name=name) for name in ("integer", "fractional")]
    file = export_html(runs, tmp_path / "run.html")
    with visit(f"{file.as_uri()}#t=0", size=(400, 700)) as page:
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
        centres = page.evaluate(
            "fpidPin.views.map((v) => v.label.getWorldPosition(v.label.position.clone())"
            ".project(fpidPin.viewer.camera).toArray())"
        )
        assert centres[0][0] < centres[1][0] - 0.4
        assert all(-1 < x < 1 and -1 < y < 1 for x, y, _ in centres)
        assert page.locator("#runs h2").all_text_contents() == ["integer", "fractional"]
        page.click("#play")
        until(page, "fpidPin.viewer.animator.time > 1.2")
        assert page.inner_text("#play") == "Pause"


def test_no_caption_stands_on_another(visit, make_run, two_link, tmp_path):
    runs = [make_run(two_link, name=f"{name} + feedforward + observer") for name in ("PID", "FPID")]
    file = export_html(runs, tmp_path / "run.html")
    with visit(f"{file.as_uri()}#t=0") as page:
        sizes, places = page.evaluate(
            "[fpidPin.views.map(({label}) => [label.scale.x, label.scale.y]), fpidPin.views.map("
            "({label, table}) => [table.offset[0], label.position.z])]"
        )
        apart = np.abs(np.subtract(*places))
        assert (apart >= 0.999 * np.mean(sizes, axis=0)).any()


def test_a_report_is_readable_at_any_width(visit, make_run, two_link, tmp_path):
    runs = [make_run(two_link, name="integer", integer=True), make_run(two_link, name="other")]
    compared = Comparison(("nominal",), ("integer", "other"), tuple(runs))
    # Of six joints it would be as long.
    cells = [{"joint": f"joint {k}", **dict.fromkeys("abcdefgh", k)} for k in range(20)]
    file = report_html(
        runs, tmp_path / "report.html", title="Report", config_text="a = 1",
        tables={"Figures of merit": compared.joint_rows(), "Long": cells},
    )  # fmt: skip
    with visit(file.as_uri(), "document.readyState === 'complete'", (400, 900)) as page:
        folded = page.locator("details table")
        assert not folded.is_visible()
        page.click("details summary")
        for width, scheme in ((400, "dark"), (1400, "light")):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme=scheme)
            page.evaluate(DRAWN)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            for selector, count in (("table", 3), ("figure svg", 6), ("iframe", 1), ("pre", 1)):
                boxes = [item.bounding_box() for item in page.locator(selector).all()]
                assert len(boxes) == count, selector
                for box in boxes:
                    assert box["height"] > 20, selector
                    assert 0 <= box["x"] < box["x"] + box["width"] <= width + 1, selector
            assert page.locator("td").first.is_visible()
            edges = page.locator("td").evaluate_all(
                "all => all.map((one) => getComputedStyle(one).paddingLeft)"
            )
            assert width > 400 or len(set(edges)) == 1  # a phone has a row's cells below each other
            paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
            assert page.evaluate("getComputedStyle(document.body).color") != paper
        order = page.locator("section").evaluate_all("all => all.map(one => one.id)")
        assert order == ["replay", "figures", "figures-of-merit", "long", "configuration",
                         "versions"]  # fmt: skip
        until(page.frames[1], "window.fpidPin !== undefined")


def in_thread(work):
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def address_in(said):
    """Wait for the line with a page's address; return this."""
    assert wait_until(lambda: any("http" in text for text in said))
    return next(text for text in said if "http" in text).split()[1]


def test_a_live_view_shows_the_loop_and_takes_a_push(visit):
    said, reports = [], []

    def session():
        reports.append(
            live(paper_experiment(), paper_controller(), duration=200.0, open_browser=False,
                 priority=False, announce=said.append)
        )  # fmt: skip

    thread = in_thread(session)
    # That its server goes is an error in the page's log.
    with visit(address_in(said), f"{LOADED} && fpidPin.frames() > 5", sound=False) as page:
        first = picture(page)
        page.keyboard.press("2")
        page.keyboard.press("-")
        assert wait_until(lambda: changed(first, picture(page)) > 0.005)
        assert wait_until(lambda: any(" N m on " in text for text in said))
        page.keyboard.press("q")
        assert ended(thread)
        until(page, "!document.getElementById('message').hidden")
    (_, joint, torque), *_ = reports[0].pushes
    assert (joint, torque < 0.0) == ("joint2", True)


def test_play_gives_a_browser_the_page_and_ends(visit, make_run, two_link):
    said, over = [], []
    run = make_run(two_link, duration=1.0)
    thread = in_thread(lambda: over.append(play(run, open_browser=False, announce=said.append)))
    with visit(address_in(said)) as page:
        assert ended(thread)
        assert over == [None]
        # It needs nobody any more.
        until(page, f"{LOADED} && fpidPin.viewer.animator.time > 0.2")
