"""The policy of pages: what a browser runs of them, and what of what is slipped into them."""

import base64
import contextlib
import hashlib
import re
from html import unescape

import pytest
from bounded import until

import fpid_pin as fp
from fpid_pin.view import report_html
from fpid_pin.view.document import document
from fpid_pin.view.link import LiveLink
from fpid_pin.view.replay import experiment_scene, render, replay_html

META = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)
#: Ways to run what is not ours, from within a page; each sets `hacked`.
INJECTED = (
    "<script>window.hacked = 'script'</script>"
    "<script type='module'>window.hacked = 'module'</script>"
    "<img src='data:,' onerror=\"window.hacked = 'handler'\">"
    "<svg onload=\"window.hacked = 'svg'\"></svg>"
    "<iframe srcdoc=\"<script>parent.hacked = 'frame'</script>\"></iframe>"
    "<iframe src=\"javascript:parent.hacked = 'address'\"></iframe>"
    "<script src='data:text/javascript,window.hacked = 1'></script>"
    "<a id='bait' href=\"javascript:window.hacked = 'link'\">link</a>"
)
ADDED = """
window.hacked2 = undefined;
for (const text of ["window.hacked2 = 'added'"]) {
  const script = document.createElement("script");
  script.textContent = text;
  document.body.append(script);
  const picture = document.createElement("div");
  picture.innerHTML = "<img src='data:,' onerror=\\"window.hacked2 = 'inner'\\">";
  document.body.append(picture);
}
"""
LAW = fp.paper_controller(supervised=False)
#: Each kind of page: its text, and what is true in it once it is there.
PAGES = {
    "replay": (replay_html, "window.fpidPin !== undefined"),
    "report": (
        lambda run: report_html(run, "report.html", title="report").read_text("utf-8"),
        "document.querySelectorAll('table').length > 1",
    ),
    "playground": (
        lambda run: fp.view.playground(fp.paper_experiment(duration=0.5), LAW).text,
        "window.playground && playground.state.got > 0",
    ),
    "live": (
        lambda run: render(experiment_scene(run.experiment, "live", 1.0) | {"live": True}, "live"),
        "window.fpidPin !== undefined",
    ),
}


@pytest.fixture(scope="module")
def made(wave, tmp_path_factory):
    """Return the text of each page."""
    with contextlib.chdir(tmp_path_factory.mktemp("pages")):
        return {kind: make(wave) for kind, (make, _) in PAGES.items()}


@pytest.mark.parametrize("kind", PAGES)
def test_a_page_names_its_scripts_by_their_hashes_and_allows_no_others(kind, made):
    page = made[kind]
    (policy,) = META.findall(page)
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    scripts = SCRIPT.findall(page)
    if kind == "report":
        # The replay in its frame is bound by both policies, so the outer one names its scripts.
        inner = unescape(re.search(r'srcdoc="([^"]*)"', page)[1])
        (within,) = META.findall(inner)
        assert set(re.findall("'sha256-[^']*'", within)) < set(re.findall("'sha256-[^']*'", policy))
        assert len(scripts) == 1
        scripts += SCRIPT.findall(inner)
    hashes = {
        f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'"
        for s in scripts
    }  # fmt: skip
    assert len(scripts) >= 3
    assert set(rules.pop("script-src").split()) == hashes
    assert rules.pop("default-src") == "'none'"
    assert ("connect-src" in rules) == (kind == "live")
    assert rules.pop("style-src") == "'unsafe-inline'"
    assert "unsafe" not in "".join(rules.values())
    # The policy stands before anything that it is to bind.
    assert "<script" not in page.partition(policy)[0]
    assert "<style" not in page.partition(policy)[0]


@pytest.mark.browser
@pytest.mark.parametrize("kind", PAGES)
def test_what_is_slipped_into_a_page_does_not_run_and_the_page_does(visit, kind, made, tmp_path):
    text = made[kind].replace("<body>", f"<body>{INJECTED}", 1)
    text = text.replace("</body>", f"{INJECTED}</body>")
    path = tmp_path / "page.html"
    path.write_text(text, encoding="utf-8")
    with contextlib.ExitStack() as stack:
        address = path.as_uri()
        if kind == "live":
            address = stack.enter_context(LiveLink(text, announce=lambda line: None)).url
        page = stack.enter_context(visit(address, PAGES[kind][1], sound=False))
        page.evaluate("document.getElementById('bait').click()")
        page.evaluate(ADDED)
        page.wait_for_timeout(300)
        assert page.evaluate("[window.hacked, window.hacked2]") == [None, None]
        with contextlib.suppress(Exception):
            assert not page.evaluate("fetch('http://127.0.0.1:9/').then(() => true)")


@pytest.mark.browser
def test_without_the_policy_each_of_these_runs(visit, tmp_path):
    """Else the tests above could not fail."""
    path = tmp_path / "open.html"

    def write(body):
        text = META.sub("", document("open", style="", body=body))
        path.write_text(text, encoding="utf-8")
        return path.as_uri()

    with visit(write(INJECTED), "window.hacked !== undefined", sound=False) as page:
        page.evaluate(ADDED)
        until(page, "window.hacked2 === 'inner'")
        for piece in re.findall(
            r"<(?:script|img|svg|iframe)[^>]*>.*?(?=<script|<img|<svg|<iframe|<a)", INJECTED
        ):
            page.goto(write(piece))
            until(page, "window.hacked !== undefined")


#: Texts in a script that might end it, or be changed on the way.
TEXTS = (
    "const a = '</script>' + '<!-- <script>' + '</SCRIPT>'; window.ends = a.length === 31;",
    "const b = `1\r\n2\r3\n`;\r\nwindow.lines = b === '1\\n2\\n3\\n';",
    "window.letters = 'é\u2028😀'.length === 4;",
)


@pytest.mark.browser
def test_any_script_is_what_its_hash_says(visit, tmp_path):
    path = tmp_path / "page.html"
    text = document("x", style="", body="", scripts=TEXTS)
    path.write_text(text, encoding="utf-8", newline="")
    with visit(path.as_uri(), "window.letters !== undefined") as page:
        assert page.evaluate("[ends, lines, letters]") == [True] * 3
