"""The command line as a person uses it: results whole, errors on one line, status 2."""

import csv

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
MOVING = """[[controller]]
name = "moving"
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
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_compare_writes_runs_tables_figures_and_report(config, capsys):
    config.write_text(f"{SHORT}\n{MOVING}")
    assert main(["compare", str(config)]) == 0
    out = config.parent / "runs" / "short"
    names = {path.name for path in out.iterdir()}
    assert {"report.html", "summary.md", "summary.csv", "joints.csv", "config.toml"} <= names
    assert {"fpid-published-orders.npz", "integer-pid.npz", "moving.npz"} <= names
    printed = capsys.readouterr().out
    assert "integer PID" in printed
    assert "report.html" in printed
    run = fp.Run.load(out / "integer-pid.npz")
    rows = {row["controller"]: row for row in rows_of(out / "summary.csv")}
    assert float(rows["integer PID"]["cost (33)"]) == QuadraticCost().of(run.metrics)
    assert (out / "config.toml").read_text() == config.read_text()
    # Orders that move are drawn.
    assert {name for name in names if name.startswith("gains")} == {"gains-moving.svg"}
    report = (out / "report.html").read_text("utf-8")
    assert "Adapted gains, and orders where they move: moving" in report
    run = fp.Run.load(out / "moving.npz")
    assert run.controller.order_learning_rate.tolist() == [[0.5, 0.5], [1.0, 1.0]]
    assert run.derivative_order.shape == run.q.shape


def test_run_takes_one_controller_by_name_and_says_whether_all_joints_are_meant(config, capsys):
    folder = config.parent / "my runs"
    folder.mkdir()
    path = config.rename(folder / "my config.toml")
    assert main(["run", str(path), "--controller", "integer PID", "--out", "my out"]) == 0
    out = folder.parent / "my out"
    assert {"report.html", "gains.svg"} <= {path.name for path in out.iterdir()}
    assert main(["run", str(path), "--out", "two"]) == 2
    assert "expected one controller" in capsys.readouterr().err
    assert main(["run", str(path), "--controller", "integr PID"]) == 2
    assert "did you mean integer PID?" in capsys.readouterr().err
    assert not (folder.parent / "two").exists()
    m = fp.Run.load(out / "integer-pid.npz").metrics
    (row,) = rows_of(out / "summary.csv")
    expected = {
        "energy (all joints) [N²m²s]": m.energy.sum(),
        "variation (all joints) [N m]": m.total_variation.sum(),
        "RMS (all joints) [mrad]": 1e3 * (m.rms**2).mean() ** 0.5,
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


def test_results_are_replaced_whole_and_other_folders_are_left_alone(config, capsys):
    command = ["run", str(config), "--controller", "integer PID", "--out", "kept"]
    assert main([*command, "--png"]) == 0
    stale, notes = (config.parent / "kept" / name for name in ("error.png", "notes.txt"))
    assert stale.with_suffix(".svg").exists()
    assert stale.exists()
    notes.write_text("mine")
    assert main([*command, "--no-figures"]) == 0
    assert not stale.exists()
    assert notes.read_text() == "mine"
    own = config.parent / "own"
    own.mkdir()
    (own / "thesis.txt").write_text("mine")
    assert main(["run", str(config), "--controller", "integer PID", "--out", "own"]) == 2
    assert "expected a new folder or one that fpid-pin made" in capsys.readouterr().err
    assert [path.name for path in own.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "Missing argument"),
        (["run", "none.toml"], "none.toml: no such file"),
        (["compare", "bad.toml"], "controller.0.integral_order.1: expected a number in [0, 1]"),
        (["view", "none.npz"], "none.npz"),
        (["operators", "--order", "1.7"], "1.7"),
        (["operators", "--step", "5e-324"], "step: expected a number in [1e-09, 10]"),
    ],
)
def test_wrong_input_is_plain_lines_and_status_2(arguments, message, config, capsys):
    (config.parent / "bad.toml").write_text(SHORT.replace("[0.901, 0.931]", "[0.9, 1.7]"))
    before = sorted(config.parent.iterdir())
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    assert "Traceback" not in err
    assert all(line.startswith("fpid-pin: ") for line in err.strip().splitlines())
    assert sorted(config.parent.iterdir()) == before


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(config, capsys, monkeypatch):
    from fpid_pin.cli import comparison

    monkeypatch.setattr(comparison, "simulate", None)  # Any work would fail otherwise.
    (config.parent / "file").write_text("not a folder")
    for out in ("file", "file/x"):
        assert main(["compare", str(config), "--out", out]) == 2
        err = capsys.readouterr().err
        assert "cannot be written" in err or "got a file" in err


def test_a_diverged_run_is_a_result(config, capsys):
    config.write_text(SHORT.replace("kd = [20.0, 15.0]", "kd = [9000.0, 9000.0]", 1))
    assert main(["compare", str(config)]) == 0
    printed = capsys.readouterr().out
    assert "Limits passed by FPID, published orders: diverged at" in " ".join(printed.split())
    table = (config.parent / "runs" / "short" / "summary.csv").read_text()
    assert "diverged at" in table
    assert "inf" in table


def test_lists_and_reports_print(capsys):
    assert main(["operators", "--order", "0.5"]) == 0
    assert "0.5" in capsys.readouterr().out
    assert main(["arms"]) == 0
    assert "ur5" in capsys.readouterr().out


def test_a_page_is_made_of_a_run(config, tmp_path):
    run = fp.simulate(fp.paper_experiment(duration=0.1), fp.paper_controller())
    path = run.save(tmp_path / "r.npz")
    assert main(["view", str(path), "--html", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html")


def test_compiling_is_said_where_nothing_is_compiled_yet(config, capsys, monkeypatch):
    monkeypatch.setattr(compiled, "CACHE", config.parent / "cache")
    arguments = ["run", str(config), "--controller", "integer PID", "--no-figures"]
    for told in (True, False):
        assert main(arguments) == 0
        assert ("compiling the equations" in capsys.readouterr().err) == told
        (config.parent / "cache").mkdir(exist_ok=True)
        (config.parent / "cache" / "a.nbi").touch()


def test_what_a_command_leaves_behind_is_as_little_as_is_wanted(config, capsys):
    assert main(["run", str(config), "--controller", "integer PID", "--out", "all"]) == 0
    whole = fp.Run.load(config.parent / "all" / "integer-pid.npz")
    some = ["--controller", "integer PID", "--every", "5", "--no-figures", "--out", "some"]
    assert main(["run", str(config), *some]) == 0
    names = {path.name for path in (config.parent / "some").iterdir()}
    assert not any(name.endswith((".svg", ".png")) for name in names)
    thin = fp.Run.load(config.parent / "some" / "integer-pid.npz")
    assert (thin.q == whole.q[::5]).all()
    for name in ("summary.csv", "joints.csv"):  # of all rows
        assert (config.parent / "some" / name).read_bytes() == (
            config.parent / "all" / name).read_bytes()  # fmt: skip
    assert main(["compare", str(config), "--no-runs", "--out", "none"]) == 0
    assert not list((config.parent / "none").glob("*.npz"))
    assert "file" not in rows_of(config.parent / "none" / "summary.csv")[0]
    assert (config.parent / "none" / "report.html").exists()
    capsys.readouterr()
    assert main(["compare", str(config), "--every", "0", "--out", "bad"]) == 2
    assert "--every: expected a whole number >= 1, got 0" in capsys.readouterr().err
    assert not (config.parent / "bad").exists()
