"""Run a command again and again, the disk failing at one write after another; a JSON line each.

Run with `fault.c` loaded: ``LD_PRELOAD=fault.so python faults.py FOLDER WHAT EVERY``.
"""

import contextlib
import ctypes
import errno
import hashlib
import io
import itertools
import json
import os
import re
import shutil
import sys
import warnings
from pathlib import Path

import fpid_pin as fp
from fpid_pin.cli.main import main
from fpid_pin.cli.output import output_folder
from fpid_pin.exceptions import FpidError

# On a full disk every write fails from then on, while another error may pass.
ERRORS = ((errno.ENOSPC, 1), (errno.EIO, 0), (errno.EROFS, 1))
LAW = fp.paper_controller()
OLD = re.compile(r"\.fpid_pin-[0-9a-f]{12}\.old")


def save(folder):
    run = fp.Run.load(folder.parent / "run.npz")
    return lambda: run.save(folder / "run.npz")


def results(folder):
    def put():
        with output_folder(folder / "out") as inside:
            for name in ("a", "b"):
                (inside / name).write_text(name * 20_000)

    return put


def search(folder):
    from fpid_pin.tuning import SearchSettings, Space, tune

    settings = SearchSettings(
        population=4, generations=3, checkpoint=folder / "search.npz", resume=True
    )
    space, experiment = Space(kp=(1, 100)), fp.paper_experiment(duration=0.05)
    return lambda: tune(experiment, LAW, space, settings=settings)


#: What is run, from the folder above the disk; # is another number each time.
COMMANDS = {
    "run": ("run", "short.toml", "--controller", "integer PID", "--out", "disk/out"),
    "compare": ("compare", "short.toml", "--out", "disk/out"),
    "tune": ("tune", "short.toml", "--out", "disk/out"),
    "view": ("view", "run.npz", "--html", "disk/page.html"),
    "operators": ("operators", "--order", "0.5", "--plot", "disk/plot.png"),
    "playground": ("playground", "short.toml", "--html", "disk/playground.html"),
    # An export never takes an older one's place: each has a folder of its own.
    "export": (
        "export", "short.toml", "--controller", "integer PID", "--ticks", "5", "--out", "disk/c#"
    ),
}  # fmt: skip


class Refused(Exception):
    """What a command said on standard error, all lines of it."""


def command(words):
    rounds = itertools.count()

    def run():
        own = str(next(rounds))
        if main([word.replace("#", own) for word in words]):
            raise Refused(sys.stderr.getvalue())

    return lambda folder: run


WORK = {"Run.save": save, "output_folder": results, "tune()": search}
WORK |= {name: command(words) for name, words in COMMANDS.items()}


def contents(folder):
    """Return what is in a folder: names and what they hold.

    Where the disk fails between two renames, older results are under a hidden name, from which the
    next command brings them back.
    """
    return {
        OLD.sub("out", str(path.relative_to(folder))): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*") if path.is_file()
    }  # fmt: skip


def attempt(work):
    """Return what a piece of work ended with: "", one line, or a fault."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                work()
        except (FpidError, Refused) as error:
            lines = [line for line in str(error).splitlines() if " of " not in line[:28]]
            return "refused" if len(lines) == 1 and "Traceback" not in lines[0] else str(error)
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return ""


def main_loop(root, what, every):
    os.chdir(root)
    library = ctypes.CDLL(None)
    folder = root / "disk"
    for code, stay in ERRORS:
        at, done = 0, False
        while not done:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            work = WORK[what](folder)
            library.fault_arm(str(folder).encode(), ctypes.c_long(1 << 40), 0, 0)
            if what != "tune()":
                assert attempt(work) == ""  # the older results
            before = contents(folder)
            library.fault_arm(str(folder).encode(), ctypes.c_long(at), code, stay)
            told = attempt(work)
            seen = library.fault_seen()
            library.fault_arm(b"", ctypes.c_long(-1), 0, 0)
            after = contents(folder)
            fault = "" if told in ("", "refused") else told
            done = seen <= at
            checkpoints = {name for name in after if name.endswith("checkpoint.npz")}
            if told == "refused" and what != "tune()":
                # A search's own checkpoint is what it goes on from.
                extra = after.keys() - before.keys() - checkpoints
                changed = {name for name in before if after.get(name) != before[name]}
                if extra or changed:
                    fault = f"left {sorted(extra)}, changed {sorted(changed)}"
            hidden = [name for name in after if ".fpid_pin-" in name]
            if hidden:
                fault = f"left {hidden}"
            if what == "tune()" and told == "refused" and attempt(work):
                fault = "could not go on afterwards"
            sys.stdout.write(json.dumps([what, errno.errorcode[code], at, told, fault]) + "\n")
            sys.stdout.flush()
            at += every


if __name__ == "__main__":
    main_loop(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
