"""A law as C99: the files, and the check that they do what Python does, to the last bit."""

import shutil
import subprocess

import fpid_pin as fp

arm = fp.Arm.from_example("ur5")
law = fp.suggest_gains(arm, feedforward=True, observer="suggested")
folder = fp.export_c(law, arm, 1e-3, "ur5_c", horizon=60.0)
print(sorted(path.name for path in folder.iterdir()))
if shutil.which("cc"):
    command = "cc -std=c99 -O2 -ffp-contract=off fpid.c fpid_parameters.c fpid_check.c -lm -o check"
    subprocess.run(command.split(), cwd=folder, check=True)
    done = subprocess.run(["./check", "vectors.bin"], cwd=folder, capture_output=True, text=True)
    print(done.stdout.strip())
