"""The ledger of a campaign: one SQLite file with a row a run and controller.

The driver alone writes it, a chunk in one transaction; in SQLite's write-ahead mode others read it
meanwhile. Its description is inside, so that it can be gone on with from nothing else, and it
appears with that description or not at all.
"""

import json
import math
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import descriptions, own_code
from fpid_pin.arms import Arm
from fpid_pin.campaign.data import METRICS, CampaignData, Ended, Success
from fpid_pin.campaign.study import QUANTITIES, Study
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.files import kind_of, replacing
from fpid_pin.text import differences, unit_for

#: What SQLite files of ours say of themselves, and the layout of their tables.
APPLICATION, LAYOUT = 0x46504944, 3
#: Of a row; after them come the run's uncertain numbers, by their labels.
COLUMNS = ("run", "controller", "outcome", "cause", *METRICS)
#: A run under a controller, by its column: `COLUMNS`, then the sample.
Row = tuple[Any, ...]


class Ledger:
    """An open ledger of at least so many runs; without a study to be read only.

    A file that is not there, or empty, is made; another study's is refused with the difference.
    """

    def __init__(self, path: str | Path, study: Study | None = None, runs: int = 0) -> None:
        self.path = Path(path)
        kind = kind_of(self.path)
        if kind not in (None, "a file", "a symlink") or (kind is None and study is None):
            raise FileFormatError(f"{path}: expected a campaign's ledger, got {kind or 'no file'}")
        with _errors_named(self.path), ExitStack() as undone:
            if study is not None and (kind is None or not self.path.stat().st_size):
                _make(self.path, study)
            how = f"{self.path.absolute().as_uri()}?mode={'ro' if study is None else 'rw'}"
            self._file = undone.enter_context(closing(sqlite3.connect(how, uri=True)))
            mark, layout = (
                self._file.execute(f"PRAGMA {name}").fetchone()[0]
                for name in ("application_id", "user_version")
            )
            if (mark, layout) != (APPLICATION, LAYOUT):
                got = f"layout {layout}" if mark == APPLICATION else "another SQLite file"
                expected = f"a campaign's ledger of layout {LAYOUT}"
                raise FileFormatError(f"{path}: expected {expected}, got {got}")
            meta = dict(self._file.execute("SELECT key, value FROM meta"))
            self._study, self._own = json.loads(meta["study"]), json.loads(meta["import"])
            #: Names, in the order of the columns.
            self.controllers: tuple[str, ...] = tuple(self._study["controllers"])
            #: How many runs were asked for.
            self.planned = max(runs, int(meta["runs"]))
            if study is not None:
                asked = json.loads(study.text)
                # These decide no result: the newest are kept.
                named = {key: asked[key] for key in ("title", "success")}
                if found := differences(self._study | named, asked):
                    expected = "a ledger of this campaign"
                    raise FileFormatError(f"{path}: expected {expected}, got another: {found[0]}")
                self._study = asked
                values = [(str(self.planned), "runs"), (study.text, "study")]
                with self._file:
                    self._file.executemany("UPDATE meta SET value = ? WHERE key = ?", values)
            undone.pop_all()

    def __enter__(self) -> "Ledger":
        return self

    def __exit__(self, *fault: object) -> None:
        self._file.close()

    def study(self) -> Study:
        """Return the campaign's description; the user's own files that it needs are run first."""
        files = [Path(self.path.parent, name).resolve() for name in self._own]
        own_code.load([file for file in files if str(file) not in own_code.loaded()])
        try:
            return descriptions.from_dict(self._study, Study)
        except FpidError as error:
            raise FileFormatError(f"{self.path}: {error}") from None

    def recorded(self) -> set[int]:
        """Return the numbers of the runs that are recorded, under every controller."""
        query = "SELECT run FROM results GROUP BY run HAVING count(*) = ?"
        with _errors_named(self.path):
            return {run for (run,) in self._file.execute(query, (len(self.controllers),))}

    def data(self) -> CampaignData:
        """Return the runs up to the first that is not recorded yet."""
        several, first, last = len(self.controllers), COLUMNS.index("rms"), len(COLUMNS)
        with _errors_named(self.path):
            found = self._file.execute("SELECT * FROM results ORDER BY run, controller")
            parameters = tuple(name for name, *_ in found.description[last:])
            rows = found.fetchall()
            # Chunks are recorded whole, so that the first gap is where numbers part.
            places = np.array([run * several + column for run, column, *_ in rows], dtype=np.int64)
            whole = np.argmin(np.append(places, -1) == np.arange(len(places) + 1))
            runs = int(whole) // several
            rows, shape = rows[: runs * several], (runs, several)
            table = np.array([row[first:] for row in rows], dtype=np.float64)
            table = table.reshape(*shape, last - first + len(parameters))
        angles = descriptions.from_dict(self._study["experiment"]["arm"], Arm).units
        return CampaignData(
            title=str(self._study["title"]),
            seed=int(self._study["scenarios"]["seed"]),
            controllers=self.controllers,
            parameters=parameters,
            units=tuple(_unit_of(label, angles) for label in parameters),
            samples=table[:, 0, len(METRICS) :].copy(),
            outcome=np.array([row[2] for row in rows], dtype=np.str_).reshape(shape),
            cause=np.array([row[3] for row in rows], dtype=np.str_).reshape(shape),
            metrics={name: table[:, :, k].copy() for k, name in enumerate(METRICS)},
            dynamics=str(self._study["experiment"].get("dynamics", "")),
            criterion=descriptions.from_dict(self._study.get("success", {}), Success),
            angles=tuple(dict.fromkeys(angles)),
        )

    def end(self, run: int, controller: str) -> Ended:
        """Return how a run ended under a controller."""
        wanted = ", ".join(COLUMNS[2:])
        query = f"SELECT {wanted} FROM results WHERE run = ? AND controller = ?"
        with _errors_named(self.path):
            place = (run, self.controllers.index(controller))
            row = self._file.execute(query, place).fetchone()
            if row is None:
                raise ArgumentError("run", "one that is recorded", run)
            figures = tuple(math.nan if x is None else float(x) for x in row[2:])
            return Ended(row[0], row[1], figures)

    def record(self, rows: Sequence[Row]) -> None:
        """Write rows, all of them or nothing."""
        marks = ", ".join("?" * len(rows[0]))
        with _errors_named(self.path), self._file:
            # What is there stays: a run that came twice is recorded once.
            self._file.executemany(f"INSERT OR IGNORE INTO results VALUES ({marks})", rows)


