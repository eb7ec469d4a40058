"""The house plan: which room may know of which, and what an import costs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import fpid_pin

PACKAGE = Path(fpid_pin.__file__).parent
# A room may import those before it, in its own tier and above.
TIERS = [
    {"exceptions", "checks", "descriptions"},
    {"fractional", "arms"},
    {"control"},
    {"simulation"},
    {"tuning", "campaign"},
    {"view"},
    {"cli"},
]
HEAVY = (
    "matplotlib", "pymoo", "meshcat", "example_robot_data", "pydantic", "typer", "rich",
    "scipy", "control", "sympy", "tornado",
)  # fmt: skip


def tier(room):
    return next(k for k, rooms in enumerate(TIERS) if room in rooms)


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            if node.module and node.module.startswith("fpid_pin."):
                yield node.module.split(".")[1]
            elif node.module == "fpid_pin":
                for name in node.names:
                    if (PACKAGE / name.name).exists() or (PACKAGE / f"{name.name}.py").exists():
                        yield name.name
        elif isinstance(node, ast.Import):
            for name in node.names:
                if name.name.startswith("fpid_pin."):
                    yield name.name.split(".")[1]


MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path):
    room = path.relative_to(PACKAGE).parts[0]
    for other in imports(path):
        if other == room:
            continue
        assert tier(other) < tier(room), f"{room} imports {other}"


def test_importing_the_package_loads_nothing_heavy():
    code = f"import sys, fpid_pin; print([m for m in {HEAVY!r} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_the_public_names_exist_and_are_listed_once():
    for module in (fpid_pin, fpid_pin.fractional, fpid_pin.arms, fpid_pin.view):
        assert len(set(module.__all__)) == len(module.__all__)
        for name in module.__all__:
            assert hasattr(module, name), name


def test_every_file_is_readable_in_one_sitting():
    long = {
        p.name: n for p in PACKAGE.rglob("*.py") if (n := len(p.read_text().splitlines())) > 500
    }
    assert long == {}


def test_the_library_never_prints():
    for path in PACKAGE.rglob("*.py"):
        calls = [
            node.func.id
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        ]
        assert "print" not in calls, path
