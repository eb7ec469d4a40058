"""What the printer prints means the same, and what it cannot print it names by line."""

import inspect
import math
import re
from typing import NamedTuple

import numpy as np
import pytest
from bounded import finished

from fpid_pin.exceptions import ExportError
from fpid_pin.export import build, c99, javascript
from fpid_pin.export.kinds import INT, REAL, Array, array_kind, bundle
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
    array_kind("pair", np.zeros(2, PAIR), ()),
    Array(REAL, (4, 2)),
    REAL,
    INT,
    Array(REAL, (3,)),
]


def cases():
    rng = np.random.default_rng(5)
    for x in (0.1, 0.7, -0.3, math.nan, math.inf, -2.5):
        pairs = np.zeros(2, PAIR)
        pairs["x"], pairs["y"] = rng.normal(size=(2, 2))
        yield pairs, rng.normal(size=(4, 2)), x, int(rng.integers(0, 4)), np.zeros(3)


def flat(pairs, table, out, result):
    numbers = [[p.x, p.y, p.count] for p in pairs]
    return np.concatenate([np.ravel(numbers), table.ravel(), out, [result]])


def expected(case):
    pairs, table, x, k, out = (np.array(a) if isinstance(a, np.ndarray) else a for a in case)
    with np.errstate(all="ignore"):
        result = mixed(pairs, table, x, k, out)
    return flat(pairs, table, out, result)


def literal(value):
    value = float(value)
    return {"nan": "NAN", "inf": "INFINITY"}.get(repr(value), repr(value))


@pytest.mark.usefixtures("gcc")
def test_c_means_what_python_means(tmp_path):
    language = c99.C99()
    program = Program(language)
    name = program.add(mixed, KINDS).name
    blocks = []
    for pairs, table, x, k, _ in cases():
        both = ", ".join(f"{{{literal(p.x)}, {literal(p.y)}, 0}}" for p in pairs)
        numbers = ", ".join(map(literal, table.ravel()))
        blocks.append(
            f"{{ fpid_pair p[2] = {{{both}}}; double t[8] = {{{numbers}}}; double o[3] = {{0}};\n"
            f"double r = {name}(p, t, {literal(x)}, {k}, o);\n"
            "for (int i = 0; i < 2; ++i) { say(p[i].x); say(p[i].y); say(p[i].count); }\n"
            "for (int i = 0; i < 8; ++i) say(t[i]);\n"
            "for (int i = 0; i < 3; ++i) say(o[i]);\nsay(r); }\n"
        )
    source = tmp_path / "mixed.c"
    source.write_text(
        "#include <tgmath.h>\n#include <stdio.h>\ntypedef double real_t;\n"
        + c99.helpers(program.text) + language.structs([KINDS[0].element]) + program.text
        + "static void say(double x) { fwrite(&x, 8, 1, stdout); }\n"
        + f"int main(void) {{ {''.join(blocks)} return 0; }}\n"
    )  # fmt: skip
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    binary = str(tmp_path / "mixed")
    finished(["gcc", *flags, str(source), "-o", binary, "-lm"], check=True)
    found = np.frombuffer(finished([binary], check=True, text=False).stdout)
    assert np.array_equal(found, np.concatenate([expected(c) for c in cases()]), equal_nan=True)


def test_javascript_means_what_python_means(node, tmp_path):
    program = Program(javascript.JavaScript())
    name = program.add(mixed, KINDS).name
    lines = [
        "const M = new Float64Array(32); const all = []; let r;", javascript.HELPERS, program.text,
    ]  # fmt: skip
    for pairs, table, x, k, _ in cases():
        numbers = [*(v for p in pairs for v in (p.x, p.y, 0)), *table.ravel(), 0, 0, 0]
        x = str(x).replace("inf", "Infinity").replace("nan", "NaN")
        lines.append(f"M.set({[float(v) for v in numbers]});")
        lines.append(f"r = {name}(0, 6, {x}, {k}, 14); all.push(...M.slice(0, 17), r);")
    lines.append("process.stdout.write(all.map(String).join(' '));")
    path = tmp_path / "mixed.js"
    path.write_text("\n".join(lines))
    found = np.array([float(word.replace("Infinity", "inf")) for word in node(path).split()])
    assert np.array_equal(found, np.concatenate([expected(c) for c in cases()]), equal_nan=True)


