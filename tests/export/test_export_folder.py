"""`export_c`: what is in the folder, what it says, and what is refused."""

import ctypes
import shutil
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from bounded import finished
from numpy.typing import ArrayLike
from own_laws import PythonPd

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ExportError, FileFormatError
from fpid_pin.export import build
from fpid_pin.export.folder import Vectors, answers

ARM = fp.Arm.two_link()
FILES = {
    "fpid.h", "fpid.c", "fpid_parameters.c", "example.c", "fpid_check.c", "vectors.bin",
    "CMakeLists.txt", "README.md", "controller.toml",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Unprintable(fp.Controller):
    kp: ArrayLike = 1.0

    @staticmethod
    def torque(c):
        return c.kp * c.e if -1.0 < c.e < 1.0 else 0.0


def read(path):
    """Return what vectors.bin holds: inputs, (ticks, 5, n), and torques, (ticks, n)."""
    data = path.read_bytes()
    n, ticks = np.frombuffer(data[8:16], "<i4")
    rows = np.frombuffer(data[16:], "<f8").reshape(ticks, 6, n)
    assert data[:8] == b"FPIDVEC1"
    return Vectors(rows[:, :5].copy(), rows[:, 5])


def law(**others):
    return fp.AdaptiveFpid(
        kp=20.0, ki=10.0, kd=5.0, integral_order=0.9, derivative_order=0.9, **others
    )


@pytest.mark.usefixtures("gcc")
def test_the_folder_says_what_it_holds_and_rebuilds_its_controller(tmp_path):
    controller = law(order_learning_rate=0.01)
    folder = fp.export_c(controller, ARM, 1e-3, tmp_path / "new" / "c", horizon=30.0, ticks=300)
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["c"]
    text = (folder / "README.md").read_text()
    assert "`double`: 600 of 600 torques equal to the last bit" in text
    assert "may do here" in text
    for what, flags in (("double", []), ("float", ["-DFPID_SINGLE"])):
        found, state = build.check(folder, flags).split("; a state takes ")
        assert f"- `{what}`: {found}." in text
        assert f"| {what} | {state.split()[0]} |" in text
    table = tomllib.loads((folder / "controller.toml").read_text())
    again = descriptions.from_dict(table["controller"][0], fp.Controller)
    arm = descriptions.from_dict(table["arm"], fp.Arm)
    assert table["simulation"]["step"] == 1e-3
    proof = read(folder / "vectors.bin")
    found = answers(again, arm, 1e-3, 30.0, proof.inputs)
    assert np.array_equal(found.torque, proof.torque)
    for name in FILES - {"vectors.bin"}:
        assert str(tmp_path) not in (folder / name).read_text(), "a path of this machine"


@pytest.mark.usefixtures("gcc")
def test_cmake_builds_both_precisions_ctest_passes_and_the_example_comes_to_its_target(
    tmp_path, monkeypatch
):
    """And without a compiler the README says that nothing was measured."""
    if shutil.which("cmake") is None:
        pytest.skip("no cmake")
    monkeypatch.setattr(build, "compiler", lambda: None)
    folder = fp.export_c(law(), ARM, 1e-3, tmp_path / "c", ticks=300)
    text = (folder / "README.md").read_text()
    assert "Not measured here" in text
    assert "**not advised** here: the horizon is 3,600,000 steps" in text
    strict = f"-DCMAKE_C_FLAGS={' '.join(build.FLAGS)}"
    for flags in ([], ["-DFPID_SINGLE=ON"]):
        built = str(tmp_path / f"build{len(flags)}")
        for command in (
            ["cmake", "-S", str(folder), "-B", built, strict, *flags],
            ["cmake", "--build", built, "--parallel", "2"],
            ["ctest", "--test-dir", built, "--output-on-failure"],
        ):
            done = finished(command)
            assert done.returncode == 0, done.stdout + done.stderr
            assert "warning" not in done.stdout + done.stderr
        assert "100% tests passed" in done.stdout
    said = finished([f"{built}/fpid_example"], check=True).stdout
    assert [abs(float(line.split()[4]) - 0.1) < 0.02 for line in said.splitlines()] == [True] * 2


def library(folder):
    """Return an export as a shared library."""
    sources = [str(folder / name) for name in ("fpid.c", "fpid_parameters.c")]
    flags, target = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"), folder / "fpid.so"
    finished([build.compiler(), *flags, *sources, "-o", str(target), "-lm"], check=True)
    return ctypes.CDLL(str(target))


def tick(lib, state, k):
    """Make a tick with angles that depend on its number; return status and torques, 7 at first."""
    given, torque = np.zeros((5, 2)), np.full(2, 7.0)
    given[0], given[1] = 1e-3 * (k % 100 + np.arange(2)), 0.1
    status = lib.fpid_step(state, *(ctypes.c_void_p(x.ctypes.data) for x in (given, torque)))
    return [status, *torque]


@pytest.mark.usefixtures("gcc")
def test_a_restart_from_a_saved_state_has_no_bump_and_what_is_bad_is_told(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(build, "compiler", lambda: None)
        folders = [
            fp.export_c(controller, ARM, 1e-3, tmp_path / f"k1-{controller.k1:g}", ticks=5)
            for controller in (law(k1=2.0), law(k1=3.0))
        ]
    one, other = map(library, folders)
    state, again = (ctypes.create_string_buffer(1 << 16) for _ in range(2))
    one.fpid_reset(state)
    begun = state.raw
    for k in range(700):
        tick(one, state, k)
    saved = ctypes.create_string_buffer(state.raw)
    assert other.fpid_restore(again, saved) == 3, "another export's state"
    assert one.fpid_restore(again, saved) == 0
    went_on = [tick(one, state, k) for k in range(700, 800)]
    assert {status for status, *_ in went_on} == {0}
    assert [tick(one, again, k) for k in range(700, 800)] == went_on
    before = state.raw
    assert tick(one, state, np.nan) == [1, 7.0, 7.0]
    assert state.raw == before, "as it was before a bad input"
    kp, nan = (np.float64(x).tobytes() for x in (20.0, np.nan))
    assert kp in begun
    bad = ctypes.create_string_buffer(begun.replace(kp, nan))
    status, torque, _ = tick(one, bad, 800)
    assert status == 2
    assert np.isnan(torque), "a torque that is none is told"


CHAOTIC = fp.Supervisor(1.02, 1.0, kind="paper", disturbance_bound=0.5)
MANY = fp.Arm.planar(lengths=[0.1] * 33, masses=[0.1] * 33)


@pytest.mark.parametrize(
    ("match", "controller", "others"),
    [
        ("PythonPd: expected a law by its functions", PythonPd(1.0, 1.0), {}),
        (r"test_export_folder.py:\d+: torque: cannot be printed: -1.0 < c.e", Unprintable(), {}),
        ("expected at most 32 joints, got 33", law(), {"arm": MANY}),
        ("expected one with modes", law(design=fp.fractional.L1()), {}),
        ("expected a Controller", 3, {}),
        ("horizon: expected more than one step", law(), {"horizon": 1e-4}),
        (r"ticks: expected a whole number in \[1, 1e\+06\], got 10", law(), {"ticks": 10**12}),
        ("give an experiment", law(observer=50.0, supervisor=CHAOTIC), {"horizon": 10.0}),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_line(match, controller, others, tmp_path):
    given = {"arm": ARM, "step": 1e-3, "folder": tmp_path / "c", **others}
    with pytest.raises(fp.FpidError, match=match) as caught:
        fp.export_c(controller, **given)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_exists_is_left_alone(tmp_path):
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "mine").write_text("mine")
    with pytest.raises(ExportError, match="c: expected a new folder, got one that exists"):
        fp.export_c(law(), ARM, 1e-3, tmp_path / "c")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileFormatError, match="cannot be written"):
        fp.export_c(law(), ARM, 1e-3, tmp_path / "file" / "c", ticks=2)
    assert (tmp_path / "c" / "mine").read_text() == "mine"


@pytest.mark.usefixtures("gcc")
def test_the_command_exports_and_keeps_the_configuration(tmp_path, capsys):
    config = tmp_path / "config.toml"
    experiment = fp.Experiment(ARM, fp.references.Sinusoid(), duration=1.0, step=0.002)
    written = fp.to_toml(experiment, {"mine": law(), "PID": fp.Pid(1.0, 1.0, 1.0)})
    config.write_text(written)
    out = tmp_path / "c"
    command = ["export", str(config), "--controller", "mine", "--horizon", "20", "--out", str(out)]
    assert main(command) == 0
    assert "fpid.h" in capsys.readouterr().out
    kept = (out / "controller.toml").read_text()
    assert kept.startswith("# Exported: controller 'mine', --horizon 20 --ticks 2000.")
    assert tomllib.loads(kept) == tomllib.loads(written)
    proof = read(out / "vectors.bin")
    run = fp.simulate(experiment, law())
    assert np.array_equal(proof.inputs[:, 0], run.q)
    assert main([*command[:3], "PID", "--out", str(tmp_path / "d")]) == 0


@pytest.mark.usefixtures("gcc")
def test_the_loop_closed_around_the_library_is_the_simulation(tmp_path):
    script = Path(__file__).parents[2] / "examples" / "c_loop" / "close_the_loop.py"
    done = finished([sys.executable, str(script)], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "differ from the simulation by 0 rad" in done.stdout
