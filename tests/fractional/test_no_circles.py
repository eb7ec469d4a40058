"""No module of the room needs another that needs it, not even by an import inside a function."""

import ast
import types
from graphlib import TopologicalSorter
from pathlib import Path

import fpid_pin.fractional as room


def test_imports_have_no_circle():
    needs = {}
    for path in Path(room.__file__).parent.glob("*.py"):
        tree = ast.walk(ast.parse(path.read_text()))
        modules = [n.module for n in tree if isinstance(n, ast.ImportFrom) and n.module]
        inside = [m for m in modules if m.startswith(room.__name__ + ".")]
        needs[f"{room.__name__}.{path.stem}"] = inside
    assert list(TopologicalSorter(needs).static_order())


def test_no_name_of_the_room_is_one_of_its_modules():
    assert not [n for n in room.__all__ if isinstance(getattr(room, n), types.ModuleType)]
    stems = {path.stem for path in Path(room.__file__).parent.glob("*.py")}
    assert not stems & set(room.__all__)
