"""Every example runs as it stands."""

import sys
from pathlib import Path

import pytest
from bounded import finished

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.name)
def test_it_runs_and_says_something(path, tmp_path):
    done = finished([sys.executable, path], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
