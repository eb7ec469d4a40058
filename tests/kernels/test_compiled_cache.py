"""The cache of compiled kernels: never stale, never in the way."""

import os
import shutil
import sys
from pathlib import Path

import pytest
from bounded import finished

import fpid_pin
from fpid_pin.kernels import compiled

QUIET = {"PYTHONDONTWRITEBYTECODE": "1"}
PACKAGE = Path(fpid_pin.__file__).parent


def copy_of_the_room(tmp_path):
    """Return a folder with kernels/ alone: it needs no other room."""
    root = tmp_path / "site"
    shutil.copytree(
        PACKAGE / "kernels", root / "fpid_pin" / "kernels",
        ignore=shutil.ignore_patterns("__pycache__"),
    )  # fmt: skip
    (root / "fpid_pin" / "__init__.py").write_text("")
    return root


def run(root, code, **environment):
    """Run a script on a copy, in a process of its own, and return what it prints."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")}
    done = finished(
        [sys.executable, "-W", "error", "-c", code],
        cwd=root,
        env=inherited | {"PYTHONPATH": str(root)} | environment,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


CLIPPED = """
import numpy as np
from fpid_pin.kernels import compiled, plant
from fpid_pin.kernels.records import PLANT
joints = np.zeros(1, PLANT)
joints["limit"] = 5.0
motion, zero = np.zeros((3, 1, 1)), np.zeros(1)
plant.apply_actuators(joints, zero, zero, np.full(1, 9.0), np.zeros((1, 1, 1)), motion, 0, zero)
hits = sum(plant.apply_actuators.stats.cache_hits.values())
print(motion[2, 0, 0], compiled.CACHE is None, hits)
"""


def test_a_kept_build_is_taken_and_one_that_is_stale_or_damaged_is_not(tmp_path):
    root = copy_of_the_room(tmp_path)
    assert run(root, CLIPPED) == "5.0 False 0"
    assert run(root, CLIPPED) == "5.0 False 1"
    functions = root / "fpid_pin" / "kernels" / "functions.py"
    for path in (functions.parent / "__pycache__").rglob("*.nb?"):
        path.write_bytes(path.read_bytes()[:100])
    assert run(root, CLIPPED) == "5.0 False 0"
    # An edit reaches callers in other files, and nothing is left of what was before it.
    text = functions.read_text()
    assert text.count("x = limit\n") == 1
    functions.write_text(text.replace("x = limit\n", "x = limit + 1.0\n"))
    assert run(root, CLIPPED) == "6.0 False 0"
    assert len(list((functions.parent / "__pycache__").glob("kernels-*"))) == 1


def test_where_the_package_cannot_be_written_the_user_s_cache_serves_or_none_is_needed(tmp_path):
    root = copy_of_the_room(tmp_path)
    # A file where the folder would be stops root too, whom permissions do not.
    (root / "fpid_pin" / "kernels" / "__pycache__").write_text("")
    home = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert run(root, CLIPPED, **home, **QUIET) == "5.0 False 0"
    assert list((tmp_path / "cache" / "fpid_pin").rglob("*.nbi"))
    nowhere = {"XDG_CACHE_HOME": "/dev/null/cache", "HOME": "/dev/null"}
    assert run(root, CLIPPED, **nowhere, **QUIET) == "5.0 True 0"


def test_a_cache_that_cannot_hold_anything_costs_time_only(tmp_path):
    root = copy_of_the_room(tmp_path)
    full = (
        "import resource, signal\n"
        "import numba, numpy\n"  # whose own files are written before the disk is full
        "import fpid_pin.kernels.compiled\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))\n"
    )
    assert run(root, full + CLIPPED, **QUIET) == "5.0 False 0"


@pytest.mark.kernels
def test_a_kernel_is_the_function_that_it_was(monkeypatch, tmp_path):
    def double(x):
        return 2.0 * x

    def twice_double(x):
        return double(double(x))

    assert compiled.kernel(double)(3.0) == 6.0
    assert compiled.kernel(twice_double)(3.0) == 12.0
    monkeypatch.setattr(compiled, "CACHE", None)
    assert compiled.kernel(double, inline=True)(3.0) == 6.0
    assert compiled.is_cold()
    monkeypatch.setattr(compiled, "CACHE", tmp_path)
    assert compiled.is_cold()
    (tmp_path / "one.nbi").write_text("")
    assert not compiled.is_cold()


def test_a_function_that_was_typed_in_is_compiled_all_the_same():
    """It stands in no file, so nothing says when a kept build of it would be stale."""
    room = {}
    exec("def twice(x):\n    return 2.0 * x\n", room)
    assert compiled.kernel(room["twice"])(1.5) == 3.0


def test_kernels_have_no_vector_loops_and_a_users_functions_keep_theirs(tmp_path):
    code = """if True:
        import numba, numpy as np
        from fpid_pin.kernels.compiled import kernel

        def scale(x, factor):
            for i in range(x.size):
                x[i] *= factor

        ours, theirs = kernel(scale), numba.njit(scale, error_model="numpy")
        for function in (ours, theirs):
            function(np.ones(3), 2.0)
            text = next(iter(function.inspect_llvm().values()))
            print("vector.body" in text, numba.config.LOOP_VECTORIZE)
    """
    assert run(copy_of_the_room(tmp_path), code).split() == ["False", "1", "True", "1"]
