"""A replay in the cell of a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from fpid_pin.simulation.run import Run
from fpid_pin.view.export import as_runs, replay_html


class Replay:
    """A page that is there, `text`; in a notebook it shows itself, shut off from what is around."""

    def __init__(self, text: str, height: int, runs: int) -> None:
        self.text, self._height, self._runs = text, height, runs

    def __repr__(self) -> str:
        runs = "1 run" if self._runs == 1 else f"{self._runs} runs"
        return f"<Replay of {runs}, {len(self.text.encode()) / 1e6:.2f} MB>"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self._height}px; border: 1px solid #8884"
        return (
            f'<iframe title="replay" sandbox="allow-scripts" style="{style}" '
            f'srcdoc="{escape(self.text)}"></iframe>'
        )


def show(
    runs: Run | Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    height: int = 520,
) -> Replay:
    """Return the replay of runs for a notebook: the last line of a cell shows it.

    Parameters
    ----------
    runs, captions, fps
        As for `export_html`; the same page, which takes some 1 MB in the notebook.
    height
        Of the frame [pixels].

    Raises
    ------
    ArgumentError
        As `export_html` does.
    """
    return Replay(replay_html(runs, captions=captions, fps=fps), height, len(as_runs(runs)))
