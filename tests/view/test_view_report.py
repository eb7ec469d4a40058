import re

import pytest

from fpid_pin.view import plots, report_html
from fpid_pin.view.report import MOST_IN_REPLAY, inline_svg

CELL = re.compile(r"<t[dh][^>]*>(?:<span>.*?</i>)?([^<]*)<")


def cells_of(path):
    return CELL.findall(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def report(tmp_path_factory, make_run, two_link):
    runs = [make_run(two_link, name="integer", integer=True), make_run(two_link, name="<b>frac")]
    return report_html(
        runs, tmp_path_factory.mktemp("report") / "report.html", title="Two & <two>",
        tables={"Costs": [{"law": "integer", "cost": 1.23456},
                          {"law": "</td><script>", "cost": float("nan")}],
                "Rows": [{"law": "a", "ok": True}, {"law": "b", "note": 3}]},
        figures={"error": plots.error(runs)}, config_text='[arm]\nkind = "<two_link>"',
    )  # fmt: skip


def test_a_report_holds_everything_and_fetches_nothing(report):
    text = report.read_text(encoding="utf-8")
    ids = re.findall(r'<section id="([^"]*)"', text)
    assert ids == ["replay", "figures", "costs", "rows", "configuration", "versions"]
    assert re.findall(r"""\s(?:src|action|href)=["'](?!#|data:,)""", text) == []
    assert text.count("<iframe") == text.count("<svg") == 1
    assert "SCENE" in text.partition("srcdoc=")[2]
    assert "&lt;two_link&gt;" in text
    assert "default-src 'none'" in text
    assert {"pin", "numpy", "scipy", "python", "fpid_pin"} <= set(cells_of(report))


def test_numbers_of_tables_are_short_and_a_cell_that_a_row_has_not_is_empty(report):
    cells = cells_of(report)
    assert {"1.235", "nan", "&lt;/td&gt;&lt;script&gt;"} <= set(cells)
    start = cells.index("a")
    assert cells[start - 3 : start + 3] == ["law", "ok", "note", "a", "yes", ""]


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


def test_many_runs_show_some_of_them_in_the_replay(wave, tmp_path):
    path = report_html([wave] * 8, tmp_path / "r.html", title="t", figures={})
    assert f"Replay of the first {MOST_IN_REPLAY} runs" in path.read_text()
    assert "wave (8)" in cells_of(path)


def test_without_tables_there_are_figures_of_merit_and_who_diverged(make_run, two_link, tmp_path):
    run = make_run(two_link, rows=100)
    path = report_html(run, tmp_path / "r.html", title="t", figures={})
    assert {"RMS [rad]", f"{run.metrics.rms[1]:.4g}"} <= set(cells_of(path))
    text = path.read_text()
    assert '<p class="bad">wave: diverged at 0.1 s' in text
    groups = {"loaded": [1], "nominal": [0]}
    report_html([run] * 2, path, title="t", captions=["PD", "PD"], groups=groups, figures={})
    assert re.findall('class="bad">(.*?): ', path.read_text()) == ["nominal, PD", "loaded, PD"]
