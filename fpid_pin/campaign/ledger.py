"""The ledger of a campaign: one SQLite file with a row a run and controller.

The driver alone writes it, a chunk in one transaction; in SQLite's write-ahead mode others read it
meanwhile. Its description is inside, so that it can be gone on with from nothing else.
"""

from __future__ import annotations

import json
import math
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.campaign.chunk import Done, Ended
from fpid_pin.campaign.data import METRICS, CampaignData
from fpid_pin.campaign.sqlite import PATIENCE, quoted, told
from fpid_pin.campaign.study import Study, difference
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.files import kind_of, unwritable

#: What SQLite files of ours say of themselves, and the layout of their tables.
APPLICATION, LAYOUT = 0x46504944, 1
_FIGURES = ", ".join(METRICS)


class Ledger:
    """An open ledger.

    Parameters
    ----------
    path
        The file.
    study
        Whose campaign it is to be; a file that is not there is made. None: read only.

    Raises
    ------
    FileFormatError
        A file that is no SQLite or no ledger, of another layout, of another campaign (the line says
        in what it differs), locked by another program, or that cannot be written.
    """

    def __init__(self, path: str | Path, study: Study | None = None) -> None:
        self.path = Path(path)
        kind = kind_of(self.path)
        if kind not in (None, "a file", "a symlink") or (kind is None and study is None):
            raise FileFormatError(f"{path}: expected a campaign's ledger, got {kind or 'no file'}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(self.path, error) from None
        with told(self.path):
            self._file = self._open(writable=study is not None)
            try:
                # A stranger's views and triggers call no functions.
                self._file.execute("PRAGMA trusted_schema = OFF")
                if self._tables() or study is None:
                    # Before anything of a stranger's file is touched.
                    self._require_ours()
                if study is not None:
                    # A killed driver loses nothing that was committed.
                    self._file.execute("PRAGMA journal_mode = WAL")
                    self._file.execute("PRAGMA synchronous = NORMAL")
                    if not self._tables():
                        self._make(study)
                self.study_table: dict[str, Any] = json.loads(self._meta("study"))
                if study is not None:
                    self._require_same(study)
                self.parameters = tuple(json.loads(self._meta("parameters")))
                self.units = tuple(json.loads(self._meta("units")))
            except BaseException:
                self._file.close()
                raise

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *fault: object) -> None:
        self._file.close()

    # ------------------------------------------------------------------ reading

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names, in the order of the columns."""
        return tuple(self.study_table["controllers"])

    @property
    def planned(self) -> int:
        """How many runs were asked for."""
        return int(self._meta("runs"))

    def study(self) -> Study:
        """Return the campaign's description.

        Raises
        ------
        FileFormatError
            It holds kinds of the user's own, which have to be imported first.
        """
        return Study.from_dict(self.study_table, str(self.path))

    def recorded(self) -> set[int]:
        """Return the numbers of the runs that are recorded, under every controller."""
        query = "SELECT run FROM results GROUP BY run HAVING count(*) = ?"
        with told(self.path):
            return {run for (run,) in self._file.execute(query, (len(self.controllers),))}

    def data(self, runs: int | None = None) -> CampaignData:
        """Return the first runs, up to the first that is not recorded yet, or `runs` of them."""
        columns = len(self.controllers)
        limit = -1 if runs is None else runs * columns
        names = ", ".join(map(quoted, self.parameters))
        query = (
            f"SELECT run, controller, outcome, cause, {_FIGURES}, {names} FROM results "
            "ORDER BY run, controller LIMIT ?"
        )
        size = len(METRICS)
        with told(self.path):
            rows = self._file.execute(query, (limit,)).fetchall()
            # Chunks are recorded whole, so that the first gap is where numbers part.
            places = np.array([run * columns + column for run, column, *_ in rows], dtype=np.int64)
            gaps = np.flatnonzero(places != np.arange(len(places)))
            count = (int(gaps[0]) if len(gaps) else len(places)) // columns
            rows = rows[: count * columns]
            shape = (count, columns)
            table = np.array([row[4:] for row in rows], dtype=np.float64)
            table = table.reshape(*shape, size + len(self.parameters))
        return CampaignData(
            title=str(self.study_table["title"]),
            seed=int(self.study_table["scenarios"]["seed"]),
            controllers=self.controllers,
            parameters=self.parameters,
            units=self.units,
            samples=table[:, 0, size:].copy(),
            outcome=np.array([row[2] for row in rows], dtype=np.str_).reshape(shape),
            cause=np.array([row[3] for row in rows], dtype=np.str_).reshape(shape),
            metrics={name: table[:, :, k].copy() for k, name in enumerate(METRICS)},
            dynamics=str(self.study_table["experiment"].get("dynamics", "")),
        )

    def end(self, run: int, controller: str) -> Ended:
        """Return how a run ended under a controller.

        Raises
        ------
        ArgumentError
            It is not recorded.
        """
        query = f"SELECT outcome, cause, {_FIGURES} FROM results WHERE run = ? AND controller = ?"
        with told(self.path):
            place = (run, self.controllers.index(controller))
            row = self._file.execute(query, place).fetchone()
        if row is None:
            raise ArgumentError("run", "one that is recorded", run)
        figures = tuple(math.nan if x is None else float(x) for x in row[2:])
        return Ended(row[0], row[1], figures)

    # ------------------------------------------------------------------ writing

    def plan(self, runs: int) -> None:
        """Note how many runs are asked for."""
        with told(self.path), self._file:
            self._file.execute("UPDATE meta SET value = ? WHERE key = 'runs'", (str(runs),))

    def record(self, done: Done) -> None:
        """Write a chunk, all of it or nothing."""
        rows = [
            (done.first + row, column, end.outcome, end.cause, *end.figures, *sample)
            for row, (sample, ends) in enumerate(zip(done.samples.tolist(), done.ends, strict=True))
            for column, end in enumerate(ends)
        ]
        marks = ", ".join("?" * (4 + len(METRICS) + len(self.parameters)))
        with told(self.path), self._file:
            # What is there stays: a chunk that came twice is recorded once.
            self._file.executemany(f"INSERT OR IGNORE INTO results VALUES ({marks})", rows)

    def keep(self, runs: int) -> None:
        """Drop runs from number `runs` on: the campaign has ended there."""
        with told(self.path), self._file:
            self._file.execute("DELETE FROM results WHERE run >= ?", (runs,))
            self._file.execute("UPDATE meta SET value = ? WHERE key = 'runs'", (str(runs),))

    # ------------------------------------------------------------------ inside

    def _open(self, writable: bool) -> sqlite3.Connection:
        if not writable:
            # Of a URI's path only these mean something else.
            path = (
                str(self.path.absolute())
                .replace("%", "%25")
                .replace("?", "%3f")
                .replace("#", "%23")
            )
            return sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=PATIENCE)
        return sqlite3.connect(self.path, timeout=PATIENCE)

    def _tables(self) -> int:
        return int(self._file.execute("SELECT count(*) FROM sqlite_master").fetchone()[0])

    def _make(self, study: Study) -> None:
        bound = study.bound
        figures = ", ".join(f"{name} REAL" for name in METRICS)
        samples = ", ".join(f"{quoted(label)} REAL" for label in bound.parameters)
        with self._file:
            self._file.execute("BEGIN IMMEDIATE")
            self._file.execute("CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID")
            self._file.execute(
                "CREATE TABLE results (run INTEGER, controller INTEGER, outcome TEXT, cause TEXT, "
                f"{figures}, {samples}, PRIMARY KEY (run, controller)) WITHOUT ROWID"
            )
            values = {
                "study": study.text, "digest": study.digest, "runs": "0",
                "parameters": json.dumps(bound.parameters), "units": json.dumps(bound.units),
            }  # fmt: skip
            self._file.executemany("INSERT INTO meta VALUES (?, ?)", values.items())
            self._file.execute(f"PRAGMA application_id = {APPLICATION}")
            self._file.execute(f"PRAGMA user_version = {LAYOUT}")

    def _require_ours(self) -> None:
        mark, layout = (
            self._file.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("application_id", "user_version")
        )
        if mark != APPLICATION:
            raise FileFormatError(
                f"{self.path}: expected a campaign's ledger, got another SQLite file"
            )
        if layout != LAYOUT:
            raise FileFormatError(
                f"{self.path}: expected a ledger of layout {LAYOUT}, got layout {layout}"
            )

    def _require_same(self, study: Study) -> None:
        if self._meta("digest") != study.digest:
            found = difference(json.loads(study.text), self.study_table)
            raise FileFormatError(
                f"{self.path}: expected a ledger of this campaign, got another: {found}"
            )

    def _meta(self, key: str) -> str:
        with told(self.path):
            row = self._file.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        if row is None:
            raise FileFormatError(f"{self.path}: expected a ledger with its {key}, got none")
        return str(row[0])
