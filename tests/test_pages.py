"""What the pages show runs as it stands there, and their links lead somewhere."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from bounded import finished

from fpid_pin.control import EncoderRate

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("data.md", "robot.md")


@pytest.mark.parametrize("name", PAGES)
def test_its_code_runs_from_top_to_bottom(name, tmp_path):
    text = (DOCS / name).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    (tmp_path / "page.py").write_text("\n".join(blocks), encoding="utf-8")
    done = finished([sys.executable, "-W", "error", "page.py"], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    if name == "robot.md":
        assert f"print(loop.ticks)  # {done.stdout.strip()}" in text


def test_every_link_leads_somewhere():
    for page in (*DOCS.glob("*.md"), DOCS.parent / "README.md", DOCS.parent / "CONTRIBUTING.md"):
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_the_noise_that_is_told_is_the_filter_s():
    resolution = 2 * np.pi / 2**14
    told = [EncoderRate(tau).noise(resolution, 1e-3) for tau in (0.0, 1e-3, 5e-3)]
    assert [float(f"{value:.2g}") for value in told] == [0.16, 0.064, 0.019]
