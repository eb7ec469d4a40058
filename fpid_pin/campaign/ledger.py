"""The ledger of a campaign: one file of arrays (`npz`) with what came of each run and controller.

The driver alone writes it, whole each time; others read it meanwhile. Its description is inside, so
that it can be gone on with from nothing else.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fpid_pin import descriptions, npz, own_code
from fpid_pin.arms import Arm
from fpid_pin.campaign.data import METRICS, OUTCOMES, CampaignData, Ended, Success
from fpid_pin.campaign.study import QUANTITIES, Study
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.files import kind_of
from fpid_pin.text import differences, unit_for

KIND = "campaign's ledger"
#: It is not written again until so many times as long has passed as it took.
PAUSE = 20.0


class Row(NamedTuple):
    """A run under a controller, by its column."""

    run: int
    column: int
    end: Ended
    sample: FloatArray


class Ledger:
    """A ledger of at least so many runs; without a study to be read only.

    A file that is not there is made; another study's is refused with the difference. What was
    recorded is in the file at the end of the context, and most of it before.
    """

    def __init__(self, path: str | Path, study: Study | None = None, runs: int = 0) -> None:
        self.path, self._writes = Path(path), study is not None
        arrays: npz.Arrays = {}
        if study is not None and kind_of(self.path) is None:
            own = [os.path.relpath(x, self.path.absolute().parent) for x in own_code.loaded()]
            table = {"study": json.loads(study.text), "runs": 0, "import": own, "causes": [""],
                     "parameters": study.parameters}  # fmt: skip
        else:
            arrays, table = npz.read(self.path, KIND)
        if study is not None:
            asked = json.loads(study.text)
            # These decide no result: the newest are kept.
            named = {key: asked[key] for key in ("title", "success")}
            if found := differences(table["study"] | named, asked):
                got = f"another: {found[0]}"
                raise FileFormatError(f"{path}: expected a ledger of this campaign, got {got}")
            table["study"] = asked
        #: How many runs were asked for.
        self.planned = table["runs"] = max(runs, table["runs"])
        #: Names, in the order of the columns.
        self.controllers: tuple[str, ...] = tuple(table["study"]["controllers"])
        self._table, self._causes = table, {cause: k for k, cause in enumerate(table["causes"])}
        # By run and controller: numbers of outcome and cause, then figures; NaN: not recorded.
        self._ends = np.full((self.planned, len(self.controllers), 2 + len(METRICS)), np.nan)
        self._samples = np.zeros((self.planned, len(table["parameters"])))
        if arrays:
            self._ends[: len(arrays["ends"])] = arrays["ends"]
            self._samples[: len(arrays["samples"])] = arrays["samples"]
        self._write()

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *fault: object) -> None:
        self._write()

    def _write(self) -> None:
        if self._writes:
            began, table = time.monotonic(), self._table | {"causes": [*self._causes]}
            npz.write(self.path, KIND, table, {"ends": self._ends, "samples": self._samples})
            self._due = time.monotonic() + PAUSE * (time.monotonic() - began)

    def study(self) -> Study:
        """Return the campaign's description; the user's own files that it needs are run first."""
        files = [Path(self.path.parent, name).resolve() for name in self._table["import"]]
        own_code.load([file for file in files if str(file) not in own_code.loaded()])
        try:
            return descriptions.from_dict(self._table["study"], Study)
        except FpidError as error:
            raise FileFormatError(f"{self.path}: {error}") from None

    def missing(self) -> list[int]:
        """Return the numbers of the runs that are not recorded under every controller."""
        return [int(k) for k in np.flatnonzero(np.isnan(self._ends[..., 0]).any(axis=1))]

    def data(self) -> CampaignData:
        """Return the runs up to the first that is not recorded yet."""
        runs, study = [*self.missing(), self.planned][0], self._table["study"]
        outcome, cause, *figures = np.moveaxis(self._ends[:runs], -1, 0)
        angles = descriptions.from_dict(study["experiment"]["arm"], Arm).units
        return CampaignData(
            title=study["title"],
            seed=study["scenarios"]["seed"],
            controllers=self.controllers,
            parameters=tuple(self._table["parameters"]),
            units=tuple(_unit_of(label, angles) for label in self._table["parameters"]),
            samples=self._samples[:runs],
            outcome=np.array(OUTCOMES)[outcome.astype(int)],
            cause=np.array([*self._causes])[cause.astype(int)],
            metrics=dict(zip(METRICS, figures, strict=True)),
            dynamics=study["experiment"].get("dynamics", ""),
            criterion=descriptions.from_dict(study.get("success", {}), Success),
            angles=tuple(dict.fromkeys(angles)),
        )

    def end(self, run: int, controller: str) -> Ended:
        """Return how a run ended under a controller."""
        if run >= self.planned or run in self.missing():
            raise ArgumentError("run", "one that is recorded", run)
        outcome, cause, *figures = self._ends[run, self.controllers.index(controller)].tolist()
        return Ended(OUTCOMES[int(outcome)], [*self._causes][int(cause)], tuple(figures))

    def record(self, rows: Sequence[Row]) -> None:
        """Take rows up, and write them if it has not been long ago."""
        for run, column, end, sample in rows:
            cause = self._causes.setdefault(end.cause, len(self._causes))
            self._ends[run, column] = OUTCOMES.index(end.outcome), cause, *end.figures
            self._samples[run] = sample
        if time.monotonic() >= self._due:
            self._write()


def _unit_of(label: str, angles: Sequence[str]) -> str:
    """Return the unit of ``"payload"`` or ``"mass.0"``; `angles` are the joints' own, (n,)."""
    key, _, joint = label.partition(".")
    unit = QUANTITIES[key].unit
    its = [angles[int(joint)]] if joint else angles
    # Those of an oscillation are no joint's.
    return unit if key.endswith(("frequency", "phase")) else unit_for(unit, its)
