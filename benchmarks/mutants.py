"""Which small faults in kernels, operators and laws does no test notice?

A mutant has one fault in one function: an operator exchanged, a number a tenth or one off, a
condition negated, a `not` or an assignment to a field left out. A seeded sample of each room meets,
in a copy of this clone, the tests through its line, then (compiled lines are not seen) those named
after its file, then all through its file, until one fails or they have had their time. An hour.
"""

import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Iterator
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from common import Bench, run
from coverage import CoverageData

ROOT = Path(__file__).parents[1]
#: Mutants of each room; how long the tests of one take at most when nothing is wrong [s].
COUNTS, SECONDS = {"kernels": 70, "fractional": 60, "control": 60}, 25.0
PAIRS = ("+ -", "* /", "< <=", "> >=", "+= -=", "and or", "min max", "minimum maximum")
SWAPS = {a: b for pair in map(str.split, PAIRS) for a, b in (pair, pair[::-1])}
SWAPS |= {"not": "", "if": "if not", "while": "while not"}
PYTEST = ["-m", "pytest", "-q", "-p", "no:cacheprovider"]

Fault = tuple[Path, int, int, int, str]  # file, line, columns from and to, what is there instead


def faults(path: Path) -> Iterator[Fault]:
    functions = [f for f in ast.walk(ast.parse(path.read_text())) if isinstance(f, ast.FunctionDef)]
    within = {line for f in functions for line in range(f.body[0].lineno, f.end_lineno + 1)}
    lines, last = path.read_text().splitlines(keepends=True), ""
    for kind, old, (line, begin), (_, end), _ in tokenize.generate_tokens(iter(lines).__next__):
        new = SWAPS.get(old)
        if kind == tokenize.NUMBER and "j" not in old:
            new = str(int(old) + 1) if old.isdigit() else f"{1.1 * float(old) or 0.1:.15g}"
        unpacks = old == "*" and last in ("(", "[", "{", ",", "\n", "return")
        if new is not None and line in within and not unpacks:
            yield path, line, begin, end, new
        last = old
    nodes: Iterator[Any] = (node for f in functions for node in ast.walk(f))
    for node in nodes:
        stays = isinstance(node, ast.Assign) and not isinstance(node.targets[0], ast.Name)
        if (stays or isinstance(node, ast.AugAssign)) and node.lineno == node.end_lineno:
            yield path, node.lineno, node.col_offset, len(lines[node.lineno - 1]) - 1, "pass"


def plant(fault: Fault) -> str:
    """Write a fault into its file; return where and what it is."""
    path, line, begin, end, new = fault
    for kept in path.parent.glob(f"__pycache__/{path.stem}.*"):
        kept.unlink()
    lines = path.read_text().splitlines(keepends=True)
    whole = lines[line - 1]
    lines[line - 1] = whole[:begin] + new + whole[end:]
    path.write_text("".join(lines))
    what = f"{whole[:begin]}[{whole[begin:end]} -> {new}]{whole[end:]}".strip().replace("|", "\\|")
    return f"| {path.parent.name}/{path.name}:{line} | `{what}` |"


def outcome(tree: Path, fault: Fault, seconds: dict[str, float], data: CoverageData) -> str:
    visits = data.contexts_by_lineno(str(fault[0])).items()
    seen = {(line != fault[1], c.rpartition("|")[0]) for line, contexts in visits for c in contexts}
    own = f"/test_{fault[0].stem}.py::"
    order = sorted((away, own not in t, seconds[t], t) for away, t in seen if t in seconds)
    tests = list(dict.fromkeys(test for *_, test in order))
    spent = accumulate(seconds[test] for test in tests)
    tests = [test for test, sum_ in zip(tests, spent, strict=True) if sum_ <= SECONDS]
    if not tests:
        return "survived"
    words = [sys.executable, "-B", *PYTEST, "-x", *tests]  # bytecode knows no parts of a second
    try:
        done = subprocess.run(words, cwd=tree, stdout=subprocess.DEVNULL, timeout=6.0 * SECONDS)
    except subprocess.TimeoutExpired:
        return "timed out"
    return "killed" if done.returncode else "survived"


def room(bench: Bench, name: str) -> None:
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        tree, times, seen = (Path(scratch, part) for part in ("tree", "times", "seen"))
        shutil.copytree(ROOT, tree, symlinks=True, ignore=shutil.ignore_patterns(".*", "runs"))
        os.environ |= {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(Path(scratch, "numba"))}
        os.environ |= {"NUMBA_DISABLE_JIT": str(int(name == "kernels")), "COVERAGE_FILE": str(seen)}
        words = [f"--junitxml={times}", "--cov=fpid_pin", "--cov-context=test", "--cov-report="]
        words += [f"--cov-config={os.devnull}", f"tests/{name}"]
        words += ["-m", name] if name == "kernels" else []
        subprocess.run([sys.executable, *PYTEST, *words], cwd=tree)
        seconds = {}
        for case in ElementTree.parse(times).iter("testcase"):
            file, test, spent = (case.attrib[key] for key in ("classname", "name", "time"))
            if not len(case):  # passed
                seconds[f"{file.replace('.', '/')}.py::{test}"] = float(spent)
        data = CoverageData(str(seen))
        data.read()
        every = [f for p in sorted((tree / "fpid_pin" / name).glob("*.py")) for f in faults(p)]
        count, survivors = {"killed": 0, "survived": 0, "timed out": 0}, []
        for fault in random.Random(22).sample(every, 3 if bench.quick else COUNTS[name]):
            text = fault[0].read_text()
            row = plant(fault)
            result = outcome(tree, fault, seconds, data)
            fault[0].write_text(text)
            print(result, row, flush=True)
            count[result] += 1
            survivors += [row] * (result == "survived")
    bench.table(["room", "of", *count], [[f"`{name}`", f"{len(every):,}", *count.values()]])
    bench.details(f"Survivors in `{name}`")
    bench.say("| where | what |", "| --- | --- |", *survivors)


if __name__ == "__main__":
    run(__doc__, **{name: partial(room, name=name) for name in COUNTS})
