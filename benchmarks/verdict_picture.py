"""The verdict of `baselines.py` as a picture: tail errors of all laws, a panel a condition."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from verdict import Trial, interval

#: One colour a kind: PIDs and FPIDs without the model, with it, and the others.
KINDS = {
    "PID without a model": "tab:blue",
    "PID with feedforward and observer": "tab:orange",
    "the usual laws with a model": "0.35",
}
COLUMNS = 3


def kind(name: str) -> str:
    """Return which of `KINDS` a family is."""
    if "+ model" in name:
        return "PID with feedforward and observer"
    return "PID without a model" if name.endswith("PID") else "the usual laws with a model"


def draw(trials: Mapping[str, Mapping[str, Trial]], path: Path, title: str) -> None:
    """Draw medians with their intervals; FPIDs have full marks, integer laws hollow ones."""
    conditions = list(next(iter(trials.values())))
    names = sorted(trials, key=lambda name: list(KINDS).index(kind(name)))
    rows = -(-len(conditions) // COLUMNS)
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(12.0, 1.2 + 2.7 * rows), sharey=True, layout="constrained"
    )
    place = np.arange(len(names))[::-1]
    for axis, condition in zip(axes.flat, conditions, strict=False):
        for y, name in zip(place, names, strict=True):
            middle, low, high = interval(trials[name][condition].error)
            if not np.isfinite(middle):
                axis.text(0.98, y, "diverged", ha="right", va="center", fontsize=8,
                          transform=axis.get_yaxis_transform())  # fmt: skip
                continue
            high = high if np.isfinite(high) else 1e3 * middle
            colour = KINDS[kind(name)]
            face = colour if "FPID" in name else "white"
            axis.plot([low, high], [y, y], color=colour, lw=1.6, zorder=2)
            axis.plot(middle, y, "o", color=colour, mfc=face, ms=6, zorder=3)
        axis.set_xscale("log")
        axis.set_title(condition, fontsize=10)
        axis.grid(axis="x", which="both", color="0.9", lw=0.6)
        axis.set_yticks(place, names, fontsize=8)
    for axis in axes.flat[len(conditions) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("tail RMS error [mrad]")
    marks = [
        plt.Line2D([], [], color=colour, marker="o", lw=1.6, label=label)
        for label, colour in KINDS.items()
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(f"{title}: median over five seeds and their arms, 95 % interval", fontsize=11)
    figure.savefig(path, dpi=110)
    plt.close(figure)
