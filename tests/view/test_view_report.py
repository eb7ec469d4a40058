import re
from html.parser import HTMLParser

import pytest

from fpid_pin.exceptions import FileFormatError
from fpid_pin.view import plots, report_html
from fpid_pin.view.report import MOST_IN_REPLAY, inline_svg


class Outline(HTMLParser):
    """Sections, cells, figures, embedded pages, and what would be fetched."""

    def __init__(self):
        super().__init__()
        self.tags, self.cells, self.ids, self.found, self.pages = [], [], [], [], []
        self.inside = None

    def handle_starttag(self, tag, attributes):
        table = dict(attributes)
        self.tags.append(tag)
        self.ids.append(table.get("id"))
        self.found += [table[k] for k in ("src", "action") if k in table]
        self.pages += [table["srcdoc"]] if "srcdoc" in table else []
        self.inside = tag

    def handle_data(self, data):
        if self.inside in ("td", "th", "i"):
            self.cells.append(data)


def outline(path):
    page = Outline()
    page.feed(path.read_text(encoding="utf-8"))
    return page


@pytest.fixture(scope="module")
def report(tmp_path_factory, make_run, two_link):
    runs = [make_run(two_link, name="integer", integer=True), make_run(two_link, name="<b>frac")]
    return report_html(
        runs, tmp_path_factory.mktemp("report") / "report.html", title="Two & <two>",
        tables={"Costs": [["law", "cost"], ["integer", 1.23456], ["</td><script>", float("nan")]],
                "Rows": [{"law": "a", "ok": True}, {"law": "b", "note": 3}]},
        figures={"error": plots.error(runs)}, config_text='[arm]\nkind = "<two_link>"',
    )  # fmt: skip


def test_a_report_holds_everything_and_fetches_nothing(report):
    page = outline(report)
    assert {"replay", "costs", "rows", "figures", "configuration", "versions"} <= set(page.ids)
    assert page.found == []
    assert len(page.pages) == 1
    assert "SCENE" in page.pages[0]
    assert page.tags.count("svg") == 1
    text = report.read_text()
    assert "&lt;two_link&gt;" in text
    assert "default-src 'none'" in text
    for key in ("pin", "numpy", "scipy", "python", "fpid_pin"):
        assert key in page.cells


def test_tables_are_rows_or_mappings_and_numbers_are_short(report):
    cells = outline(report).cells
    assert "1.235" in cells
    assert "nan" in cells
    start = cells.index("a")
    assert cells[start - 3 : start] == ["law", "ok", "note"]
    assert cells[start : start + 2] == ["a", "yes"]


def test_figures_take_the_ink_of_the_page(make_run, two_link):
    figure = plots.error(make_run(two_link))
    svg = inline_svg(figure, "error of a run")
    assert "currentColor" in svg
    assert "#262626" not in svg
    assert "fill: #ffffff" not in svg
    ids = set(re.findall(r'\bid="([^"]*)"', svg))
    used = set(re.findall(r'href="#([^"]*)"|url\(#([^)]*)\)', svg))
    assert {a or b for a, b in used} <= ids
    assert all(name.startswith("error-of-a-run-") for name in ids)


def test_without_tables_the_figures_of_merit_are_shown(wave, tmp_path):
    path = report_html(wave, tmp_path / "r.html", title="t", figures={}, embed_replay=False)
    page = outline(path)
    assert "rms, rad" in page.cells
    assert f"{wave.metrics.rms[1]:.4g}" in page.cells
    assert page.pages == []


def test_many_runs_show_some_of_them_in_the_replay(wave, tmp_path):
    path = report_html([wave] * 8, tmp_path / "r.html", title="t", figures={})
    assert f"Replay of the first {MOST_IN_REPLAY} runs" in path.read_text()
    assert "wave (8)" in outline(path).cells


def test_a_run_that_diverged_is_pointed_out(make_run, two_link, tmp_path):
    run = make_run(two_link, rows=100)
    path = report_html(run, tmp_path / "r.html", title="t", figures={}, embed_replay=False)
    assert '<p class="bad">wave: diverged at 0.1 s' in path.read_text()


def test_a_report_that_cannot_be_written_leaves_nothing(wave, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileFormatError, match="cannot be written"):
        report_html(wave, tmp_path / "file" / "r.html", title="t", figures={}, embed_replay=False)
    assert [f.name for f in tmp_path.iterdir()] == ["file"]
