"""What the scripts of this folder share: how they are run, print and store; arms and motions.

A script answers the question that its docstring begins with, in parts. All take the same words:

    python benchmarks/NAME.py [PART ...] [--quick] [--workers N] [--data FOLDER] [--out FOLDER]

A whole run writes NAME.md and its figures into benchmarks/results: the question, sentences that say
the answer, the tables, and what they were measured with. `record.py` puts these together. With
--quick, or with some parts only, nothing is written unless --out names a folder.
"""

import argparse
import importlib.metadata
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import fpid_pin as fp
from fpid_pin.references import Sinusoid

RESULTS = Path(__file__).parent / "results"
VERSIONS = ("fpid_pin", "pin", "numpy", "numba", "scipy")
#: What comes below such a line in a file of results is left out of the record.
DETAILS = "### "


@dataclass(eq=False)
class Bench:
    """A run of a script: how it was asked for, and what it has printed for the record and below."""

    quick: bool
    workers: int
    data: Path | None
    out: Path | None
    head: list[str] = field(default_factory=list)
    below: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.lines = self.head
        #: Arms that parts go through.
        self.arms = ("two_link",) if self.quick else ("two_link", "ur5", "panda")

    def say(self, *lines: str) -> None:
        """Print a paragraph."""
        for line in (*lines, ""):
            print(line, flush=True)
            self.lines.append(line)

    def table(self, heads: Sequence[str], rows: Iterable[Iterable[Any]], text: int = 1) -> None:
        """Print a table, row by row as they come; its first `text` columns are words."""
        rule = ["---"] * text + ["---:"] * (len(heads) - text)
        for cells in chain((heads, rule), rows):
            self.lines.append(f"| {' | '.join(map(str, cells))} |")
            print(self.lines[-1], flush=True)
        self.say()

    def records(self, rows: Sequence[dict[str, Any]], text: int = 1) -> None:
        """Print a table whose rows have its heads as keys."""
        self.table(list(rows[0]), (row.values() for row in rows), text)

    def details(self, title: str) -> None:
        """Begin a section that the record leaves to the file of results; it ends with its part."""
        self.lines = self.below
        self.say(f"{DETAILS}{title}")

    def figure(self, figure: Any, name: str, caption: str) -> None:
        """Keep a figure of matplotlib, if anything is kept."""
        if self.out is not None:
            figure.savefig(self.out / name, dpi=110)
            self.say(f"![{caption}]({name})")


Part = Callable[[Bench], None]


def run(doc: str | None, *functions: Part, **others: Part) -> None:
    """Read the command line, run the parts that it asks for, and store what they print."""
    parts = others | {function.__name__: function for function in functions}
    path = Path(sys.argv[0])
    question = str(doc).splitlines()[0]
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(parts)}; all if none is given"
    )
    parser.add_argument("--quick", action="store_true", help="small sizes: does it still run?")
    parser.add_argument("--workers", type=int, default=2, help="threads (2)")
    parser.add_argument("--data", type=Path, help="folder of measured data, where wanted")
    parser.add_argument("--out", type=Path, help="where results are written")
    given = parser.parse_args()
    if unknown := set(given.parts) - set(parts):
        parser.error(f"parts are {', '.join(parts)}; got {', '.join(sorted(unknown))}")
    out = given.out or (None if given.quick or given.parts else RESULTS)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    # What the warnings are about is what the tables say.
    warnings.simplefilter("ignore", fp.FpidWarning)
    bench, began = Bench(given.quick, given.workers, given.data, out), time.monotonic()
    bench.say(f"## {question} `{path.name}`")
    for name in given.parts or parts:
        bench.lines = bench.head
        parts[name](bench)
    words = {"--quick": given.quick, "--data FOLDER": given.data}
    options = [word for word, said in words.items() if said]
    command = " ".join(["python", f"benchmarks/{path.name}", *given.parts, *options])
    made = f"Printed by `{command}` in {time.monotonic() - began:.0f} s on {machine()}."
    print(made)
    if out is not None:
        text = "\n".join([*bench.head, made, "", *bench.below]).rstrip() + "\n"
        (out / f"{path.stem}.md").write_text(text, encoding="utf-8")


def panels(
    size: tuple[float, float], rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Any, Any]:
    """Return a figure of a size [inch] and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def machine() -> str:
    """Return date, processor, load and versions."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    kind = models[0] if models else platform.machine()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in VERSIONS)
    return (
        f"{time.strftime('%d %B %Y')}, {os.cpu_count()} x {kind}, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}, {versions}"
    )


def arm_of(name: str) -> fp.Arm:
    """Return an arm by name; ``"two_link"`` is the paper's."""
    return fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)


def around_home(arm: fp.Arm, amplitude: float = 0.3, frequency: float = 1.0) -> Sinusoid:
    """Return sinusoids around home, their phases spread evenly over half a turn."""
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    return Sinusoid(amplitude=amplitude, frequency=frequency, phase=phase, offset=arm.home)


def on_reference(reference: fp.references.Reference) -> dict[str, np.ndarray]:
    """Return q0 and v0 of an experiment that starts on its reference."""
    q, v, _ = reference.sample(np.zeros(1))
    return {"q0": q[0], "v0": v[0]}


def parameters(law: fp.Controller, names: Iterable[str]) -> str:
    """Return some of a law's parameters as text."""
    each = {name: np.atleast_1d(getattr(law, name)) for name in names}
    return ", ".join(f"{name} ({', '.join(f'{v:.3g}' for v in x)})" for name, x in each.items())


def tail(run: fp.Run) -> float:
    """Return the RMS of the last half over all joints [mrad]; inf where the run ended early."""
    if not run.outcome.completed:
        return np.inf
    return 1e3 * float(np.sqrt((run.metrics.rms_tail**2).mean()))


def variation(run: fp.Run) -> float:
    """Return the total variation of all torques [N m]."""
    return float(run.metrics.total_variation.sum())


def turn_by_turn(
    works: list[Callable[[], object]], repeats: int, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return the least time of each of some works [s].

    They take turns, so that a machine that is slow for a while is slow for all of them.
    """
    times = [np.inf] * len(works)
    for _ in range(repeats):
        for k, work in enumerate(works):
            began = clock()
            work()
            times[k] = min(times[k], clock() - began)
    return times


def aba_calls(arm: fp.Arm, count: int = 1000) -> Callable[[], None]:
    """Return a work of so many `pin.aba` calls from Python: the unit of this machine."""
    import pinocchio as pin

    model, data = arm.model, arm.model.createData()
    q, zero = np.array(arm.home), np.zeros(arm.n)

    def many() -> None:
        for _ in range(count):
            pin.aba(model, data, q, zero, zero)

    return many
