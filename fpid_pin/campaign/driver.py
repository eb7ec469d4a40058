"""What is done with a campaign: run, its worst plants searched, loaded, a run simulated again.

What is missing in a ledger is simulated, chunk by chunk, and what comes back is recorded.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import astuple, dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.campaign.data import METRICS, CampaignData, Ended
from fpid_pin.campaign.ledger import COLUMNS, Ledger, Row
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control import Controller
from fpid_pin.exceptions import ArgumentError, FpidError, SimulationError, WorkersDied
from fpid_pin.files import locked
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation import Experiment, Run, simulate
from fpid_pin.simulation.entry import measure, warm
from fpid_pin.simulation.workers import distribute, executor_of, workers_of

#: Runs of a task.
CHUNK = 64


@checked
def run(
    study: Study,
    ledger: str | Path,
    runs: int,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int = CHUNK,
    progress: ProgressCallback | None = None,
) -> CampaignData:
    """Simulate runs 0 to `runs` - 1 of a campaign and record them; go on where a ledger ends.

    Parameters
    ----------
    study
        The campaign.
    ledger
        Its file; made where there is none.
    runs
        How many there are to be. More than are there: those are kept.
    executor
        Any `concurrent.futures.Executor`; it stays open.
    workers
        Or so many of our own: threads for compiled laws and dynamics, else processes. Neither: one
        run after another.
    chunk
        Runs of a task. Neither it nor the executor changes a bit of what is recorded.
    progress
        Called now and then with a `Progress`.

    Returns
    -------
    CampaignData
        All runs.

    Raises
    ------
    ArgumentError, FileFormatError
        Before anything is simulated: see `Ledger`.
    WorkersDied
        Workers died twice over the same runs, which are named; what was recorded stays.
    """
    runs = checks.integer("runs", runs, low=1)
    chunk = checks.integer("chunk", chunk, low=1)
    points = study.scenarios.points
    if points is not None and runs > len(np.asarray(points)):
        raise ArgumentError("runs", f"at most {len(np.asarray(points))} (the points given)", runs)
    nominal, laws = [study.experiment] * len(study.laws), study.laws
    with (
        executor_of(executor, workers, nominal, laws) as pool,
        locked(ledger),
        Ledger(ledger, study, runs) as book,
    ):
        recorded = book.recorded()
        missing = [k for k in range(book.planned) if k not in recorded]
        if missing and pool is not None:
            # So that workers find the kernels compiled.
            warm(nominal, laws)
        # Cut where multiples of `chunk` are: a campaign that goes on cuts as it did before.
        todo = [list(several) for _, several in groupby(missing, lambda k: k // chunk)]
        done = len(recorded)
        try:
            for k, rows in distribute(run_chunk, [(study, numbers) for numbers in todo], pool):
                book.record(rows)
                done += len(todo[k])
                if progress is not None:
                    progress(Progress(done / book.planned))
        except WorkersDied as error:
            first, last = todo[error.task][0], todo[error.task][-1]
            raise WorkersDied(f"runs {first} to {last}: {error}", error.task) from None
        return book.data()


def run_chunk(study: Study, numbers: Sequence[int]) -> list[Row]:
    """Simulate rising numbers of runs under every controller: a task, wherever it is done.

    What fails under one controller leaves the others alone.
    """
    samples = study.samples(numbers[0], numbers[-1] + 1)[np.subtract(numbers, numbers[0])]
    rows = []
    for number, sample in zip(numbers, samples, strict=True):
        experiment: Experiment | None = None
        for column, law in enumerate(study.laws):
            try:
                experiment = experiment or study.experiment_of(number, sample)
                ((outcome, metrics),) = measure([experiment], [law])
                end = Ended.of(experiment.arm.joint_names, outcome, metrics)
            except (MemoryError, ImportError, OSError):
                raise  # faults of the machine, which no run is to blame for
            except Exception as error:  # of a disturbance, reference or law of the user's own
                kind = "" if isinstance(error, FpidError) else f"{type(error).__name__}: "
                end = Ended("failed", f"{kind}{error}")
            rows.append((number, column, end.outcome, end.cause, *end.figures, *sample.tolist()))
    return rows


@checked
def attack(
    study: Study, ledger: str | Path, *, population: int = 32, generations: int = 40,
    executor: Executor | None = None, workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> CampaignData:  # fmt: skip
    """Search each controller's worst plant, by SciPy's differential evolution, and record it.

    A run that does not come to its end is worse than one that does, and else the larger RMS error.

    Parameters
    ----------
    study
        The campaign; its scenarios' seed is that of the search too.
    ledger
        A new file: run k is the worst plant of controller k, under every controller; it can be
        replayed, as it is a campaign of those points.
    population, generations
        Plants tried at once for each controller, and how often.
    executor, workers, progress
        See `run`; each generation's plants are dealt out.

    Raises
    ------
    ArgumentError, FileFormatError, WorkersDied
        See `run`.
    """
    # Imported late: scipy is heavy.
    from scipy.optimize import differential_evolution

    checks.integer("population", population, low=5)
    checks.integer("generations", generations, low=1)
    size, seed, calls = len(study.parameters), study.scenarios.seed, 0
    spread = replace(study.scenarios, sampling="sobol", points=None).cube(0, population, size)

    with executor_of(executor, workers, [study.experiment], study.laws) as pool:

        def cost(columns: FloatArray, law: Controller) -> FloatArray:
            nonlocal calls
            points, errors = np.atleast_2d(columns.T), np.empty(columns.size // size)
            scenarios = replace(study.scenarios, points=points)
            alone = replace(study, controllers={"searched": law}, scenarios=scenarios)
            cuts = np.array_split(np.arange(len(errors)), min(workers_of(pool), len(errors)))
            for k, rows in distribute(run_chunk, [(alone, cut.tolist()) for cut in cuts], pool):
                errors[cuts[k]] = [row[COLUMNS.index("rms")] for row in rows]
            calls += 1
            if progress is not None:
                progress(Progress(min(calls / len(study.laws) / (generations + 1), 1.0)))
            return -np.where(np.isfinite(errors), errors, 1e6)  # no run that ends is as bad

        worst = [
            differential_evolution(
                cost, [(0.0, 1.0)] * size, (law,), init=spread, maxiter=generations, tol=0.0,
                rng=np.random.default_rng(seed), polish=False, updating="deferred", vectorized=True,
            ).x.clip(0.0, 1.0)
            for law in study.laws
        ]  # fmt: skip
        scenarios = replace(study.scenarios, points=np.array(worst))
        found = replace(study, scenarios=scenarios, title=f"{study.title}: worst plants")
        return run(found, ledger, len(worst), executor=pool)


@checked
def load(ledger: str | Path) -> CampaignData:
    """Return what a ledger holds, also while its campaign runs: runs up to the first missing one.

    Parameters
    ----------
    ledger
        The file.

    Returns
    -------
    CampaignData

    Raises
    ------
    FileFormatError
        Not a ledger, or a damaged one.
    """
    with Ledger(ledger) as book:
        return book.data()


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

    def __str__(self) -> str:
        again, before = self.again, self.recorded.figures
        figures = zip(METRICS, again.figures, before, strict=True)
        told = "the same bits" if self.exact else "NOT the same bits: recorded by another machine?"
        return "\n".join([
            *(f"  {label}: {value:.6g}" for label, value in self.sample.items()),
            f"run {self.number}, {self.controller}: {again.outcome} {again.cause}".rstrip(),
            f"  dynamics: {self.run.meta['experiment']['dynamics']}",
            *(f"  {name}: {now!r}, recorded {then!r}" for name, now, then in figures),
            f"as the ledger has it: {told}",
        ])  # fmt: skip


@checked
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
    now = Ended.of(study.experiment.arm.joint_names, again.outcome, again.metrics)
    values = dict(zip(study.parameters, sample.tolist(), strict=True))
    return Replay(again, nominal, run, name, values, before, now)
