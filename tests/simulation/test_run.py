"""A run: one file that says everything and executes nothing; for other programs, and from them."""

import csv
import dataclasses
import html
import json
import sys
from xml.etree import ElementTree

import numpy as np
import pyarrow.parquet
import pytest
from robots import joint, link, robot, write
from scipy.io import loadmat, savemat

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.simulation import Comparison, limit_report

ARM = fp.Arm.two_link()
NAMES = ("t", "q", "v", "q_ref", "v_ref", "torque")


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.paper_experiment(duration=0.2), fp.paper_controller())


# ---------------------------------------------------------------------- its file


def test_it_comes_back_bit_for_bit(run, tmp_path):
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    for name in ("t", "q", "v", "q_ref", "v_ref", "torque", "error", *run.signals):
        assert (getattr(back, name) == getattr(run, name)).all(), name
    assert back.outcome == run.outcome
    assert (back.metrics.ise == run.metrics.ise).all()
    assert back.arm == run.arm
    again = fp.simulate(back.experiment, back.controller)
    assert (again.q == run.q).all()
    assert (again.kd == run.kd).all()
    with pytest.raises(AttributeError, match="has no 'kq'"):
        _ = back.kq


def test_nothing_in_it_is_pickled(run, tmp_path):
    with np.load(run.save(tmp_path / "run.npz"), allow_pickle=False) as file:
        assert all(file[name].dtype.kind in "fU" for name in file.files)
        meta = json.loads(str(file["meta"]))
    assert {"fpid_pin", "pin", "numpy", "scipy", "python"} <= meta["versions"].keys()


