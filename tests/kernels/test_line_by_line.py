"""The kernels without compilation: every line and every branch.

That laws give the same torques then is in tests/control/test_law_files.py.
"""

import json
import os
import sys
from pathlib import Path

from bounded import finished

import fpid_pin as fp

ROOT = Path(__file__).parents[2]
KERNELS = Path(fp.__file__).parent / "kernels"


def test_the_tests_of_the_kernels_pass_line_by_line_and_leave_no_branch_out(tmp_path):
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        "COVERAGE_FILE": str(tmp_path / "coverage"),
        "COVERAGE_RCFILE": os.devnull,
    }
    report = tmp_path / "report.json"

    def coverage(*arguments):
        done = finished(
            [sys.executable, "-m", "coverage", *arguments], cwd=ROOT, env=environment, timeout=250
        )
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]

    only = ["--branch", f"--include={KERNELS}/*"]
    coverage("run", *only, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "kernels",
             "tests/kernels", "tests/fractional/test_bank.py")  # fmt: skip
    coverage("json", "-o", str(report))
    found = json.loads(report.read_text())
    missing = {
        name: (file["missing_lines"], file["missing_branches"])
        for name, file in found["files"].items()
        # They are about compiling, which does not happen here: see test_compiled_cache.
        if (file["missing_lines"] or file["missing_branches"])
        and Path(name).stem not in {"compiled", "call"}
    }
    assert missing == {}
    assert {Path(name).name for name in found["files"]} >= {"tick.py", "operator.py", "rollout.py"}
