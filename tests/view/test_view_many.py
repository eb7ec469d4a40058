"""Figures of two to twenty controllers stay whole: panels, colours, words."""

import dataclasses
import itertools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.view import plots
from fpid_pin.view.style import PALETTE


@pytest.fixture(scope="module")
def twenty():
    base = fp.paper_controller(supervised=False)
    laws = [
        dataclasses.replace(base, kp=4.0 + 3.0 * k, name=f"controller {k + 1}, of some length")
        for k in range(20)
    ]
    return fp.simulate(fp.paper_experiment(duration=0.1), laws)


def boxes(figure):
    """Lay a figure out, and return its boxes in inches: panels, legend, all words."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer, dpi = canvas.get_renderer(), figure.dpi
    panels = [a.get_window_extent(renderer).bounds for a in figure.axes if a.get_visible()]
    words = []
    for axes in figure.axes:
        labels = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            labels += [label for tick in ticks for label in (tick.label1, tick.label2)]
        words += [
            text.get_window_extent(renderer).bounds
            for text in labels
            if text.get_visible() and text.get_text()
        ]
    for legend in figure.legends:
        words += [text.get_window_extent(renderer).bounds for text in legend.get_texts()]
    return [np.array(some) / dpi for some in (panels, words)]


def overlap(one, other):
    """Return the area that two boxes share, beyond a hundredth of an inch on each side."""
    sides = [
        min(one[k] + one[k + 2], other[k] + other[k + 2]) - max(one[k], other[k]) - 0.02
        for k in (0, 1)
    ]
    return max(sides[0], 0.0) * max(sides[1], 0.0)


def whole(figure):
    """Assert that words neither overlap nor stick out; return the panels' sizes in inches."""
    panels, words = boxes(figure)
    width, height = figure.get_size_inches()
    for one, other in itertools.combinations(words, 2):
        assert overlap(one, other) == 0.0
    assert (words[:, :2] >= -0.01).all()
    assert (words[:, 0] + words[:, 2] <= width + 0.01).all()
    assert (words[:, 1] + words[:, 3] <= height + 0.01).all()
    return panels[:, 2:]


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
    from matplotlib.colors import to_rgb

    def lab(colour):
        c = np.array(to_rgb(colour))
        c = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                        [0.0193, 0.1192, 0.9505]]) @ c / (0.9505, 1.0, 1.089)  # fmt: skip
        f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
        return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])

    places = [lab(colour) for colour in PALETTE]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(places, 2)]
    assert len(PALETTE) == 20
    assert min(apart) > 20.0