def test_what_could_not_be_read_back_is_not_written(run, tmp_path):
    odd = dataclasses.replace(run, signals={"x": np.zeros((len(run.t), 2, 2))})
    with pytest.raises(ArgumentError, match="signals.x: expected a signal with 201 rows"):
        odd.save(tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_record_whose_descriptions_mean_nothing_is_one_line(run, tmp_path):
    meta = dict(run.meta) | {"arm": dict(run.meta["arm"]) | {"changes": [[0, 1], "x"]}}
    back = fp.Run.load(dataclasses.replace(run, meta=meta).save(tmp_path / "run.npz"))
    with pytest.raises(FpidError) as caught:
        _ = back.arm
    assert "\n" not in str(caught.value)


def test_a_compressed_file_is_smaller_and_gives_every_bit(run, tmp_path):
    plain = run.save(tmp_path / "plain.npz")
    small = run.save(tmp_path / "small.npz", compressed=True)
    assert small.stat().st_size < 0.5 * plain.stat().st_size
    other = fp.Run.load(small)
    assert other.save(tmp_path / "again.npz").read_bytes() == plain.read_bytes()
    assert run.save(tmp_path / "twice.npz", compressed=True).read_bytes() == small.read_bytes()


def test_a_thinned_run_has_one_row_in_so_many_and_says_so(run, tmp_path):
    thin = fp.Run.load(run.save(tmp_path / "run.npz", every=5, compressed=True))
    assert (thin.q == run.q[::5]).all()
    assert (thin.kp == run.kp[::5]).all()
    assert thin.step == pytest.approx(5e-3)
    assert thin.meta["every"] == 5
    assert len(thin.t) == thin.planned_rows == 41
    assert thin.thinned(2).meta["every"] == 10
    assert len(run.thinned(7).t) == run.thinned(7).planned_rows == 29
    # The same integral by a coarser sum.
    assert thin.metrics.ise == pytest.approx(run.metrics.ise, rel=0.2)
    with pytest.raises(ArgumentError, match="every: expected a whole number >= 1"):
        run.save(tmp_path / "no.npz", every=0)
    with pytest.raises(ArgumentError, match="every: expected rows at most 10 s"):
        run.thinned(20_000)


def parts(run):
    """Return every column of a run, picked by hand."""
    one, two = ARM.joint_names
    found = {"t": run.t, "lyapunov": run.lyapunov}
    for name in (*NAMES[1:], *(s for s in run.signals if s != "lyapunov")):
        array = getattr(run, name)
        found |= {f"{name}.{one}": array[:, 0], f"{name}.{two}": array[:, 1]}
    return found


# ---------------------------------------------------------------------- out


def written(run, way, folder):
    """Return the columns of a run, by name, and what else was written with them."""
    if way == "csv":
        with open(run.to_csv(folder / "run.csv"), newline="") as file:
            head, *rows = csv.reader(file)
        return dict(zip(head, np.array(rows, float).T, strict=True)), None
    if way == "parquet":
        table = pyarrow.parquet.read_table(run.to_parquet(folder / "run.parquet"))
        about = json.loads(table.schema.metadata[b"fpid_pin"])
        return {name: table[name].to_numpy() for name in table.column_names}, about
    frame = run.to_dataframe()
    return {name: frame[name].to_numpy() for name in frame.columns}, frame.attrs


@pytest.mark.parametrize("way", ["csv", "dataframe", "parquet"])
def test_tables_have_every_digit_and_say_what_they_are(run, tmp_path, way):
    table, about = written(run, way, tmp_path)
    assert table.keys() == parts(run).keys()
    for name, column in parts(run).items():
        assert (table[name] == column).all(), name
    if about is not None:
        assert (about["name"], about["step"]) == (run.name, run.step)
        assert about["units"]["torque.joint1"] == "N m"
        assert about["meta"]["seed"] == 0


def test_a_dict_is_what_matlab_s_file_takes(run, tmp_path):
    savemat(tmp_path / "run.mat", run.to_dict(), oned_as="column")
    file = loadmat(tmp_path / "run.mat", squeeze_me=True, struct_as_record=False)
    for name in (*NAMES, *run.signals):
        assert (file[name] == getattr(run, name)).all(), name
    assert tuple(file["joint_names"]) == ARM.joint_names
    assert json.loads(file["meta"])["controller"]["kind"] == "adaptive_fpid"
    assert file["step"] == run.step
    assert file["outcome"] == "completed at 0.2 s"


@pytest.mark.parametrize(
    ("call", "module", "extra"),
    [(lambda *_: fp.Arm.from_description("ur5e_description"), "robot_descriptions", "descriptions"),
     (lambda run, _: run.to_dataframe(), "pandas", "pandas"),
     (lambda run, path: run.to_parquet(path), "pyarrow", "parquet"),
     (lambda run, path: run.save(path, compressed=True), "pcodec", "compressed")],
)  # fmt: skip
def test_a_package_that_is_missing_is_named_with_its_extra(
    run, tmp_path, monkeypatch, call, module, extra
):
    monkeypatch.setitem(sys.modules, module, None)
    line = (
        rf"^{module}: expected it to be installed \(pip install 'fpid_pin\[{extra}\]'\), got none$"
    )
    with pytest.raises(FpidError, match=line):
        call(run, tmp_path / "x")
    assert list(tmp_path.iterdir()) == []


@dataclasses.dataclass(frozen=True, eq=False)
class Plain(fp.Controller):
    """A spring."""

    @staticmethod
    def torque(c):
        c.s = 77.0
        return 10.0 * c.e


class Named(Plain):
    """The same, with signals that are called as what every run has."""

    shown = {"torque": "s", "q": "e"}


def test_a_law_s_signal_called_as_an_array_stands_beside_it(tmp_path):
    plain, named = fp.simulate(fp.paper_experiment(duration=0.1), [Plain(), Named()])
    for found in (named, fp.Run.load(named.save(tmp_path / "named.npz"))):
        assert np.array_equal(found.torque, plain.torque)
        assert np.array_equal(found.q, plain.q)
        assert np.array_equal(found.metrics.energy, plain.metrics.energy)
        assert (found.signals["torque"] == 77.0).all()
        assert np.array_equal(found.signals["q"], plain.error)


def test_a_signal_called_as_an_array_is_refused(run):
    other = fp.Run.from_arrays(run.t, run.q, run.q_ref, run.torque, arm=ARM, signals={"q": run.t})
    with pytest.raises(ArgumentError, match="signals: expected other names than t, q"):
        other.columns()


# ---------------------------------------------------------------------- in


def again(run, **more):
    given = {"v": run.v, "v_ref": run.v_ref, "signals": run.signals} | more
    return fp.Run.from_arrays(run.t, run.q, run.q_ref, run.torque, arm=ARM, **given)


def test_a_run_of_arrays_is_as_good_as_ours(run, tmp_path):
    other = again(run, name="robot")
    for name in fp.costs.METRICS:
        assert (getattr(other.metrics, name) == getattr(run.metrics, name)).all(), name
    assert limit_report(other) == limit_report(run)
    assert other.arm == ARM
    assert other.name == "robot"
    back = fp.Run.load(other.save(tmp_path / "robot.npz", compressed=True))
    assert (back.q == run.q).all()
    fp.view.export_html([other, run], tmp_path / "replay.html")
    fp.view.report_html([other], tmp_path / "report.html", title="robot")
    fp.view.save_figure(fp.view.plot(other), tmp_path / "plot.svg")
    assert (
        other.to_csv(tmp_path / "a.csv").read_text() == run.to_csv(tmp_path / "b.csv").read_text()
    )
    with pytest.raises(FpidError, match="experiment.kind"):
        _ = other.experiment


def test_what_it_was_given_may_change_later(run):
    q = run.q.copy()
    other = again(run)
    other.q[0] = 7.0
    assert (run.q == q).all()


def test_rates_are_differences_where_none_are_given():
    t = 0.01 * np.arange(200)
    q = np.stack([t**2, 1.0 - 3.0 * t], axis=1)
    run = fp.Run.from_arrays(5.0 + t, q, q, 0 * q, arm=ARM)
    assert run.v[1:-1] == pytest.approx(np.stack([2 * t, -3.0 + 0 * t], axis=1)[1:-1])
    assert run.t == pytest.approx(t)
    assert run.step == pytest.approx(0.01)
    assert str(run.outcome) == "completed at 1.99 s"


def test_rows_of_an_uneven_clock_are_taken_at_even_times():
    random = np.random.default_rng(0)
    t = np.sort(random.uniform(0.0, 2.0, 300))
    line = np.stack([t, 2.0 - t], axis=1)
    with pytest.raises(ArgumentError, match=r"t: expected a step of .* \(or resample="):
        fp.Run.from_arrays(t, line, line, line, arm=ARM)
    run = fp.Run.from_arrays(
        t, line, line, line, arm=ARM, v=0 * line + 1.0, resample=0.01, signals={"height": 3.0 * t}
    )
    assert np.diff(run.t) == pytest.approx(0.01)
    assert run.q[:, 0] == pytest.approx(t[0] + run.t)
    assert run.height == pytest.approx(3.0 * (t[0] + run.t))
    assert run.height.shape == run.t.shape
    assert run.v_ref == pytest.approx(np.broadcast_to([1.0, -1.0], run.v.shape))


ROWS = np.zeros((5, 2))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"arm": "ur5"}, "arm: expected an Arm, got str"),
        ({"controller": "pid"}, "controller: expected a Controller, got str"),
        ({"t": [0.0]}, r"t: expected at least two times, got shape \(1,\)"),
        ({"t": [0, 1, 3, 2, 4]}, r"t.3: expected a time after the one before \(3 s\), got 2 s"),
        ({"t": [0, 1, 2, 3.2, 4]}, r"t: expected a step of 1 s .* got row 3 off by 0.2 s"),
        (
            {"q": np.zeros((5, 3))},
            r"q: expected shape \(5, 2\) \(rows, joints\), got shape \(5, 3\)",
        ),
        ({"torque": np.zeros((4, 2))}, r"torque: expected shape \(5, 2\)"),
        ({"q": [["a", "b"]] * 5}, "q: expected numbers"),
        ({"v": np.full((5, 2), np.nan)}, "v.0.0: expected a number finite, got nan"),
        ({"signals": {"x": np.zeros(4)}}, r"signals.x: expected shape \(5, 2\)"),
        ({"t": np.arange(5) * 20.0}, r"t's step: expected a number in \[1e-09, 10\]"),
        ({"resample": -1.0}, "resample: expected a number > 0"),
    ],
)
def test_arrays_that_do_not_fit_are_told_in_one_line(given, message):
    with pytest.raises(ArgumentError, match=message):
        fp.Run.from_arrays(**({"t": np.arange(5.0), "q": ROWS, "q_ref": ROWS, "torque": ROWS,
                               "arm": ARM} | given))  # fmt: skip


