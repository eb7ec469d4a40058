"""Compiles an exported folder where there is a compiler, and asks it what it does."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from fpid_pin.exceptions import ExportError

#: How the suite and `export_c` compile: what a careful project would ask for.
FLAGS = (
    "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Werror",
    "-ffp-contract=off", "-O2",
)  # fmt: skip
_SECONDS = 300
_ANSWER = re.compile(
    r"ticks (\d+) equal (\d+) of (\d+) difference (\S+) peak (\S+) N m state (\d+) bytes"
)


class Comparison(NamedTuple):
    """What ``fpid_check`` found: ticks, equal numbers of all, largest difference, peak, bytes."""

    ticks: int
    equal: int
    total: int
    difference: float
    peak: float
    state: int


def compiler() -> str | None:
    """Return a C compiler that knows gcc's flags; None: there is none."""
    return next((found for name in ("gcc", "clang", "cc") if (found := shutil.which(name))), None)


def compile_check(folder: Path, to: Path, flags: Sequence[str] = ()) -> Path:
    """Compile an exported folder and its check to the program `to`.

    Raises
    ------
    ExportError
        The compiler's first complaint.
    """
    names = ("fpid.c", "fpid_parameters.c", "fpid_check.c")
    sources = [str(folder / name) for name in names]
    command = [compiler() or "cc", *FLAGS, *flags, *sources, "-o", str(to), "-lm"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ExportError(f"{command[0]}: cannot compile ({type(error).__name__})") from None
    if done.returncode:
        complaint = next((line for line in done.stderr.splitlines() if "error" in line), "failed")
        raise ExportError(f"{Path(command[0]).name}: {complaint.replace(str(folder), folder.name)}")
    return to


def compare(program: Path, vectors: Path, torques: Path | None = None) -> Comparison:
    """Run ``fpid_check``; `torques` receives the program's own, as doubles.

    Raises
    ------
    ExportError
        It does not get through the vectors.
    """
    command = [str(program), str(vectors), *([str(torques)] if torques else [])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=False)
    found = _ANSWER.search(done.stdout)
    if found is None or "returned" in done.stderr:
        raise ExportError(f"fpid_check: {(done.stderr or done.stdout).strip()[:200]}")
    ticks, equal, total, difference, peak, state = found.groups()
    return Comparison(
        int(ticks), int(equal), int(total), float(difference), float(peak), int(state)
    )


def sizes(folder: Path, flags: Sequence[str] = ()) -> tuple[str, str]:
    """Return the bytes of code and of constants at -Os here; a dash where nobody knows them."""
    tool, found = shutil.which("size"), []
    for name in ("fpid", "fpid_parameters"):
        with tempfile.TemporaryDirectory() as there:
            target = str(Path(there) / "fpid.o")
            own = [flag for flag in FLAGS if flag != "-O2"]
            source = str(folder / f"{name}.c")
            command = [compiler() or "cc", *own, *flags, "-Os", "-c", source, "-o", target]
            done = subprocess.run(command, capture_output=True, check=False, timeout=_SECONDS)
            if tool is None or done.returncode:
                found.append("–")
                continue
            listed = subprocess.run([tool, target], capture_output=True, text=True, check=True)
        found.append(listed.stdout.split("\n")[1].split()[0])
    return found[0], found[1]
