"""What the views cost: exporting a run as one page, and sending frames to a live one.

    python benchmarks/views.py

Export: 20 s of a run from its file to a page, processor time and size; wanted at most 1.5 s and
1.5 MB for the two-link arm, 3 s and 6 MB for a UR5 with its meshes. Frames: the time by the clock
that `LiveLink.send` keeps the control loop waiting, to a server that reads and to one that is
stopped; wanted a median under 3 ms, in practice some 10 us.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np
from common import head, row

import fpid_pin as fp
from fpid_pin.view import export_html
from fpid_pin.view.link import LiveLink

# (joints, whether the server is stopped)
FRAMES = ((2, False), (7, False), (300, False), (7, True), (300, True))
COUNT = 2000


def exported(arm: fp.Arm) -> tuple[float, float]:
    """Return the processor time [s] and the page's size [MB] of 20 s of an arm's run."""
    law = fp.suggest_gains(arm)
    reference = fp.references.Sinusoid(0.3, offset=arm.home)
    run = fp.simulate(fp.Experiment(arm, reference, q0=arm.home, duration=20.0), law)
    with tempfile.TemporaryDirectory() as folder:
        file, page = Path(folder) / "run.npz", Path(folder) / "run.html"
        run.save(file)
        run = fp.Run.load(file)
        begin = time.process_time()
        export_html(run, page)
        return time.process_time() - begin, page.stat().st_size / 1e6


def sent(joints: int, stopped: bool) -> tuple[np.ndarray, int]:
    """Return the seconds of each send and how many frames were dropped."""
    frame = [(np.zeros(joints), np.zeros(joints), np.zeros(joints))]
    taken = np.empty(COUNT)
    with LiveLink("page", announce=lambda text: None) as link:
        if stopped:
            os.kill(link.pid, signal.SIGSTOP)
        for k in range(COUNT):
            begin = time.perf_counter()
            link.send(0.01 * k, frame)
            taken[k] = time.perf_counter() - begin
            # As a loop would: a server that reads gets its turn.
            time.sleep(1e-4)
        dropped = link.dropped
        if stopped:
            os.kill(link.pid, signal.SIGCONT)
    return taken, dropped


def main() -> None:
    print("\n".join(head(["page of 20 s", "processor time [s]", "size [MB]"])))
    for arm in (fp.Arm.two_link(), fp.Arm.from_example("ur5")):
        seconds, size = exported(arm)
        print(row([arm.name, f"{seconds:.2f}", f"{size:.2f}"]))
    heads = ["frame", "median [us]", "99th percentile [us]", "worst [us]", "dropped"]
    print("", *head(heads), sep="\n")
    for joints, stopped in FRAMES:
        taken, dropped = sent(joints, stopped)
        median, high = 1e6 * np.percentile(taken, [50.0, 99.0])
        name = f"{joints} joints, server {'stopped' if stopped else 'reading'}"
        times = (median, high, 1e6 * taken.max())
        print(row([name, *(f"{x:.0f}" for x in times), f"{dropped} of {COUNT}"]))


if __name__ == "__main__":
    main()
