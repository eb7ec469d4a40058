"""The command line as a person uses it: results whole, errors on one line, status 2."""

import csv
from pathlib import Path

import pytest

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main
from fpid_pin.costs import QuadraticCost
from fpid_pin.kernels import compiled

MARK = "[[controller]]"
HEAD, *LAWS = demo_config().text.replace("duration = 20.0", "duration = 0.2").split(MARK)
#: The published orders and the integer PID: figures take longer than runs.
SHORT = MARK.join([HEAD, LAWS[0], LAWS[-1]])
#: Its name is one that would make the same file's as another's.
MOVING = """[[controller]]
name = "integer-pid"
kind = "adaptive_fpid"
kp = 10.0
ki = 20.0
kd = 15.0
derivative_order = 0.9
order_learning_rate = [[0.5, 0.5], [1.0, 1.0]]
"""


@pytest.fixture
def config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def rows_of(path):
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


CONDITIONS = """
[[condition]]
name = "nominal"
[[condition]]
name = "payload"
plant = { payload = { mass = 1.0 } }
"""


def test_compare_begins_with_the_answer_and_writes_runs_tables_figures_and_report(config, capsys):
    config.write_text(SHORT + MOVING + CONDITIONS)
    assert main(["compare", str(config), "--metric", "peak"]) == 0
    out = config.parent / "runs" / "short"
    names = {path.name for path in out.iterdir()}
    assert {"report.html", "summary.md", "joints.csv", "ranking.svg"} <= names
    assert (out / "config.toml").read_text() == config.read_text()
    printed = capsys.readouterr().out
    assert "integer PID" in printed
    assert "report.html" in printed
    first, second, *_ = printed.splitlines()
    assert first.startswith("Least peak torque (worst joint) under payload: ")
    report = (out / "report.html").read_text("utf-8")
    assert first in report
    head = next(line for line in printed.splitlines() if line.startswith("controller"))
    assert head.split()[:2] == ["controller", "[mrad]"]
    assert list(rows_of(out / "summary.csv")[0])[2:4] == [
        "tail (rms of joints) [mrad]", "variation (sum of joints) [N m]",
    ]  # fmt: skip
    rows = rows_of(out / "summary.csv")
    for condition in ("nominal", "payload"):
        here = {row["controller"]: row for row in rows if row["condition"] == condition}
        best = min(here, key=lambda name: float(here[name]["peak (worst joint) [N m]"]))
        (told,) = (part for part in second.split(";") if condition in part)
        assert best in told
        assert [name for name, row in here.items() if row["best"]] == [best]
        files = [f"{condition}-integer-pid.npz", f"{condition}-integer-pid-2.npz"]
        assert [here[name]["file"] for name in ("integer PID", "integer-pid")] == files
        run = fp.Run.load(out / files[0])
        assert float(here["integer PID"]["cost (33)"]) == QuadraticCost().of(run.metrics)
    # Orders that move are drawn.
    assert {name for name in names if name.startswith("gains")} == {"gains-integer-pid.svg"}
    assert "Adapted gains, and orders where they move: integer-pid" in report
    run = fp.Run.load(out / "payload-integer-pid-2.npz")
    assert run.controller.order_learning_rate.tolist() == [[0.5, 0.5], [1.0, 1.0]]
    assert run.derivative_order.shape == run.q.shape


def test_run_takes_one_controller_by_name_and_says_whether_all_joints_are_meant(config, capsys):
    folder = config.parent / "my runs"
    folder.mkdir()
    path = config.rename(folder / "my config.toml")
    assert main(["run", str(path), "--controller", "integer PID", "--out", "my out"]) == 0
    out = folder.parent / "my out"
    assert {"report.html", "gains.svg"} <= {path.name for path in out.iterdir()}
    m = fp.Run.load(out / "integer-pid.npz").metrics
    (row,) = rows_of(out / "summary.csv")
    expected = {
        "energy (sum of joints) [N²m²s]": m.energy.sum(),
        "variation (sum of joints) [N m]": m.total_variation.sum(),
        "RMS (rms of joints) [mrad]": 1e3 * (m.rms**2).mean() ** 0.5,
        "peak (worst joint) [N m]": m.peak_torque.max(),
        "peak error (worst joint) [mrad]": 1e3 * m.peak_error.max(),
        "settled (worst joint) [s]": m.settling_time.max(),
        "at its limit (worst joint) [%]": 100.0 * m.saturated.max(),
        "torque rate (worst joint) [N m/s]": m.torque_rate.max(),
    }
    assert {name: float(row[name]) for name in expected} == expected


