import dataclasses
import itertools
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.transforms import Bbox
from PIL import Image, ImageCms, ImageColor

import fpid_pin as fp
from fpid_pin import Arm
from fpid_pin.costs import METRICS
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Comparison
from fpid_pin.text import percent
from fpid_pin.view import figures, plots, save_figure
from fpid_pin.view.plots import is_integer
from fpid_pin.view.style import _MOST, PALETTE, figure_bytes, thinned


@pytest.fixture(scope="module")
def pair(make_run, two_link):
    return [make_run(two_link, name="integer", integer=True), make_run(two_link, name="fractional")]


@pytest.fixture(scope="module")
def standard(pair):
    return figures(pair)


def labels(figure):
    return [axes.get_ylabel() for axes in figure.axes]


def test_every_axis_has_a_name_and_a_unit(pair, standard):
    drawn = {
        "tracking": plots.tracking(pair[1]),
        "error": plots.error(pair),
        "torque": plots.torque(pair[1]),
        "phase": plots.phase_plane(pair[1]),
        **standard,
    }
    for name, figure in drawn.items():
        panels = figure.axes
        assert all(a.get_ylabel() for a in panels), name
        assert any(a.get_xlabel() in ("time, s", "error $e$, rad") for a in panels), name
        for a in panels:
            unit = a.get_ylabel().rpartition(", ")[2]
            assert a.get_ylabel() == "$V$" or unit.startswith(("rad", "N m", "s$")), a.get_ylabel()


@pytest.fixture(scope="module")
def moving():
    law = dataclasses.replace(fp.paper_controller(), order_learning_rate=1.0)
    return fp.simulate(fp.paper_experiment(duration=1.0), law)


def test_orders_stand_below_the_gains_where_they_move(pair, moving):
    assert labels(plots.gains(moving))[:3] == labels(plots.gains(pair[1]))
    assert labels(plots.gains(moving))[3:] == [r"$\lambda$", r"$\mu$"]
    assert labels(plots.plot(moving))[3:] == ["gains", "orders"]
    for panel, name in zip(plots.gains(moving).axes[3:], ("integral_order", "derivative_order"),
                           strict=True):  # fmt: skip
        for j, line in enumerate(panel.lines):
            assert np.isin(line.get_ydata(), moving.signals[name][:, j]).all()
            assert np.ptp(line.get_ydata()) > 0.05
        low, high = panel.get_ylim()
        assert low < 0.0 < 1.0 < high


def test_curves_are_the_recorded_signals(pair):
    run = pair[1]
    figure = plots.tracking(run)
    for j, panel in enumerate(figure.axes):
        actual, desired = (line.get_ydata() for line in panel.lines)
        assert np.isin(actual, run.q[:, j]).all()
        assert np.isin(desired, run.q_ref[:, j]).all()
        assert actual.max() == run.q[:, j].max()


def test_figures_4_and_5_are_the_integer_and_the_fractional_run(pair, standard):
    drawn = standard
    assert list(drawn) == ["orders", "fig4", "fig5", "gains", "lyapunov", "comparison"]
    for name, word in (("fig4", "integer"), ("fig5", "fractional")):
        titles = [a.get_title(loc="left") for a in drawn[name].axes]
        assert titles == ["(a) tracking", "(b) control signals", "(c) tracking errors"]
        assert word in drawn[name].get_suptitle()
    assert "fig4" not in figures(pair[1])
    assert is_integer(pair[0])


def test_figures_4_and_5_side_by_side_say_what_differs(pair, standard):
    panels = standard["orders"].axes
    for row, (metric, size) in enumerate((("peak_torque", 1.0), ("rms_tail", 1e3)), start=1):
        old, new = (size * METRICS[metric].of(getattr(run.metrics, metric)) for run in pair)
        left, right = panels[2 * row : 2 * row + 2]
        assert f" {old:.3g} " in left.get_title(loc="left")
        more = f"{percent(abs(new / old - 1.0))} {'more' if new > old else 'less'}"
        assert right.get_title(loc="left").startswith(f"{new:.3g} ")
        assert right.get_title(loc="left").endswith(more)
        assert left.get_ylim() == right.get_ylim()
        grey = [line.get_ydata() for line in right.lines[-pair[0].q.shape[1] :]]
        quantity = ("torque", "error")[row - 1]
        for j, curve in enumerate(grey):
            assert np.isin(curve, getattr(pair[0], quantity)[:, j]).all()


