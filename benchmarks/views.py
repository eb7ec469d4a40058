"""What do the views cost?

export: 20 s of a run from its file to a page, processor time and size; wanted at most 1.5 s and
1.5 MB for the two-link arm, 3 s and 6 MB for a UR5 with its meshes. frames: the time by the clock
that `LiveLink.send` keeps the control loop waiting, to a server that reads and to one that is
stopped; wanted a median under 3 ms, in practice some 10 us. slider: from a slider of the playground
to new curves in a real browser (wants playwright and chromium), wanted 60 and 150 ms.
"""

import os
import signal
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
from common import Bench, run

import fpid_pin as fp
from fpid_pin.view import export_html
from fpid_pin.view.link import LiveLink

# As in tests/view/conftest.py.
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"]  # fmt: skip
# A move as a hand makes it; the end is the first frame after everything has been drawn.
MEASURE = """
async (moves) => {
  const slider = document.getElementById("integral_order"), found = [], runs = [];
  const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  for (let k = 0; k < moves; k++) {
    const before = playground.state.got, start = performance.now();
    slider.value = 0.5 + 0.4 * (k / moves);
    slider.dispatchEvent(new Event("input"));
    while (playground.state.got === before) await new Promise((done) => setTimeout(done, 1));
    await frame();
    found.push(performance.now() - start);
    runs.push(playground.state.runs[0].milliseconds);
    await new Promise((done) => setTimeout(done, 50));
  }
  return [found.slice(5), runs.slice(5)];
}
"""


def export(bench: Bench) -> None:
    rows = []
    for arm in (fp.Arm.two_link(), fp.Arm.from_example("ur5")):
        reference = fp.references.Sinusoid(0.3, offset=arm.home)
        experiment = fp.Experiment(arm, reference, q0=arm.home, duration=20.0)
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "run.html"
            file = fp.simulate(experiment, fp.suggest_gains(arm)).save(Path(folder) / "run.npz")
            loaded = fp.Run.load(file)
            began = time.process_time()
            export_html(loaded, page)
            seconds = time.process_time() - began
            rows.append([arm.name, f"{seconds:.2f}", f"{page.stat().st_size / 1e6:.2f}"])
    bench.say(f"A page of 20 s of a run takes {rows[0][1]} to {rows[1][1]} s.")
    bench.table(["page of 20 s", "processor time [s]", "size [MB]"], rows)


def frames(bench: Bench) -> None:
    count, rows = 200 if bench.quick else 2000, []
    for joints, stopped in ((2, False), (7, False), (300, False), (7, True), (300, True)):
        frame = [(np.zeros(joints), np.zeros(joints), np.zeros(joints))]
        taken = np.empty(count)
        with LiveLink("page", announce=lambda text: None) as link:
            if stopped:
                os.kill(link.pid, signal.SIGSTOP)
            for k in range(count):
                began = time.perf_counter()
                link.send(0.01 * k, frame)
                taken[k] = time.perf_counter() - began
                # As a loop would: a server that reads gets its turn.
                time.sleep(1e-4)
            dropped = link.dropped
            if stopped:
                os.kill(link.pid, signal.SIGCONT)
        figures = 1e6 * np.percentile(taken, [50.0, 99.0, 100.0])
        name = f"{joints} joints, server {'stopped' if stopped else 'reading'}"
        rows.append([name, *(f"{x:.0f}" for x in figures), f"{dropped} of {count}"])
    bench.say(f"A frame keeps the control loop waiting for {rows[1][1]} us (median).")
    heads = ["frame", "median [us]", "99th percentile [us]", "worst [us]", "dropped"]
    bench.table(heads, rows)


def slider(bench: Bench) -> None:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        bench.say("playwright is not installed.")
        return
    arm, rows = fp.Arm.from_example("ur5"), []
    phase = (0.0, 0.52, 1.05, 1.57, 2.09, 2.62)
    job = fp.Experiment(arm, fp.references.Sinusoid(0.3, phase=phase))
    paper = fp.paper_controller(supervised=False)
    cases = [("two_link", fp.paper_experiment(), paper, 60.0),
             ("ur5", job, fp.suggest_gains(arm, bandwidth=10.0), 150.0)]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        for name, experiment, law, most in cases[: 1 if bench.quick else 2]:
            path = Path(folder) / f"{name}.html"
            fp.view.playground(experiment, law, path)
            page = browser.new_page(
                viewport={"width": 1200, "height": 800}, reduced_motion="reduce"
            )
            page.goto(path.as_uri())
            page.locator("#outcome", has_text="Ran all").wait_for()
            found, runs = page.evaluate(MEASURE, 8 if bench.quick else 25)
            rows.append([
                name, f"{statistics.median(found):.0f} ({min(found):.0f})",
                f"{statistics.median(runs):.0f}", f"{most:.0f}",
                f"{path.stat().st_size / 1e6:.2f}",
            ])  # fmt: skip
            page.close()
        browser.close()
    bench.say(f"From a slider to new curves: {rows[0][1]} ms, median (fastest), on the two-link.")
    heads = ["page", "slider to curves [ms]", "of which the run [ms]", "wanted [ms]", "size [MB]"]
    bench.table(heads, rows)


if __name__ == "__main__":
    run(__doc__, export, frames, slider)
