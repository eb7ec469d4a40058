"""A campaign's table for other programs: CSV and Parquet, a row a run and controller."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fpid_pin.campaign.data import CampaignData
from fpid_pin.exceptions import ArgumentError
from fpid_pin.extras import needed
from fpid_pin.files import replacing


def export(data: CampaignData, path: str | Path) -> Path:
    """Write the table of a campaign, by its suffix: ``.csv``, or ``.parquet`` (extra ``parquet``).

    Rows are in the order of runs, then of controllers, numbers with every digit: two campaigns of
    the same results give the same bytes of CSV.

    Raises
    ------
    ArgumentError
        Another suffix.
    FileFormatError
        It cannot be written.
    """
    path = Path(path)
    writers = {".csv": _write_csv, ".parquet": _write_parquet}
    if path.suffix not in writers:
        raise ArgumentError("file", "a name that ends with .csv or .parquet", path.name)
    with replacing(path) as temporary:
        writers[path.suffix](data, temporary)
    return path


def _header(data: CampaignData) -> list[str]:
    fixed = ["run", "controller", "outcome", "cause", "dynamics"]
    return [*fixed, *data.metrics, *data.parameters]


def _rows(data: CampaignData) -> Iterator[list[Any]]:
    figures = [values.tolist() for values in data.metrics.values()]
    outcome, cause = data.outcome.tolist(), data.cause.tolist()
    for run, sample in enumerate(data.samples.tolist()):
        for column, name in enumerate(data.controllers):
            numbers = (values[run][column] for values in figures)
            ended = outcome[run][column], cause[run][column]
            yield [run, name, *ended, data.dynamics, *numbers, *sample]


def _write_csv(data: CampaignData, path: Path) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        # Floats by their repr: the shortest text that is that number.
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_header(data))
        writer.writerows(_rows(data))


def _write_parquet(data: CampaignData, path: Path) -> None:
    arrow, parquet = needed("pyarrow", "parquet"), needed("pyarrow.parquet", "parquet")
    columns = zip(*_rows(data), strict=True)
    table = arrow.table(dict(zip(_header(data), map(list, columns), strict=True)))
    parquet.write_table(table, path, compression="zstd")
