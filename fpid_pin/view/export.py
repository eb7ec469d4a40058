"""A run as one page that opens anywhere: no server, no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fpid_pin.files import put_text
from fpid_pin.simulation.run import Run
from fpid_pin.view.page import render
from fpid_pin.view.scene import captions_of, replay_scene


def as_runs(runs: Run | Sequence[Run]) -> list[Run]:
    """Return a list whether one run or several are given."""
    return [runs] if isinstance(runs, Run) else list(runs)


def replay_html(
    runs: Run | Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    title: str | None = None,
    groups: Mapping[str, Sequence[int]] | None = None,
) -> str:
    """Return the page that `export_html` writes; of several `groups` it shows the first."""
    several = as_runs(runs)
    scene = replay_scene(several, captions=captions, fps=fps, groups=groups)
    return render(scene, title or " / ".join(captions_of(several, captions)))


def export_html(
    runs: Run | Sequence[Run],
    path: str | Path,
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    title: str | None = None,
) -> Path:
    """Write runs as one self-contained page, played with meshcat's time slider.

    The arm, its desired self as a ghost, the tool's paths and the joint torques against their
    limits; several runs stand side by side under their captions.

    Parameters
    ----------
    runs
        A run, or several.
    path
        The file; it appears whole or not at all.
    captions
        One a run; None: the runs' names.
    fps
        Samples of the motion a second, 1 to 240; what is between is interpolated.
    title
        Of the page; None: the captions.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        No runs, not one caption a run, `fps` out of range.
    FileFormatError
        The file cannot be written.
    """
    return put_text(path, replay_html(runs, captions=captions, fps=fps, title=title))
