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
FAR = 20.0  # what lies beyond is an arrow [mrad]


def kind(name: str) -> str:
    """Return which of `KINDS` a family is."""
    if "+ model" in name:
        return "PID with feedforward and observer"
    return "PID without a model" if name.endswith("PID") else "the usual laws with a model"


def draw(trials: Mapping[str, Mapping[str, Trial]], path: Path, title: str) -> None:
    """Draw medians with their intervals; an arrow where an interval goes on."""
    conditions = list(next(iter(trials.values())))
    names = sorted(trials, key=lambda name: list(KINDS).index(kind(name)))
    rows = -(-len(conditions) // COLUMNS)
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(12.0, 1.2 + 2.7 * rows), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    place = np.arange(len(names))[::-1]
    found = {(n, c): interval(trials[n][c].error) for n in names for c in conditions}
    medians = np.array([x[0] for x in found.values() if np.isfinite(x[0])])
    left = 0.4 * medians.min()
    for axis, condition in zip(axes.flat, conditions, strict=False):
        for y, name in zip(place, names, strict=True):
            middle, low, high = found[name, condition]
            colour = KINDS[kind(name)]
            if not np.isfinite(middle):
                axis.text(0.98, y, "diverged", ha="right", va="center", fontsize=8, color=colour,
                          transform=axis.get_yaxis_transform())  # fmt: skip
                continue
            axis.plot(
                [np.clip(low, left, FAR), min(high, FAR)], [y, y], color=colour, lw=1.6, zorder=2
            )
            if high > FAR:
                axis.plot(FAR, y, ">", color=colour, ms=5, clip_on=False, zorder=3)
            face = colour if "FPID" in name else "white"
            if middle < FAR:
                axis.plot(middle, y, "o", color=colour, mfc=face, ms=6, zorder=3)
        axis.set_xscale("log")
        axis.set_xlim(left, FAR)
        axis.xaxis.set_major_formatter("{x:g}")
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
    marks += [
        plt.Line2D([], [], color="0.2", mfc=face, marker="o", ls="", label=label)
        for face, label in (("0.2", "fractional"), ("white", "integer"))
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(f"{title}: median over five seeds and their arms, 95 % interval", fontsize=11)
    figure.savefig(path, dpi=110)
    plt.close(figure)