# ---------------------------------------------------------------------- shown


def tags(text):
    """Return the tags of a text, all of them closed and without attributes."""
    elements = [*ElementTree.fromstring(text).iter()]
    assert not any(element.attrib for element in elements)
    return {element.tag for element in elements}


def test_a_run_is_one_line_and_in_a_notebook_a_table(run):
    assert repr(run).startswith("<Run 'FPID, published orders': 2 joints, 201 rows, step 0.001 s, ")
    assert len(repr(run)) < 120
    text = run._repr_html_()
    assert tags(text)
    assert all(name in text for name in ARM.joint_names)
    assert f"{1e3 * run.metrics.rms[0]:.4g}" in text


def test_names_from_outside_stay_text(run):
    nasty = "<script>alert('&')</script>\x1b[2J"
    other = again(run, name=nasty)
    for text in (other._repr_html_(), fp.view.show(other)._repr_html_().split("srcdoc=")[0]):
        assert "<script" not in text
        assert "\x1b" not in text
    assert tags(other._repr_html_()) == {"table", "caption", "tr", "th", "td"}
    assert "\x1b" not in repr(other)


@pytest.mark.parametrize(
    "make",
    [
        lambda run: ARM,
        lambda run: fp.stability_report(ARM, fp.paper_controller(), step=1e-3),
        lambda run: fp.fractional.report(
            fp.fractional.ExponentialSum(), [0.5], step=1e-3, horizon=1.0
        ),
        lambda run: fp.tune(
            fp.paper_experiment(duration=0.01), fp.paper_controller(),
            fp.tuning.Space(kp=(1.0, 2.0)),
            settings=fp.tuning.SearchSettings(population=4, generations=1, seeds=(0,)),
        ),
    ],
)  # fmt: skip
def test_arms_reports_and_results_are_short_and_shown_without_scripts(run, make):
    thing = make(run)
    assert len(repr(thing)) < 200
    assert "\n" not in repr(thing)
    assert "script" not in tags(thing._repr_html_())


