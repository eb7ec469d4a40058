"""Kernels keep to the part of Python that is also C and JavaScript."""

import ast
from pathlib import Path

import numpy as np
import pytest

import fpid_pin
from fpid_pin.kernels.records import record_type

KERNELS = Path(fpid_pin.__file__).parent / "kernels"
SCALAR = {
    ast.FunctionDef, ast.arguments, ast.arg, ast.Expr, ast.Constant, ast.Return, ast.Assign,
    ast.AugAssign, ast.If, ast.IfExp, ast.For, ast.While, ast.Continue, ast.Pass, ast.Name,
    ast.Attribute, ast.BitAnd,
    ast.Subscript, ast.Slice, ast.Tuple, ast.Call, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare,
    ast.Load, ast.Store, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Mod, ast.USub, ast.Not, ast.And,
    ast.Or, ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE,
}  # fmt: skip
#: Whole numbers are halved where a run is counted, which is not printed.
NOT_PRINTED = {"rollout": {ast.FloorDiv}}
CALLS = {"range", "min", "max", "abs", "int"}
MATH = {"sqrt", "sin", "cos", "floor", "isfinite"}


def is_kernel(node, path):
    """Whether a function is one: by its decorator, or as all of a file that others compile."""
    if not isinstance(node, ast.FunctionDef):
        return False
    decorated = any("kernel" in ast.unparse(d) for d in node.decorator_list)
    return decorated or path.name in {"functions.py", "newton_euler.py"}


def kernels():
    for path in sorted(KERNELS.glob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if is_kernel(node, path):
                yield pytest.param(node, id=f"{path.stem}.{node.name}")


#: Beside one another: laws' functions by their address, and the arrays of a caller in Python.
OTHERS = {"call_law", "Controller"}
NAMES = {p.values[0].name for p in kernels()} | OTHERS
# A kernel may go by another name where two are called alike.
ALIASES = {
    alias.asname
    for path in KERNELS.glob("*.py")
    for node in ast.walk(ast.parse(path.read_text()))
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
    if alias.name in NAMES
}


@pytest.mark.parametrize("function", list(kernels()))
def test_a_kernel_is_scalar_arithmetic(function):
    function.decorator_list = []
    assert ast.get_docstring(function)
    for node in ast.walk(function):
        where = f"line {getattr(node, 'lineno', '?')}: {ast.unparse(node)}"
        assert type(node) in SCALAR | NOT_PRINTED.get(function.name, set()), where
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called in CALLS | NAMES | ALIASES or called in {f"math.{m}" for m in MATH}, where
            assert not node.keywords, where
        if isinstance(node, ast.For):
            assert ast.unparse(node.iter).startswith("range("), where
        if isinstance(node, ast.Constant) and not isinstance(node.value, str):
            assert isinstance(node.value, (bool, int, float)), where


def test_every_kernel_that_there_is_was_looked_at():
    # One name, one kernel: C has no modules.
    listed = [p.values[0].name for p in kernels()]
    assert len(set(listed)) == len(listed)
    assert {"tick_parts", "derivative", "rollout", "move", "stick_slip", "measure", "clip"} <= NAMES


@pytest.mark.kernels
def test_a_name_that_a_record_has_already_is_refused():
    kind = record_type({"a": "one", "b": "two"}, {"c": "a count"})
    assert kind.names == ("a", "b", "c")
    record = np.zeros(1, kind)[0]
    record.a, record.c = 2.5, 3.0
    assert (record.a, record.c) == (2.5, 3)
    assert kind["c"] == np.int64
    with pytest.raises(ValueError, match="mean"):
        record_type({"a": "", "mean": ""})
