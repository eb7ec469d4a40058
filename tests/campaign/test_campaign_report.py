"""Figures and reports of campaigns, as files say and as a browser shows them."""

import re
from html.parser import HTMLParser
from urllib.parse import quote

import numpy as np
import pytest
from studies import arms, campaign

from fpid_pin.campaign import figures
from fpid_pin.campaign.report import answer, report_html
from fpid_pin.campaign.statistics import comparisons
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.view.style import colour, figure_bytes

NAMES = ("adaptive FPID", "<b>PD</b> & $gravity_", "computed torque")


class Page(HTMLParser):
    """Tags, texts by tag, and where links lead."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.links, self.cells, self.lines = [""], [], [], []
        self.text = path.read_text(encoding="utf-8")
        self.feed(self.text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "a":
            self.links.append(dict(attributes)["href"])
        if tag in ("td", "th"):
            self.cells.append("")
        if tag == "p":
            self.lines.append("")

    def handle_data(self, data):
        if self.tags[-1] in ("td", "th", "i", "span", "a") and self.cells:
            self.cells[-1] += data
        if self.tags[-1] == "p":
            self.lines[-1] += data


@pytest.fixture(scope="module")
def data():
    return arms(300, NAMES)


def replay_of(run, name):
    return f"{quote(f'run {run} of {name}', safe='')}.html"


@pytest.fixture(scope="module")
def report(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return report_html(data, folder / "report.html", replay_link=replay_of)


# ---------------------------------------------------------------------- what it says


def test_the_answer_comes_first_and_is_the_tables(data, report):
    page = Page(report)
    rate = 100.0 * data.success[:, 0].mean()
    assert page.lines[0].startswith(f"adaptive FPID succeeded on {rate:.4g} % of 300 plants (95 %:")
    assert page.lines[2].startswith("Against <b>PD</b> & $gravity_: the smaller error on ")
    assert f"{rate:.4g}" in page.cells
    heads = re.findall("<h2>(.*?)</h2>", page.text)
    assert heads == [
        "Success", "Errors and effort", "Paired differences", "Figures", "Sensitivity",
        "The ten worst runs",
    ]  # fmt: skip
    assert page.tags.count("svg") == 4
    assert page.tags.count("details") == 3 + 3 + 3


def test_markup_stays_text_and_every_one_of_the_worst_runs_has_its_replay(data, report, tmp_path):
    evil = '"><script>alert(1)</script>'
    page = Page(report_html(data, tmp_path / "r.html", replay_link=lambda run, name: evil))
    assert (page.links[-1], page.tags.count("script")) == (evil, 1)
    page = Page(report)
    assert "b" not in page.tags
    assert page.tags.count("script") == 1  # that which sorts tables
    assert "<b>PD</b> & $gravity_" in page.cells
    links = [link for link in page.links if not link.startswith("#")]
    assert len(links) == 3 * 10
    worst = int(np.argmax(~data.success[:, 0]))
    assert links[0] == f"run%20{worst}%20of%20adaptive%20FPID.html"


@pytest.mark.parametrize(
    ("case", "answer"),
    [
        (campaign(np.full((40, 2), np.nan), np.random.default_rng(0).random((40, 2))),
         "No controller succeeded on any of 40 plants (95 %: 0 to 8.762 %)."),
        (campaign([[0.1]], [[1.0]]), "A succeeded on 100 % of 1 plant (95 %: 20.65 to "),
        (campaign([[0.0, 0.0]] * 30, [[1.0]] * 30), "A succeeded on 100 % of 30 plants"),
    ],
    ids=["all fail", "one run of one controller", "ties, no error and a constant"],
)  # fmt: skip
def test_a_campaign_that_says_little_says_so(tmp_path, case, answer):
    page = Page(report_html(case, tmp_path / "r.html"))
    assert page.lines[0].startswith(answer)
    assert ("Paired differences" in page.text) == (len(case.controllers) > 1)
    assert ("no plant on which either is better" in page.text) == (case.runs == 30)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_answer_is_told_from_the_leaders_side(order):
    data = campaign([[1.0, 2.0], [2.0, 1.0]] * 20)
    line = answer(data, comparisons(data))[2]
    assert "on 50 % of 40 plants, which does not tell them apart; where both" in line
    errors = np.array([[1.0, 3.0]] * 30 + [[2.0, 1.5]] * 10)[:, order]
    data = campaign(errors, names=tuple(np.array(["good", "bad"])[list(order)]))
    line = answer(data, comparisons(data))[2]
    assert line == (
        "Against bad: the smaller error on 75 % of 40 plants; where both succeed, -2 rad in the "
        "median (95 %: -2 to -2)."
    )


def test_a_campaign_without_runs_and_a_place_that_cannot_be_written_are_refused(data, tmp_path):
    with pytest.raises(ArgumentError, match="data: expected at least one run, got none"):
        report_html(campaign(np.empty((0, 1))), tmp_path / "r.html")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileFormatError, match="cannot be written"):
        report_html(data, tmp_path / "file" / "r.html")


# ---------------------------------------------------------------------- figures


def test_a_controller_has_one_colour_in_every_figure(data):
    for draw in (figures.distributions, figures.violins, figures.tornado_plot):
        text = figure_bytes(draw(data), "svg").decode()
        assert all(colour(k).lower() in text for k in range(3))


def test_the_scatter_takes_the_parameters_that_matter(data):
    assert figures.two_that_matter(data)[0] == 0  # the payload
    assert figures.two_that_matter(campaign(np.ones((9, 1)), np.ones((9, 1)))) is None


# ---------------------------------------------------------------------- in a browser


@pytest.mark.browser
def test_a_page_fits_and_a_click_sorts_a_table_and_another_opens_a_replay(browser, data, report):
    page = browser.new_page(viewport={"width": 400, "height": 900})
    asked, wrong = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(report.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]
    page.set_viewport_size({"width": 1400, "height": 900})
    page.reload()
    column = page.locator("#success td:nth-child(2)")
    page.locator("#success th:nth-child(2)").click()
    shown = [float(text) for text in column.all_text_contents()]
    assert shown == sorted(shown)
    assert len(set(shown)) > 1
    href = page.locator("#the-ten-worst-runs a").first.get_attribute("href")
    worst = int(np.argmax(~data.success[:, 0]))
    (report.parent / f"run {worst} of adaptive FPID.html").write_text("<title>the run</title>")
    assert href is not None
    page.locator("#the-ten-worst-runs a").first.click()
    page.wait_for_load_state()
    assert page.title() == "the run"
    assert wrong == []
    page.close()
