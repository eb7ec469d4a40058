"""The paper's robot is one file: the clone, an editable install, sdist and wheel all find it."""

import os
import sys
import tarfile
import zipfile
from importlib import resources
from pathlib import Path

import pytest
from bounded import finished
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).resolve().parents[2]
CLONE = ROOT / "urdf" / "two_link.urdf"
INSIDE = "fpid_pin/arms/data/two_link.urdf"


def built(builder, root, folder):
    (path,) = builder(str(root)).build(directory=str(folder), versions=["standard"])
    return Path(path)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return built(WheelBuilder, ROOT, tmp_path_factory.mktemp("wheel"))


def unpacked(path, folder):
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
        assert len(set(names)) == len(names)
        wheel.extractall(folder)
    return folder


def test_the_package_reads_the_clone_s_file():
    file = resources.files("fpid_pin.arms") / "data" / "two_link.urdf"
    assert file.read_bytes() == CLONE.read_bytes()
    assert Path(str(file)).resolve() == CLONE.resolve()


def test_an_unpacked_wheel_holds_what_the_arm_and_the_command_need(wheel, tmp_path):
    site = unpacked(wheel, tmp_path / "site")
    assert (site / INSIDE).read_bytes() == CLONE.read_bytes()
    (entry,) = site.rglob("entry_points.txt")
    assert "fpid-pin = fpid_pin.cli.main:program" in entry.read_text()
    code = "import fpid_pin.arms as a; print(a.__file__); print(a.Arm.two_link())"
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = finished([sys.executable, "-c", code], cwd=tmp_path, env=environment, check=True)
    where, arm = done.stdout.splitlines()
    assert Path(where).is_relative_to(site)
    assert arm == "<Arm two_link, 2 joints>"


def test_the_sdist_holds_the_file_and_builds_the_same_wheel(wheel, tmp_path):
    path = built(SdistBuilder, ROOT, tmp_path)
    with tarfile.open(path) as sdist:
        sdist.extractall(tmp_path / "unpacked", filter="data")
    (root,) = (tmp_path / "unpacked").iterdir()
    assert (root / "urdf/two_link.urdf").read_bytes() == CLONE.read_bytes()
    assert (root / INSIDE).read_bytes() == CLONE.read_bytes()
    ours, theirs = (
        {f.relative_to(folder): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
        for folder in (
            unpacked(wheel, tmp_path / "ours"),
            unpacked(built(WheelBuilder, root, tmp_path), tmp_path / "theirs"),
        )
    )
    assert ours == theirs