def _unit_of(label: str, angles: Sequence[str]) -> str:
    """Return the unit of ``"payload"`` or ``"mass.0"``; `angles` are the joints' own, (n,)."""
    key, _, joint = label.partition(".")
    unit = QUANTITIES[key].unit
    its = [angles[int(joint)]] if joint else angles
    # Those of an oscillation are no joint's.
    return unit if key.endswith(("frequency", "phase")) else unit_for(unit, its)


def _make(path: Path, study: Study) -> None:
    """Write a ledger without runs, whole or not at all."""
    numbers = ", ".join(f'"{column}" REAL' for column in (*METRICS, *study.parameters))
    own = [os.path.relpath(file, path.absolute().parent) for file in own_code.loaded()]
    values = {"study": study.text, "runs": "0", "import": json.dumps(own)}
    with replacing(path) as temporary, closing(sqlite3.connect(temporary)) as file:
        # A killed driver loses nothing that was committed.
        file.execute("PRAGMA journal_mode = WAL")
        with file:
            file.execute("CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID")
            file.execute(
                "CREATE TABLE results (run INTEGER, controller INTEGER, outcome TEXT, cause TEXT, "
                f"{numbers}, PRIMARY KEY (run, controller)) WITHOUT ROWID"
            )
            file.executemany("INSERT INTO meta VALUES (?, ?)", values.items())
            file.execute(f"PRAGMA application_id = {APPLICATION}")
            file.execute(f"PRAGMA user_version = {LAYOUT}")


@contextmanager
def _errors_named(path: Path) -> Iterator[None]:
    """Turn what SQLite refuses, and what is damaged, into a line that names the ledger."""
    try:
        yield
    except FpidError:
        raise
    except sqlite3.Error as error:
        told = f"SQLite's complaint: {error}"
        raise FileFormatError(f"{path}: expected a sound ledger, got {told}") from None
    except (ValueError, TypeError, KeyError) as error:
        raise FileFormatError(f"{path}: expected a sound ledger, got {error!r}") from None