def test_the_demo_is_the_paper_s_comparison(tmp_path, monkeypatch, capsys):
    from fpid_pin.cli import configuration

    monkeypatch.chdir(tmp_path)
    short = configuration.parse(SHORT, "demo.toml", tmp_path)
    monkeypatch.setattr(configuration, "demo_config", lambda: short)
    assert main(["demo"]) == 0
    names = {path.name for path in (tmp_path / "runs" / "demo").iterdir()}
    assert {"fig4.svg", "fig5.svg", "gains.svg", "report.html"} <= names
    assert not any(name.endswith(".png") for name in names)


def test_a_diverged_run_is_a_result(config, capsys):
    config.write_text(SHORT.replace("kd = [20.0, 15.0]", "kd = [9000.0, 9000.0]", 1))
    assert main(["compare", str(config), "--no-figures"]) == 0
    printed = capsys.readouterr().out
    assert "Limits passed by FPID, published orders: diverged at" in " ".join(printed.split())
    table = (config.parent / "runs" / "short" / "summary.csv").read_text()
    assert "diverged at" in table
    assert "inf" in table


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("operators --order 0.5", 0, "0.5"),
        ("arms", 0, "ur5"),
        ("--version", 0, f"fpid-pin {fp.__version__}\n"),
        ("-h", 0, "Usage: fpid-pin [OPTIONS] COMMAND"),
        ("tune -h", 0, "Usage: fpid-pin tune [OPTIONS] {CONFIG.toml}"),
        # Where nothing is asked for.
        ("", 2, "Usage: fpid-pin [OPTIONS] COMMAND [ARGS]...\n"),
        ("campaign", 2, "\n  run "),
    ],
)
def test_what_prints(words, status, said, capsys):
    assert main(words.split()) == status
    assert said in capsys.readouterr()[bool(status)]


def test_compiling_is_said_where_nothing_is_compiled_yet(config, capsys, monkeypatch):
    monkeypatch.setattr(compiled, "CACHE", config.parent / "cache")
    arguments = ["run", str(config), "--controller", "integer PID", "--no-figures"]
    for told in (True, False):
        assert main(arguments) == 0
        assert ("compiling the equations" in capsys.readouterr().err) == told
        (config.parent / "cache").mkdir(exist_ok=True)
        (config.parent / "cache" / "a.nbi").touch()


def test_results_are_replaced_whole_and_are_as_few_as_is_wanted(config):
    out, one = config.parent / "out", ["run", str(config), "--controller", "integer PID"]

    def names():
        return {path.name for path in out.iterdir()}

    assert main([*one, "--out", "out", "--png"]) == 0
    assert {"error.svg", "error.png"} <= names()
    whole, table = fp.Run.load(out / "integer-pid.npz"), (out / "joints.csv").read_bytes()
    assert main([*one, "--out", "out", "--no-figures", "--every", "5"]) == 0
    assert not any(name.endswith((".svg", ".png")) for name in names())
    thin = fp.Run.load(out / "integer-pid.npz")
    assert (thin.q == whole.q[::5]).all()
    assert (out / "joints.csv").read_bytes() == table  # of all rows
    assert main([*one, "--out", "out", "--no-figures", "--no-runs"]) == 0
    assert "report.html" in names()
    assert not any(name.endswith(".npz") for name in names())
    assert "file" not in rows_of(out / "summary.csv")[0]


def test_a_condition_is_chosen_by_name_and_what_is_left_out_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    condition = '\n[[condition]]\nname = "{}"\nplant = {{ payload = {{ mass = {} }} }}\n'
    loaded = condition.format("2 kg", 2.0) + condition.format("bare", 0.001)
    text = demo_config().text.replace("duration = 20.0", "duration = 0.1")
    Path("c.toml").write_text(text + loaded)
    chosen = ["run", "c.toml", "--controller", "integer PID", "--no-figures", "--out"]
    assert main([*chosen, "plain"]) == 0
    assert "Conditions left out: '2 kg', 'bare' (--condition NAME)." in capsys.readouterr().out
    assert main([*chosen, "loaded", "--condition", "2 kg"]) == 0
    assert "left out" not in capsys.readouterr().out
    plain, loaded = (fp.Run.load(f"{out}/integer-pid.npz") for out in ("plain", "loaded"))
    assert (plain.experiment.plant.payload, loaded.experiment.plant.payload.mass) == (None, 2.0)
    assert main(["playground", "c.toml", "--condition", "3 kg"]) == 2
    assert "--condition: expected one of 2 kg, bare, got '3 kg'" in capsys.readouterr().err