def test_legends_do_not_cover_data(pair, standard):
    """Where a panel has a legend it ends below the legend's lower edge."""
    for figure in [standard["fig5"], standard["gains"], plots.plot(pair[1])]:
        figure_bytes(figure, "png", dpi=50)
        for panel in figure.axes:
            legend = panel.get_legend()
            if legend is not None:
                box = legend.get_window_extent()
                assert box.y0 >= panel.get_window_extent().y1 - 1.0


def test_a_run_that_follows_another_closely_is_dashed_so_that_both_are_seen(make_run, two_link):
    runs = [make_run(two_link, lag=lag) for lag in (0.3, 0.3, 0.9)]
    looks = [line.get_linestyle() for line in plots.comparison(runs).axes[0].lines]
    assert looks == ["-", "--", "-"]
    # One that ended before it began hides nothing.
    runs[0] = make_run(two_link, rows=0)
    assert {line.get_linestyle() for line in plots.comparison(runs).axes[0].lines} == {"-"}


def test_a_torque_limit_that_is_near_is_drawn(make_run):
    near = Arm.planar((1.0, 1.0), (1.0, 1.0)).with_limits(effort=6.0)
    far = near.with_limits(effort=900.0)
    heights = [line.get_ydata()[0] for line in plots.torque(make_run(near)).axes[0].lines[1:]]
    assert heights == [6.0, -6.0]
    panel = plots.torque(make_run(far)).axes[0]
    assert len(panel.lines) == 1
    assert "900" in panel.get_title(loc="right")


@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_the_same_figure_gives_the_same_file(pair, tmp_path, monkeypatch, kind):
    now = save_figure(plots.tracking(pair[1]), tmp_path / f"now.{kind}")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")  # what matplotlib takes for the date of a file
    then = save_figure(plots.tracking(pair[1]), tmp_path / f"then.{kind}")
    assert now.read_bytes() == then.read_bytes()


def test_a_figure_shows_itself_in_a_notebook_and_leaves_pyplot_alone(pair):
    assert plots.plot(pair[1])._repr_png_().startswith(b"\x89PNG")
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or not pyplot.get_fignums()


def test_figures_do_not_depend_on_the_users_style(pair):
    ours = figure_bytes(plots.error(pair), "svg")
    with matplotlib.rc_context({"font.size": 30, "axes.facecolor": "black"}):
        assert figure_bytes(plots.error(pair), "svg") == ours
        assert matplotlib.rcParams["font.size"] == 30


def test_thinning_keeps_ends_and_extremes():
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 50_000)
    y = rng.standard_normal(t.size)
    y[12_345] = 99.0
    x, z = thinned(t, y)
    assert len(x) <= _MOST + 2
    assert (x[0], x[-1], z.max(), z.min()) == (t[0], t[-1], 99.0, y.min())
    assert (np.diff(x) > 0.0).all()


def test_a_cost_map_marks_what_diverged_and_what_is_marked():
    costs = np.outer([1.0, 2.0, 3.0], [1.0, 10.0])
    costs[0, 0] = np.inf
    orders = np.array([0.8, 0.9, 1.0]), np.array([0.5, 1.0])
    figure = plots.cost_map(*orders, costs, {"paper": (0.9, 0.9)})
    panel = figure.axes[0]
    assert panel.collections[0].get_array().mask.sum() == 1
    assert panel.get_title(loc="right") == "hatched: diverged"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["paper"]
    # A search's end is not lost where costs are 0, as a settling time may be, or all runs diverge.
    for costs, hatched in ((np.zeros((3, 2)), 0), (np.full((3, 2), np.inf), 6)):
        figure = plots.cost_map(*orders, costs, {"paper": (0.9, 0.9)})
        assert figure_bytes(figure, "svg").startswith(b"<?xml")
        assert np.ma.getmaskarray(figure.axes[0].collections[0].get_array()).sum() == hatched


def test_bad_input_is_named(pair, make_run, two_link, tmp_path):
    bare = make_run(two_link)
    object.__setattr__(bare, "signals", {})
    with pytest.raises(ArgumentError, match="kp, ki, kd"):
        plots.gains(bare)
    with pytest.raises(ArgumentError, match="a run with a supervisor"):
        plots.lyapunov(bare)
    with pytest.raises(ArgumentError, match="one number of joints, got 2, 3"):
        plots.comparison([pair[0], make_run(Arm.planar((1.0,) * 3, (1.0,) * 3))])
    with pytest.raises(ArgumentError, match=r"\.svg, \.pdf or \.png"):
        save_figure(plots.error(pair), tmp_path / "figure.bmp")
    assert not list(tmp_path.iterdir())


