"""Playing a run live, at real speed or another."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.view.export import as_runs
from fpid_pin.view.link import LiveLink
from fpid_pin.view.page import render
from fpid_pin.view.scene import captions_of, replay_scene, sample_run

_LINGER = 0.3
# Samples a second of what is played: enough for any screen at any speed that can be followed.
_FINE = 120.0


def play(
    run: Run | Sequence[Run],
    *,
    speed: float = 1.0,
    loop: bool = False,
    open_browser: bool = True,
    port: int | None = None,
    fps: float = 40.0,
    captions: Sequence[str] | None = None,
    announce: Callable[[str], None] | None = None,
) -> list[float]:
    """Show a run in a browser while it plays; Ctrl-C ends it.

    The page is served on 127.0.0.1 by a process that ends with this one. Playing begins when a
    browser looks at it. The space bar, in the page, halts and resumes it; ``q`` ends it.

    Parameters
    ----------
    run
        What to play; several runs stand side by side.
    speed
        1: real time.
    loop
        Start over at the end.
    open_browser
        Whether to open the page, or only to say where it is.
    port
        First port to try; None: 7000.
    fps
        Frames a second, 1 to 240.
    captions
        One a run; None: the runs' names.
    announce
        Told what the user needs to know; None: the package's logger.

    Returns
    -------
    list of float
        How long each frame took to send [s].

    Raises
    ------
    ArgumentError
        `speed`, `port` or `fps` out of range, no runs, or one without samples.
    FpidError
        The server did not start, or was ended by someone else.
    """
    speed = checks.number("speed", speed, above=0.0)
    fps = checks.number("fps", fps, low=1.0, high=240.0)
    runs = as_runs(run)
    scene = replay_scene(runs, captions=captions, fps=_FINE)
    scene |= scene.pop("groups")[0] | {"live": True}
    motions = [sample_run(one, _FINE) for one in runs]
    title = " / ".join(captions_of(runs, captions))
    end = max(float(t[-1]) for t, *_ in motions)
    sent: list[float] = []
    with LiveLink(render(scene, title), port=port, announce=announce) as link:
        # Ctrl-C ends it.
        with contextlib.suppress(KeyboardInterrupt):
            link.show(open_browser)
            t, before, halted = 0.0, time.perf_counter(), False
            while link.alive and t <= end:
                start = time.perf_counter()
                link.send(t, [_frame(motion, t) for motion in motions])
                now = time.perf_counter()
                sent.append(now - start)
                time.sleep(1.0 / fps)
                keys = link.keys()
                if "q" in keys:
                    return sent
                halted ^= bool(keys.count(" ") % 2)
                # Playing begins when a browser looks at it.
                if link.viewers and not halted:
                    t += speed * (now - before)
                    t = math.fmod(t, end) if loop and t > end > 0.0 else t
                before = now
            link.send(end, [_frame(motion, end) for motion in motions])
            # The last frame is still on its way to the browser.
            time.sleep(_LINGER)
        if not link.alive:
            raise FpidError("live view: its server was ended from outside")
    return sent


def _frame(motion: tuple[FloatArray, ...], t: float) -> tuple[FloatArray, ...]:
    """Return q, q_ref and torque at `t`; a run that ended earlier stays where it was."""
    k = min(int(np.searchsorted(motion[0], t, side="right")) - 1, len(motion[0]) - 1)
    return tuple(array[k] for array in motion[1:])