def test_a_replay_in_a_notebook_is_the_page_in_a_frame(run):
    shown = fp.view.show(run)
    text = shown._repr_html_()
    assert text.startswith("<iframe")
    assert 'sandbox="allow-scripts"' in text
    assert html.unescape(text.split('srcdoc="')[1].split('"></iframe>')[0]) == shown.text
    assert "Replay" in repr(shown)


CRANE = robot(
    *map(link, "abc"), joint("turn", "a", "b"), joint("slide", "b", "c", "prismatic")
)  # fmt: skip


def test_units_are_those_of_joints_that_turn_and_of_those_that_slide(tmp_path):
    arm = fp.Arm.from_urdf(write(tmp_path, CRANE))
    run = fp.Run.from_arrays(np.arange(3.0), *(np.zeros((3, 2)),) * 3, arm=arm)
    found = run.to_dataframe().attrs["units"]
    assert (found["q.turn"], found["v_ref.turn"], found["torque.turn"]) == ("rad", "rad/s", "N m")
    assert (found["q.slide"], found["v_ref.slide"], found["torque.slide"]) == ("m", "m/s", "N")
    assert "<td>mm, N</td>" in run._repr_html_()
    (row, _) = Comparison(("",), ("crane",), (run,)).joint_rows()
    assert {"RMS [rad or m]", "settled [s]"} <= row.keys()
    assert "<td>rad, N m</td>" in arm._repr_html_()
    assert "<td>m, N</td>" in arm._repr_html_()
