"""`export_c`: what is in the folder, what it says, and what is refused."""

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
        program = build.compile_check(folder, tmp_path / what, flags)
        found, state = build.check(program, folder / "vectors.bin").split("; a state takes ")
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
def test_cmake_builds_both_precisions_and_ctest_passes(tmp_path, monkeypatch):
    """And without a compiler the README says that nothing was measured."""
    if shutil.which("cmake") is None:
        pytest.skip("no cmake")
    monkeypatch.setattr(build, "compiler", lambda: None)
    folder = fp.export_c(law(), ARM, 1e-3, tmp_path / "c", ticks=300)
    text = (folder / "README.md").read_text()
    assert "Not measured here" in text
    assert "**not advised** here: the horizon is 3,600,000 steps" in text
    for flags in ([], ["-DFPID_SINGLE=ON"]):
        built = str(tmp_path / f"build{len(flags)}")
        for command in (
            ["cmake", "-S", str(folder), "-B", built, *flags],
            ["cmake", "--build", built, "--parallel", "2"],
            ["ctest", "--test-dir", built, "--output-on-failure"],
        ):
            done = finished(command)
            assert done.returncode == 0, done.stdout + done.stderr
            assert "warning" not in done.stdout + done.stderr
        assert "100% tests passed" in done.stdout
    assert finished([f"{built}/fpid_example"]).returncode == 0


BOTH = """
#include <stdio.h>
#include "fpid.h"
static fpid_state state, saved;
static void tick(fpid_state *s, int k, int shown) {
    fpid_input in = {{0}, {0}, {0}, {0}, {0}};
    fpid_output out = {{0}};
    for (int j = 0; j < FPID_JOINTS; ++j) { in.q[j] = 0.001 * (k % 100 + j); in.v[j] = 0.1; }
    int status = fpid_step(s, &in, &out);
    if (shown) printf("%d %a %a\\n", status, out.torque[0], out.torque[1]);
}
int main(int argc, char **argv) {
    FILE *file;
    fpid_reset(&state);
    if (argc > 2) {
        file = fopen(argv[2], "rb");
        if (fread(&saved, sizeof saved, 1, file) != 1) return 9;
        fclose(file);
        if (fpid_restore(&state, &saved) != FPID_OK) return 1;
    } else {
        for (int k = 0; k < 700; ++k) tick(&state, k, 0);
        file = fopen(argv[1], "wb"); fwrite(&state, sizeof state, 1, file); fclose(file);
    }
    for (int k = 700; k < 800; ++k) tick(&state, k, 1);
    fpid_input bad = {{0.0 / 0.0}, {0}, {0}, {0}, {0}};
    fpid_output out = {{7.0, 7.0}};
    saved = state;
    printf("bad %d %g %d\\n", fpid_step(&state, &bad, &out), out.torque[0],
           __builtin_memcmp(&saved, &state, sizeof state));
    state.joints[0].kp = 0.0 / 0.0;
    tick(&state, 800, 1);
    return 0;
}
"""


@pytest.mark.usefixtures("gcc")
def test_a_restart_from_a_saved_state_has_no_bump(tmp_path, monkeypatch):
    compiler = build.compiler()
    monkeypatch.setattr(build, "compiler", lambda: None)
    for name, controller in (("one", law()), ("other", law(k1=3.0))):
        folder = fp.export_c(controller, ARM, 1e-3, tmp_path / name, ticks=5)
        (folder / "both.c").write_text(BOTH)
        sources = [str(folder / f"{n}.c") for n in ("both", "fpid", "fpid_parameters")]
        command = [compiler, "-std=gnu99", "-O2", "-ffp-contract=off", *sources]
        finished([*command, "-o", str(tmp_path / f"run_{name}"), "-lm"], check=True)

    def run(name, *paths):
        command = [str(tmp_path / f"run_{name}"), *map(str, paths)]
        return finished(command)

    went_on = run("one", tmp_path / "state")
    restarted = run("one", "-", tmp_path / "state")
    assert restarted.returncode == 0
    assert restarted.stdout == went_on.stdout
    lines = went_on.stdout.splitlines()
    assert len(lines) == 102
    assert {line.split()[0] for line in lines[:100]} == {"0"}
    assert lines[100] == "bad 1 7 0", "state and output are as before"
    assert lines[101].startswith(("2 nan", "2 -nan")), "a torque that is none is told"
    assert run("other", "-", tmp_path / "state").returncode == 1, "another export's state"


def refused(match, controller, arm=ARM, error=ExportError, **others):
    def check(tmp_path):
        with pytest.raises(error, match=match) as caught:
            fp.export_c(controller, arm, 1e-3, tmp_path / "c", **others)
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []

    return check


def many(n):
    return fp.Arm.planar(lengths=[0.1] * n, masses=[0.1] * n)


@pytest.mark.parametrize(
    "check",
    [
        refused("PythonPd: expected a law by its functions", PythonPd(1.0, 1.0)),
        refused(r"test_export_folder.py:\d+: torque: cannot be printed: -1.0 < c.e", Unprintable()),
        refused("expected at most 32 joints, got 33", law(), many(33)),
        refused("expected one with modes", law(design=fp.fractional.L1()), error=fp.FpidError),
        refused("expected a controller", 3, error=fp.FpidError),
        refused("horizon: expected more than one step", law(), error=fp.FpidError, horizon=1e-4),
        refused(r"ticks: expected a whole number in \[1, 1e\+06\], got 10", law(),
                error=fp.FpidError, ticks=10**12),
        refused(
            "give an experiment", law(observer=50.0, supervisor=fp.Supervisor(
                1.02, 1.0, kind="paper", disturbance_bound=0.5)), horizon=10.0,
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_refused_in_one_line(check, tmp_path):
    check(tmp_path)


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
    assert main(command) == 2
    assert "expected a new folder" in capsys.readouterr().err
    assert main(["export", str(config), "--out", str(tmp_path / "d")]) == 2
    assert (
        "expected one controller, or --controller NAME, got 'mine', 'PID'"
        in capsys.readouterr().err
    )
    assert main([*command[:3], "none", "--out", str(tmp_path / "d")]) == 2
    assert "--controller" in capsys.readouterr().err
    assert main([*command[:3], "PID", "--out", str(tmp_path / "d")]) == 0


@pytest.mark.usefixtures("gcc")
def test_the_loop_closed_around_the_library_is_the_simulation(tmp_path):
    script = Path(__file__).parents[2] / "examples" / "c_loop" / "close_the_loop.py"
    done = finished([sys.executable, str(script)], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "differ from the simulation by 0 rad" in done.stdout
