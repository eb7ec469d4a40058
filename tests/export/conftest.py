"""Compilers that may not be there."""

import shutil
import subprocess

import pytest

from fpid_pin.export import build


@pytest.fixture
def gcc():
    if build.compiler() is None:
        pytest.skip("no C compiler")


@pytest.fixture
def node():
    program = shutil.which("node")
    if program is None:
        pytest.skip("no node")

    def run(script, *arguments):
        done = subprocess.run(
            [program, str(script), *map(str, arguments)], capture_output=True, text=True,
            timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout

    return run
