"""From a slider to new curves: medians in a real browser, and the size of the pages."""

from __future__ import annotations

import statistics
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

import fpid_pin as fp

# As in tests/view/conftest.py.
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"]  # fmt: skip
MOVES = 25
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


def cases() -> list[tuple[str, fp.Experiment, fp.Controller, float]]:
    arm = fp.Arm.from_example("ur5")
    phase = (0.0, 0.52, 1.05, 1.57, 2.09, 2.62)
    job = fp.Experiment(arm, fp.references.Sinusoid(0.3, phase=phase))
    paper = fp.paper_controller(supervised=False)
    return [
        ("two_link", fp.paper_experiment(), paper, 60.0),
        ("ur5", job, fp.suggest_gains(arm, bandwidth=10.0), 150.0),
    ]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        for name, job, law, most in cases():
            path = Path(folder) / f"{name}.html"
            fp.view.playground(job, law, path)
            page = browser.new_page(
                viewport={"width": 1200, "height": 800}, reduced_motion="reduce"
            )
            page.goto(path.as_uri())
            page.locator("#outcome", has_text="Ran all").wait_for()
            found, runs = page.evaluate(MEASURE, MOVES)
            print(
                f"{name}: slider to curves {statistics.median(found):.0f} ms (median of "
                f"{len(found)}; fastest {min(found):.0f}; asked: {most:.0f}), of which the run "
                f"{statistics.median(runs):.0f} ms; page {path.stat().st_size / 1e6:.2f} MB"
            )
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
