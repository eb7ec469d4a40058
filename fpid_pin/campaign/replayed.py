"""One run of a campaign again, exactly, with everything recorded."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from pathlib import Path

from fpid_pin import checks
from fpid_pin.campaign.chunk import Ended, ended
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation import Run, simulate


@dataclass(frozen=True, eq=False)
class Replay:
    """A run of a campaign and its nominal twin.

    Attributes
    ----------
    run
        As it was, under its sample.
    nominal
        The same controller on the nominal plant.
    number, controller
        Which run it is.
    sample
        Its uncertain numbers, by label.
    recorded, again
        How it ended by the ledger, and now.
    """

    run: Run
    nominal: Run
    number: int
    controller: str
    sample: dict[str, float]
    recorded: Ended
    again: Ended

    @property
    def exact(self) -> bool:
        """Whether outcome and metrics are those of the ledger, to the last bit.

        They are on the machine that recorded them; another processor's sine may differ in it.
        """
        # Python writes every digit of a number, and NaN is NaN.
        return repr(astuple(self.recorded)) == repr(astuple(self.again))


def replay(ledger: str | Path, run: int, controller: str | None = None) -> Replay:
    """Simulate a run of a campaign again, and its nominal twin.

    Parameters
    ----------
    ledger
        Of the campaign.
    run
        Number of the run.
    controller
        Name; None: the first.

    Raises
    ------
    ArgumentError
        A run or controller that is not in the ledger.
    SimulationError
        A run that could not be simulated: there is nothing to be seen.
    FileFormatError
        See `load`.
    """
    with Ledger(ledger) as book:
        run = checks.integer("run", run, low=0)
        name = checks.choice("controller", controller or book.controllers[0], book.controllers)
        before = book.end(run, name)
        if before.outcome == "failed":
            raise SimulationError(f"run {run}: {before.cause}; there is nothing to replay")
        study = book.study()
    sample = study.samples(run, run + 1)[0]
    law = study.controllers[name]
    again, nominal = simulate([study.experiment_of(run, sample), study.experiment], law)
    now = ended(study.experiment.arm.joint_names, again.outcome, again.metrics)
    values = dict(zip(study.parameters, sample.tolist(), strict=True))
    return Replay(again, nominal, run, name, values, before, now)