def test_the_text_is_the_equations():
    from fpid_pin.kernels import functions, operator, records

    program = Program(c99.C99())
    program.add(functions.clip, [REAL, REAL])
    assert program.text.endswith(
        "static real_t clip(real_t x, real_t limit)\n{\n"
        "    if (isfinite(x)) {\n        if (x > limit) {\n            x = limit;\n"
        "        } else if (x < -limit) {\n            x = -limit;\n        }\n    }\n"
        "    return x;\n}\n"
    )
    poles = array_kind("pole", np.zeros(24, records.POLE))
    modes = array_kind("mode", np.zeros(24, records.MODE))
    operator_ = array_kind("operator", np.zeros(1, records.OPERATOR), ()).element
    kinds = [operator_, poles, modes]
    for language, line in (
        (c99.C99(), "mode->x = past + pole->b1 * rate + pole->b0 * rate_ + pole->b2 * m;"),
        (javascript.JavaScript(), "y += M[mode /* weight */] * past;"),
    ):
        program = Program(language)
        program.add(operator.derivative, [*kinds, *[REAL] * 5])
        text = re.sub(r" \+ 0 (?=/)", " ", program.text)
        assert line in text


def loops_over_an_array(x):
    for value in x:
        x[0] += value


def shifts_bits(x):
    x[0] = 1 << 2


def has_a_list(x):
    y = [x[0]]
    x[1] = y[0]


def calls_numpy(x):
    x[0] = np.sin(x[1])


def calls_no_kernel(x):
    x[0] = cases(x[1])


def calls_itself(x):
    x[0] -= 1.0
    calls_itself(x)


def chains(x):
    if 0.0 < x[0] < 1.0:
        x[1] = 0.0


def breaks_off(x):
    for i in range(3):
        if x[i] > 0.0:
            break


def knows_no_such_name(x):
    x[0] = nowhere  # noqa: F821


def indexes_by_a_real(x):
    x[x[0]] = 1.0


def changes_kind(x):
    y = x
    y = 1.0
    x[0] = y


def returns_nothing(x):
    return


def steps(x):
    for i in range(0, 3, 2):
        x[i] = 0.0


def slices(x):
    x[0] = x[0:3:2][0]


REFUSED = {
    loops_over_an_array: (1, "range"),
    shifts_bits: (1, "<<"),
    has_a_list: (1, "List"),
    calls_numpy: (1, "np.sin"),
    calls_no_kernel: (1, "generator|recursion|expected|takes"),
    calls_itself: (2, "recursion"),
    chains: (1, "0.0 < x"),
    breaks_off: (3, "Break"),
    knows_no_such_name: (1, "nowhere"),
    indexes_by_a_real: (1, "integer"),
    changes_kind: (2, "is first"),
    returns_nothing: (1, "return"),
    steps: (1, "range"),
    slices: (1, "slice"),
}


@pytest.mark.parametrize("language", [c99.C99(), javascript.JavaScript()], ids=["c", "js"])
@pytest.mark.parametrize("function", REFUSED, ids=lambda f: f.__name__)
def test_what_is_outside_the_subset_is_refused_with_file_and_line(function, language):
    line, what = REFUSED[function]
    with pytest.raises(ExportError, match=what) as caught:
        Program(language).add(function, [Array(REAL, (3,))])
    first = inspect.getsourcelines(function)[1]
    message = str(caught.value)
    assert "\n" not in message
    assert re.search(rf"test_export_printer\.py:{first + line}: ", message), message


def test_a_kernel_that_is_none_or_has_no_text_is_refused():
    with pytest.raises(ExportError, match="expected a kernel, got int"):
        Program(c99.C99()).add(3, [])
    typed_in: dict = {}
    exec("def f(x):\n    x[0] = 1.0", typed_in)
    with pytest.raises(ExportError, match="expected a kernel in a file"):
        Program(c99.C99()).add(typed_in["f"], [Array(REAL, (3,))])
    with pytest.raises(ExportError, match="takes 5 arguments, given 1"):
        Program(c99.C99()).add(mixed, [INT])