def test_figures_and_tables_say_metres_and_newtons(scara_run):
    assert labels(plots.tracking(scara_run)) == ["angle, rad", "position, m", "position, m"]
    assert labels(plots.error(scara_run)) == ["$q_d - q$, rad", "$q_d - q$, m", "$q_d - q$, m"]
    assert labels(plots.torque(scara_run)) == ["torque, N m", "force, N", "force, N"]
    assert labels(plots.phase_plane(scara_run))[:2] == ["$\\dot e$, rad/s", "$\\dot e$, m/s"]
    assert labels(plots.comparison([scara_run]))[2:4] == ["$q_d - q$, m", "force, N"]
    together = labels(plots.plot(scara_run))[:3]
    assert together == ["position, rad, m", "$q_d - q$, rad, m", "torque, N m, N"]
    rows = Comparison(("nominal",), ("law",), (scara_run,)).joint_rows()
    assert [row["joint"] for row in rows] == ["j1", "j2 [m, N]", "j3 [m, N]"]


@pytest.fixture(scope="module")
def twenty():
    base = fp.paper_controller(supervised=False)
    laws = [
        dataclasses.replace(base, kp=4.0 + 3.0 * k, name=f"controller {k + 1}, of some length")
        for k in range(20)
    ]
    return fp.simulate(fp.paper_experiment(duration=0.1), laws)


def whole(figure):
    """Assert that words neither overlap nor stick out; return the panels' sizes in inches."""
    figure_bytes(figure, "png", dpi=figure.dpi)
    words = []
    for axes in figure.axes:
        words += [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            words += [label for tick in ticks for label in (tick.label1, tick.label2)]
    words += [text for legend in figure.legends for text in legend.get_texts()]
    boxes = [x.get_window_extent() for x in words if x.get_visible() and x.get_text()]
    room = figure.bbox.padded(1.0)
    assert all(room.contains(*corner) for box in boxes for corner in (box.min, box.max))
    for one, other in itertools.combinations([box.padded(-1.0) for box in boxes], 2):
        shared = Bbox.intersection(one, other)
        assert shared is None or 0.0 in shared.size
    sizes = [axes.get_window_extent().size for axes in figure.axes if axes.get_visible()]
    return np.array(sizes) / figure.dpi


@pytest.mark.parametrize("count", [2, 8, 20])
def test_a_comparison_stays_whole(twenty, count):
    figure = plots.comparison(twenty[:count])
    panels = whole(figure)
    assert (panels > (0.35 * figure.get_size_inches()[0], 0.9)).all(), "panels squeezed to slivers"
    assert len({line.get_color() for line in figure.axes[0].get_lines()}) == count


@pytest.mark.parametrize(("rows", "columns"), [(2, 1), (20, 3), (3, 20)])
def test_a_heat_map_stays_whole(rows, columns):
    rng = np.random.default_rng(0)
    values = 10.0 ** rng.uniform(-3, 4, (columns, rows))
    values[0, 0] = np.inf
    controllers = [f"a controller of name {k}" for k in range(rows)]
    conditions = [f"condition {k} with words" for k in range(columns)]
    figure = plots.heat_map(values, controllers, conditions, "RMS error, mrad")
    map_size, _ = whole(figure)
    assert (map_size > (0.35 * figure.get_size_inches()[0], 0.2 * rows)).all()


def test_colours_are_far_enough_apart_to_be_told():
    """In CIE Lab; 10 is what two patches side by side differ by to any eye."""
    patches = Image.new("RGB", (len(PALETTE), 1))
    patches.putdata([ImageColor.getrgb(colour) for colour in PALETTE])
    kinds = [ImageCms.createProfile(kind) for kind in ("sRGB", "LAB")]
    (row,) = np.array(ImageCms.profileToProfile(patches, *kinds, outputMode="LAB"))
    places = np.column_stack([row[:, 0] * (100.0 / 255.0), row[:, 1:].astype(np.int8)])
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(places, 2)]
    assert len(PALETTE) == 20
    assert min(apart) > 20.0
