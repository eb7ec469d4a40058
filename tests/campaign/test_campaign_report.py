"""Figures and reports of campaigns, as files say and as a browser shows them."""

import dataclasses
import re
from html import unescape
from types import SimpleNamespace
from urllib.parse import quote

import numpy as np
import pytest
from studies import arms, campaign

from fpid_pin.campaign import figures
from fpid_pin.campaign.data import Success
from fpid_pin.campaign.report import report_html
from fpid_pin.exceptions import ArgumentError
from fpid_pin.view.style import colour, figure_bytes

NAMES = ("adaptive FPID", "<b>PD</b> & $gravity_", "computed torque")


def read(path):
    """Return a page's text, its paragraphs and cells as they are read, and where links lead."""
    text = path.read_text(encoding="utf-8")

    def inside(tags):
        found = re.findall(rf"<({tags})\b[^>]*>(.*?)</\1>", text, re.DOTALL)
        return [unescape(re.sub("<[^>]*>", "", content)) for _, content in found]

    links = [unescape(link) for link in re.findall('<a href="([^"]*)"', text)]
    return SimpleNamespace(text=text, lines=inside("p"), cells=inside("td|th"), links=links)


@pytest.fixture(scope="module")
def data():
    return arms(300, NAMES)


def replay_of(run, name):
    return f"{quote(f'run {run} of {name}', safe='')}.html"


