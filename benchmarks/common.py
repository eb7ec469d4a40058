"""What the scripts of this folder share: tables, files of results, arms, motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fpid_pin as fp
from fpid_pin.references import Sinusoid

RESULTS = Path(__file__).parent / "results"
#: The orders of the paper's law, for searches.
ORDERS: dict[str, Any] = {"integral_order": (0, 1), "derivative_order": (0, 1)}


def row(cells: Iterable[Any]) -> str:
    """Return a line of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def head(heads: Sequence[str], text: int = 1) -> list[str]:
    """Return the first two lines of a table whose first `text` columns are words."""
    return [row(heads), row(["---"] * text + ["---:"] * (len(heads) - text))]


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]], text: int = 1) -> list[str]:
    """Return a table, and an empty line."""
    return [*head(heads, text), *map(row, rows), ""]


class Report:
    """Lines that are printed as they come, and kept."""

    def __init__(self, *lines: str) -> None:
        self.lines: list[str] = []
        self.add(*lines)

    def add(self, *lines: str) -> None:
        for line in lines:
            print(line, flush=True)
        self.lines += lines

    def write(self, name: str, title: str = "") -> None:
        """Write what was printed as a file of `results`, under a title."""
        RESULTS.mkdir(exist_ok=True)
        text = "\n".join(self.lines).rstrip() + "\n"
        (RESULTS / name).write_text(f"{title}\n\n{text}" if title else text, encoding="utf-8")


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
    """Return the RMS of the last half over all joints [mrad]."""
    return 1e3 * float(np.sqrt((run.metrics.rms_tail**2).mean()))


def variation(run: fp.Run) -> float:
    """Return the total variation of all torques [N m]."""
    return float(run.metrics.total_variation.sum())
