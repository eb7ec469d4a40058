import pytest

from fpid_pin.cli.operators import operators_table
from fpid_pin.exceptions import ArgumentError, DesignError, FileFormatError


def test_the_table_has_a_row_for_each_order_and_a_figure_where_asked(tmp_path):
    figure = tmp_path / "operators.png"
    text = operators_table([0.3, 0.9], 1e-3, 2.0, modes=16, plot=figure)
    assert [line.split()[0] for line in text.splitlines()[-2:]] == ["0.3", "0.9"]
    assert figure.stat().st_size > 10_000


def test_a_filter_can_be_asked_for():
    assert "Crone(low=0.1, high=100.0, n=3, widening=1.0)" in operators_table(
        [0.5], 1e-3, 2.0, design="crone", band=(0.1, 100.0), n=3, widening=1.0
    )


def test_bad_arguments_are_named(tmp_path):
    with pytest.raises(ArgumentError, match=r"order\.1: expected a number in \[0, 1\], got 1.7"):
        operators_table([0.5, 1.7], 1e-3, 2.0)
    with pytest.raises(ArgumentError, match="orders: expected at least one"):
        operators_table([], 1e-3, 2.0)
    with pytest.raises(ArgumentError, match="horizon: expected more than one step"):
        operators_table([0.5], 1e-3, 1e-3)
    with pytest.raises(ArgumentError, match="did you mean crone"):
        operators_table([0.5], 1e-3, 2.0, design="cron")
    with pytest.raises(DesignError, match="is met, with"):
        operators_table([0.5], 1e-3, 0.01, tolerance=1e-18)
    with pytest.raises(ArgumentError, match="plot: expected a file that can be written"):
        operators_table([0.5], 1e-3, 2.0, plot=tmp_path / "x.no-picture")
    (tmp_path / "file").touch()
    with pytest.raises(FileFormatError, match="file"):
        operators_table([0.5], 1e-3, 2.0, plot=tmp_path / "file" / "x.png")