@pytest.fixture(scope="module")
def report(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return report_html(data, folder / "report.html", replay_link=replay_of)


def test_the_answer_comes_first_and_is_the_tables(data, report):
    page = read(report)
    rate = 100.0 * data.success[:, 0].mean()
    assert page.lines[0].startswith("Best, by its median RMS error of the last half: adaptive FPID")
    assert page.lines[1].startswith(f"Success: adaptive FPID {rate:.4g} % (95 %:")
    assert page.lines[2].startswith("Against <b>PD</b> & $gravity_: the smaller error on ")
    assert f"{rate:.4g}" in page.cells
    heads = re.findall("<h2>(.*?)</h2>", page.text)
    assert heads == [
        "Success", "Errors and effort", "Paired differences", "Figures", "Sensitivity",
        "The ten worst runs",
    ]  # fmt: skip
    assert page.text.count("<svg") == 4
    assert page.text.count("<details") == 3 + 3 + 3


def test_markup_stays_text_and_every_one_of_the_worst_runs_has_its_replay(data, report, tmp_path):
    evil = '"><script>alert(1)</script>'
    page = read(report_html(data, tmp_path / "r.html", replay_link=lambda run, name: evil))
    assert (page.links[-1], page.text.count("<script")) == (evil, 1)
    page = read(report)
    assert "<b>" not in page.text
    assert page.text.count("<script") == 1  # that which sorts tables
    assert "<b>PD</b> & $gravity_" in page.cells
    links = [link for link in page.links if not link.startswith("#")]
    assert len(links) == 3 * 10
    worst = int(np.argmax(~data.ended[:, 0]))
    assert links[0] == f"run%20{worst}%20of%20adaptive%20FPID.html"


@pytest.mark.parametrize(
    ("case", "answer"),
    [
        (campaign(np.full((40, 2), np.nan), np.random.default_rng(0).random((40, 2))),
         "Nobody is best: all runs were lost, on 40 plants."),
        (campaign([[0.1]] + [[np.nan]] * 3),
         "Nobody is best: A, of most successes, was lost on half the plants."),
        (campaign([[0.1]], [[1.0]]),
         "Best, by its median RMS error of the last half: A, 100 mrad."),
        (campaign([[0.0, 0.0]] * 30, [[1.0]] * 30),
         "Best, by its median RMS error of the last half: A, 0 mrad (95 %: 0 to 0); a tie with B"),
    ],
    ids=["all fail", "most fail", "one run of one controller", "ties, no error and a constant"],
)  # fmt: skip
def test_a_campaign_that_says_little_says_so(tmp_path, case, answer):
    page = read(report_html(case, tmp_path / "r.html"))
    assert page.lines[0].startswith(answer)
    assert ("Paired differences" in page.text) == (len(case.controllers) > 1)
    assert ("no plant on which either is better" in page.text) == (case.runs == 30)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_answer_is_told_from_the_leaders_side_in_mrad(order):
    data = campaign([[1.0, 2.0], [2.0, 1.0]] * 20)
    assert "a tie with B (1000 mrad)" in data.answer[0]  # its interval covers 0
    line = data.answer[2]
    assert "on 50 % of 40 plants, which does not tell them apart; where both" in line
    errors = np.array([[1e-3, 3e-3]] * 30 + [[2e-3, 1.5e-3]] * 10)[:, order]
    names = tuple(np.array(["good", "bad"])[list(order)])
    data = campaign(errors, names=names)
    best, success, line, plants = data.answer
    assert best == (
        "Best, by its median RMS error of the last half: good, 1 mrad (95 %: 1 to 1); a third of "
        "bad (3 mrad). Its torque varies a third of that of bad."
    )
    assert success == "Success: good 100 % (95 %: 91.24 to 100), bad 100 %."
    assert line == (
        "Against bad: the smaller error on 75 % of 40 plants; where both did, -2 mrad in the "
        "median (95 %: -2 to -2)."
    )
    assert plants == "40 plants, every controller on the same; seed 0."
    assert str(data).splitlines() == data.answer
    assert repr(data) == f"<CampaignData: {best}>"


def test_a_campaign_prints_at_most_15_lines():
    rng = np.random.default_rng(0)
    lines = str(campaign(rng.random((30, 8)), names=[f"law {k}" for k in range(8)])).splitlines()
    assert len(lines) == 10
    many = campaign(rng.random((30, 30)), names=[f"law {k}" for k in range(30)])
    assert len(str(many).splitlines()) == 15
    assert str(many).endswith("... and 18 lines more.")
    assert "<td>law 7</td>" in many._repr_html_()


def test_success_is_what_the_user_wants():
    outcome = [["completed"], ["completed"], ["saturated"], ["diverged"]]
    data = campaign([[0.01], [0.03], [0.01], [np.nan]], outcome=np.array(outcome))
    peak = data.metrics["peak_torque"][:, 0]

    def rate(**criterion):
        return dataclasses.replace(data, criterion=Success(**criterion)).success[:, 0].tolist()

    assert rate() == [True, False, False, False]
    assert rate(error=0.05) == [True, True, False, False]
    assert rate(at_limits=True) == [True, False, True, False]
    assert rate(error=np.inf, peak_torque=peak[0]) == [True, False, False, False]
    told = dataclasses.replace(data, criterion=Success(peak_torque=9.0)).answer[1]
    assert told.startswith(
        "Success (RMS error of the last half at most 20 mrad, torque at most 9 N m, no torque at "
        "its limit): A 25 % (95 %: "
    )
    with pytest.raises(ArgumentError, match="error: expected a number > 0"):
        Success(error=-1.0)


def test_a_campaign_without_runs_is_refused(tmp_path):
    with pytest.raises(ArgumentError, match="data: expected at least one run, got none"):
        report_html(campaign(np.empty((0, 1))), tmp_path / "r.html")


def test_a_controller_has_one_colour_in_every_figure(data):
    for draw in (figures.distributions, figures.violins, figures.tornado_plot):
        text = figure_bytes(draw(data), "svg").decode()
        assert all(colour(k).lower() in text for k in range(3))


def test_the_scatter_takes_the_parameters_that_matter(data):
    assert figures.two_that_matter(data)[0] == 0  # the payload
    assert figures.two_that_matter(campaign(np.ones((9, 1)), np.ones((9, 1)))) is None


@pytest.mark.browser
def test_a_page_fits_a_phone_and_a_click_sorts_a_table(visit, report):
    with visit(report.as_uri(), "true", (400, 900)) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        page.set_viewport_size({"width": 1400, "height": 900})
        page.reload()
        column = page.locator("#success td:nth-child(2)")
        page.locator("#success th:nth-child(2)").click()
        shown = [float(text) for text in column.all_text_contents()]
        assert shown == sorted(shown)
        assert len(set(shown)) > 1
