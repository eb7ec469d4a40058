"""Every example runs as it stands."""

import sys
from pathlib import Path

from bounded import finished

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
#: One process for all: to begin takes longer than most of them do.
RUN = """
import runpy, sys

if __name__ == "__main__":
    for path in sys.argv[1:]:
        print("example", path, flush=True)
        runpy.run_path(path, run_name="__main__")
"""


def test_they_run_and_each_says_something(tmp_path):
    (tmp_path / "run.py").write_text(RUN)
    done = finished([sys.executable, "run.py", *EXAMPLES], cwd=tmp_path)
    assert done.returncode == 0, done.stdout.splitlines()[-1] + done.stderr
    told = done.stdout.split("example ")[1:]
    assert len(told) == len(EXAMPLES) > 5
    for path, text in zip(EXAMPLES, told, strict=True):
        assert text.startswith(str(path))
        assert len(text.splitlines()) > 1, path
