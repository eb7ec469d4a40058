"""What the printer prints means the same, and what it cannot print it names by line."""

import ctypes
import math

import numpy as np
import pytest
from bounded import finished

from fpid_pin.exceptions import ExportError
from fpid_pin.export import c99, javascript
from fpid_pin.export.kinds import INT, REAL, Array, array_kind, words
from fpid_pin.export.printer import Program
from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.records import record_type

PAIR = record_type({"x": "", "y": ""}, {"count": ""})
BOUND = 3


@kernel
def mixed(pairs, table, x, k, out):
    """Use what the language of kernels has."""
    last = pairs[0]
    last.x, last.y = last.y, last.x
    a, b = x, 2.0 * x
    a, b = b, a - 1e-3
    total = 0
    for i in range(1, table.shape[0]):
        if i == k or (not x > 0.25 and i > 1):
            continue
        total += table[i, 0] / (i + 1)
        row = table[i]
        row[1] = -row[0] * -x + (a - (b - x)) - i / 2
    n = 0
    while n < BOUND and total < 100.0:
        total += min(max(x, -0.5), 0.5) - abs(x)
        n += 1
    last.count = 1 if total > x else n
    flag = total > 0.0
    for _ in range(min(last.count + 1, 3)):
        last.count = 0 if k & 2 else 1
        out[0] += math.sqrt(abs(total)) + (1.0 if flag else -1.0)
    if math.isfinite(x):
        out[1] = math.floor(x * 7.5) + (k + 5) % 3 + int(x * 9.9) + (-7) % 4 + (-7 + k) // 2
        out[1] += x**4 - (x + 3.0) ** -3 + math.copysign(2.0, x - 0.2)
    out[2] = helped(pairs, last.count)
    return total


@kernel
def helped(pairs, k):
    """Find a number in a record."""
    best = 0.0
    for p in range(pairs.size):
        c = pairs[p]
        best += c.x * (p + k) - c.y
    return best


KINDS = [
    array_kind("pair", np.zeros(2, PAIR), ()), Array(REAL, (4, 2)), REAL, INT, Array(REAL, (3,)),
]  # fmt: skip


def cases():
    """Return arguments of `mixed`."""
    rng = np.random.default_rng(5)
    for x in (0.1, 0.7, -0.3, math.nan, math.inf, -2.5):
        pairs = np.zeros(2, PAIR)
        pairs["x"], pairs["y"] = rng.normal(size=(2, 2))
        yield pairs, rng.normal(size=(4, 2)), x, int(rng.integers(0, 4)), np.zeros(3)


def outcomes(function):
    """Return what a function returns for each case, and leaves in its arrays."""
    found = []
    for pairs, table, x, k, out in cases():
        with np.errstate(all="ignore"):
            result = function(pairs, table, x, k, out)
        found += [words(pairs), table.ravel(), out, [result]]
    return np.concatenate(found)


@pytest.mark.usefixtures("gcc")
def test_c_means_what_python_means(tmp_path):
    language = c99.C99()
    program = Program(language)
    name = program.add(mixed, KINDS).name
    source, library = tmp_path / "mixed.c", str(tmp_path / "mixed.so")
    source.write_text(
        "#include <tgmath.h>\ntypedef double real_t;\n"
        + c99.helpers(program.text) + language.structs([KINDS[0].element]) + program.text
        + "double run(fpid_pair *, double *, double, int, double *);\n"
        + "double run(fpid_pair *p, double *t, double x, int k, double *o)\n"
        + f"{{ return {name}(p, t, x, k, o); }}\n"
    )  # fmt: skip
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    finished(["gcc", *flags, "-shared", "-fPIC", str(source), "-o", library, "-lm"], check=True)
    run = ctypes.CDLL(library).run
    array, real = np.ctypeslib.ndpointer(), ctypes.c_double
    run.argtypes, run.restype = [array, array, real, ctypes.c_int, array], real
    assert np.array_equal(outcomes(run), outcomes(mixed), equal_nan=True)


def test_javascript_means_what_python_means(node, tmp_path):
    program = Program(javascript.JavaScript())
    name = program.add(mixed, KINDS).name
    lines = [
        "const M = new Float64Array(32); const all = []; let r;", javascript.HELPERS, program.text,
    ]  # fmt: skip
    for pairs, table, x, k, out in cases():
        x = str(x).replace("inf", "Infinity").replace("nan", "NaN")
        lines.append(f"M.set({[*map(float, (*words(pairs), *table.ravel(), *out))]});")
        lines.append(f"r = {name}(0, 6, {x}, {k}, 14); all.push(...M.slice(0, 17), r);")
    lines.append("process.stdout.write(all.map(String).join(' '));")
    path = tmp_path / "mixed.js"
    path.write_text("\n".join(lines))
    found = np.array([float(word.replace("Infinity", "inf")) for word in node(path).split()])
    assert np.array_equal(found, outcomes(mixed), equal_nan=True)


#: A function's lines; which of them is at fault, and what is said of it.
REFUSED = [
    (1, "range", "for value in x:", "    x[0] += value"),
    (1, "<<", "x[0] = 1 << 2"),
    (1, "List", "y = [x[0]]", "x[1] = y[0]"),
    (1, r"np\.sin", "x[0] = np.sin(x[1])"),
    (1, "generator|recursion|expected|takes", "x[0] = cases(x[1])"),
    (2, "recursion", "x[0] -= 1.0", "f(x)"),
    (1, "0.0 < x", "if 0.0 < x[0] < 1.0:", "    x[1] = 0.0"),
    (3, "Break", "for i in range(3):", "    if x[i] > 0.0:", "        break"),
    (1, "nowhere", "x[0] = nowhere"),
    (1, "integer", "x[x[0]] = 1.0"),
    (2, "is first", "y = x", "y = 1.0", "x[0] = y"),
    (1, "return", "return"),
    (1, "range", "for i in range(0, 3, 2):", "    x[i] = 0.0"),
    (1, "slice", "x[0] = x[0:3:2][0]"),
]


@pytest.mark.parametrize("language", [c99.C99(), javascript.JavaScript()], ids=["c", "js"])
@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case[2])
def test_what_is_outside_the_subset_is_refused_with_file_and_line(case, language, tmp_path):
    (line, what, *lines), path = case, tmp_path / "refused.py"
    path.write_text("\n    ".join(["def f(x):", *lines]))
    names = {"__name__": "refused", "np": np, "cases": cases}
    exec(compile(path.read_text(), str(path), "exec"), names)
    with pytest.raises(ExportError, match=what) as caught:
        Program(language).add(names["f"], [Array(REAL, (3,))])
    assert "\n" not in str(caught.value)
    assert f"refused.py:{1 + line}: " in str(caught.value)


def test_a_kernel_that_is_none_or_has_no_text_is_refused():
    with pytest.raises(ExportError, match="expected a kernel, got int"):
        Program(c99.C99()).add(3, [])
    typed_in: dict = {}
    exec("def f(x):\n    x[0] = 1.0", typed_in)
    with pytest.raises(ExportError, match="expected a kernel in a file"):
        Program(c99.C99()).add(typed_in["f"], [Array(REAL, (3,))])
    with pytest.raises(ExportError, match="takes 5 arguments, given 1"):
        Program(c99.C99()).add(mixed, [INT])
