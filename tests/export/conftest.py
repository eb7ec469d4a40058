"""Compilers that may not be there."""

import shutil

import pytest
from bounded import finished

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
        done = finished([program, str(script), *map(str, arguments)], timeout=250)
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout

    return run