# ---------------------------------------------------------------- bundles and constants


class Arms(NamedTuple):
    pairs: object
    table: object
    unused: object


ADDRESS = 7


@kernel
def by_address(address, pairs):
    """Stand for what has no text."""
    pairs[0].x = -1.0


@kernel
def raised(table):
    """Write although what depends on it never happens."""
    table[0, 0] += 7.0
    return table[0, 0] > 0.0


@kernel
def bundled(arms, k):
    """Use the arrays of a bundle, a part of columns, and what constants decide."""
    part = arms.table[0:3][:, k : k + 2]
    first = arms.pairs[0]
    if raised(arms.table) and first.count > 3:
        arms.table[0, 0] = -1.0
    acts = first.count == 3 and part.shape[0] > 1
    if acts:
        by_address(ADDRESS, arms.pairs)
    if not acts:
        arms.unused[0] = 1.0
    for i in range(part.shape[0]):
        row = part[i]
        row[1] += row[0] if first.count > 2 else arms.unused[0]
    return first.x


def doubles(pairs):
    """Be called in the other's place."""
    for p in range(pairs.size):
        pairs[p].x = 2.0 * pairs[p].x


def arms_of(texts):
    pairs = np.zeros(2, PAIR)
    pairs["x"], pairs["count"] = (1.5, 2.5), 3
    table = np.arange(12.0).reshape(3, 4)
    arrays = Arms(pairs, table, np.zeros(1))
    return arrays, bundle("arms", arrays._asdict(), texts)


@pytest.mark.usefixtures("gcc")
def test_a_bundle_is_a_struct_and_its_constants_decide_what_is_printed(tmp_path):
    arrays, kind = arms_of({name: f"{{}}->{name}" for name in Arms._fields})
    program = Program(c99.C99(), {by_address: lambda given: (doubles, given[1:])})
    name = program.add(bundled, [kind, INT]).name
    assert re.findall("if .*", re.sub(r"/\*.*\*/", "", program.text)) == [
        "if (raised(arms->table) && 0) {"
    ]
    assert "unused" not in program.text
    source = tmp_path / "bundled.c"
    source.write_text(
        "#include <tgmath.h>\n#include <stdio.h>\ntypedef double real_t;\n"
        + c99.helpers(program.text)
        + c99.C99().structs([kind.members[0][1].element])
        + "typedef struct { fpid_pairs pairs[2]; real_t table[12]; } fpid_arms;\n"
        + program.text
        + "int main(void) { fpid_arms a = {{{1.5, 0.0}, {2.5, 0.0}}, {0}};\n"
        "for (int i = 0; i < 12; ++i) a.table[i] = i;\n"
        f"double r = {name}(&a, 1);\n"
        "fwrite(&r, 8, 1, stdout); fwrite(a.table, 8, 12, stdout); return 0; }\n"
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    binary = str(tmp_path / "bundled")
    finished([build.compiler(), *flags, str(source), "-o", binary], check=True)
    found = np.frombuffer(finished([binary], check=True, text=False).stdout)
    arrays.table[:, 2] += arrays.table[:, 1]
    arrays.table[0, 0] += 7.0
    assert found.tolist() == [3.0, *arrays.table.ravel()]


def test_a_bundle_in_javascript_is_places_in_memory(node, tmp_path):
    arrays, kind = arms_of({"pairs": "100", "table": "20", "unused": "0"})
    program = Program(javascript.JavaScript(), {by_address: lambda given: (doubles, given[1:])})
    name = program.add(bundled, [kind, INT]).name
    path = tmp_path / "bundled.js"
    path.write_text(
        "const M = new Float64Array(200); M.set([1.5, 0, 3, 2.5, 0, 3], 100);"
        "for (let i = 0; i < 12; i++) M[20 + i] = i;"
        f"{javascript.HELPERS}{program.text}const r = {name}(1);"
        "process.stdout.write([r, ...M.slice(20, 32)].join(' '));"
    )
    arrays.table[:, 2] += arrays.table[:, 1]
    arrays.table[0, 0] += 7.0
    assert [float(x) for x in node(path).split()] == [3.0, *arrays.table.ravel()]
