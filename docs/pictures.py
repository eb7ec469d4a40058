"""Make the pictures of the README and the documentation from real runs.

    python docs/pictures.py [FOLDER]

Figures are SVG; pictures of the arms are taken by Debian's chromium through playwright, and left
out with a message where there is none.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config
from fpid_pin.view import export_html, figures, save_figure

FOLDER = Path(__file__).parent / "pictures"
WINDOW = {"width": 1100, "height": 680}
FLAGS = ["--no-sandbox", "--disable-background-networking", "--enable-unsafe-swiftshader"]


def paper_runs() -> list[fp.Run]:
    """Return what `fpid-pin demo` simulates: section 5.1 under each of its controllers."""
    config = demo_config()
    return fp.simulate(config.experiment, list(config.controllers.values()))


def arm_run(name: str) -> fp.Run:
    """Return an arm of the catalogue that follows sinusoids about its home, 10 s."""
    arm = fp.Arm.from_example(name)
    reference = fp.references.Sinusoid(0.4, np.linspace(0.8, 1.4, arm.n), offset=arm.home)
    law = fp.suggest_gains(arm, name=f"{name}, adaptive FPID")
    return fp.simulate(fp.Experiment(arm, reference, q0=arm.home, duration=10.0), law)


def photograph(pages: Mapping[str, tuple[Path, float]], folder: Path) -> list[Path]:
    """Take each page's picture at a time [s]; none where there is no browser."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        browser = None
    if browser is None:
        sys.stderr.write("no chromium or no playwright here: arms are not photographed\n")
        return []
    taken = []
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=browser, args=FLAGS)
        page = chromium.new_page(viewport=WINDOW)
        for name, (file, time) in pages.items():
            page.goto("about:blank")
            page.goto(f"{file.as_uri()}#t={time:g}")
            while not page.evaluate("window.fpidPin !== undefined"):
                page.wait_for_timeout(50)
            page.evaluate("document.querySelectorAll('.dg').forEach((e) => e.remove())")
            page.wait_for_timeout(500)
            path = folder / f"{name}.png"
            page.screenshot(path=path)
            taken.append(path)
        chromium.close()
    return taken


def main(folder: Path) -> list[Path]:
    """Write every picture into `folder` and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paper = paper_runs()
    made = [save_figure(f, folder / f"{name}.svg") for name, f in figures(paper).items()]
    with tempfile.TemporaryDirectory() as temporary:
        work = Path(temporary)
        integer, published = paper[-1], paper[0]
        pages = {"two_link": (export_html([integer, published], work / "two_link.html"), 1.4)}
        for name in ("ur5", "panda"):
            pages[name] = (export_html(arm_run(name), work / f"{name}.html"), 0.6)
        made += photograph(pages, folder)
    return made


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    sys.stdout.write("".join(f"{path}\n" for path in main(target)))
