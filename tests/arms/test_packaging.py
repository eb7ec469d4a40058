"""The paper's robot is one file: the clone, an editable install, sdist and wheel all find it."""

import os
import re
import sys
import tarfile
import zipfile
from importlib import resources
from pathlib import Path

from bounded import finished
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).resolve().parents[2]
CLONE = ROOT / "urdf" / "two_link.urdf"
INSIDE = "fpid_pin/arms/data/two_link.urdf"


def built(builder, root, folder):
    (path,) = builder(str(root)).build(directory=str(folder), versions=["standard"])
    return Path(path)


def wheel_text(path):
    with zipfile.ZipFile(path) as wheel:
        assert wheel.namelist().count(INSIDE) == 1
        return wheel.read(INSIDE)


def test_the_package_reads_the_clone_s_file():
    file = resources.files("fpid_pin.arms") / "data" / "two_link.urdf"
    assert file.read_bytes() == CLONE.read_bytes()
    assert Path(str(file)).resolve() == CLONE.resolve()


def test_the_wheel_holds_the_file(tmp_path):
    assert wheel_text(built(WheelBuilder, ROOT, tmp_path)) == CLONE.read_bytes()


def test_the_wheel_holds_what_the_command_starts_with(tmp_path):
    with zipfile.ZipFile(built(WheelBuilder, ROOT, tmp_path)) as wheel:
        assert "fpid_pin_start.py" in wheel.namelist()
        entry = next(name for name in wheel.namelist() if name.endswith("entry_points.txt"))
        assert "fpid-pin = fpid_pin_start:main" in wheel.read(entry).decode()


def test_the_sdist_holds_the_file_and_builds_the_same_wheel(tmp_path):
    path = built(SdistBuilder, ROOT, tmp_path)
    with tarfile.open(path) as sdist:
        names = [re.sub(r"^[^/]+/", "", name) for name in sdist.getnames()]
        assert "urdf/two_link.urdf" in names
        assert any(name.startswith("fpid_pin/arms/data") for name in names)
        sdist.extractall(tmp_path / "unpacked", filter="data")
    (root,) = (tmp_path / "unpacked").iterdir()
    assert (root / "urdf/two_link.urdf").read_bytes() == CLONE.read_bytes()
    assert (root / INSIDE).read_bytes() == CLONE.read_bytes()
    assert wheel_text(built(WheelBuilder, root, tmp_path)) == CLONE.read_bytes()


def test_the_arm_is_built_from_an_unpacked_wheel(tmp_path):
    with zipfile.ZipFile(built(WheelBuilder, ROOT, tmp_path)) as wheel:
        wheel.extractall(tmp_path / "site")
    code = "import fpid_pin.arms as a; print(a.__file__); print(a.Arm.two_link())"
    done = finished(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
        check=True,
    )
    where, arm = done.stdout.splitlines()
    assert Path(where).is_relative_to(tmp_path / "site")
    assert arm == "<Arm two_link, 2 joints>"
