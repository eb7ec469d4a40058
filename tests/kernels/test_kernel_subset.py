"""Kernels keep to the part of Python that is also C and JavaScript."""

import ast
from pathlib import Path

import numpy as np
import pytest

import fpid_pin
from fpid_pin.kernels.layout import layout

KERNELS = Path(fpid_pin.__file__).parent / "kernels"
SCALAR = {
    ast.FunctionDef, ast.arguments, ast.arg, ast.Expr, ast.Constant, ast.Return, ast.Assign,
    ast.AugAssign, ast.If, ast.IfExp, ast.For, ast.While, ast.Continue, ast.Name, ast.Attribute,
    ast.Subscript, ast.Slice, ast.Tuple, ast.Call, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare,
    ast.Load, ast.Store, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Mod, ast.USub, ast.Not, ast.And,
    ast.Or, ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE,
}  # fmt: skip
CALLS = {"range", "min", "max", "abs", "int"}
MATH = {"sqrt", "sin", "cos", "floor", "isfinite"}


def kernels():
    for path in sorted(KERNELS.glob("*.py")):
        tree = ast.parse(path.read_text())
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and any(
                "kernel" in ast.unparse(d) for d in node.decorator_list
            ):
                yield pytest.param(node, id=f"{path.stem}.{node.name}")


NAMES = {p.values[0].name for p in kernels()}
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
        assert type(node) in SCALAR, where
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
    assert {"fpid", "derivative", "adapt", "euler", "stick_slip", "measure", "supervise"} <= NAMES


@pytest.mark.kernels
def test_a_name_that_a_record_has_already_is_refused():
    assert layout("a b", "c").names == ("a", "b", "c")
    record = np.zeros(1, layout("a"))[0]
    record.a = 2.0
    assert record.a == 2.0
    with pytest.raises(ValueError, match="mean"):
        layout("a mean")
