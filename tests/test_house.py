"""The house plan: which room may know of which, and what an import costs."""

import ast
import importlib
import inspect
import pkgutil
import re
import sys
import types
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from bounded import finished

import fpid_pin

PACKAGE = Path(fpid_pin.__file__).parent
# A room may import those before it, in its own tier and above.
TIERS = [
    {"kernels", "text"},
    {"_version", "exceptions", "progress"},
    {"checks", "files", "resources"},
    {"descriptions", "npz", "own_code"},
    {"costs", "disturbances"},
    {"fractional", "arms"},
    {"control", "references"},
    {"simulation"},
    {"tuning"},
    {"export"},
    {"view"},
    {"campaign"},
    {"cli"},
]
HEAVY = (
    "matplotlib", "pymoo", "meshcat", "example_robot_data", "typer", "rich",
    "scipy", "sympy", "tornado", "numba",
)  # fmt: skip
TOP = "the package itself"


def tier(room):
    return next((k for k, rooms in enumerate(TIERS) if room in rooms), len(TIERS))


def is_module(name):
    return (PACKAGE / name).is_dir() or (PACKAGE / f"{name}.py").exists()


def rooms_imported(code):
    """Yield the room of every import, also of those inside functions.

    What the package's face exports is of no room: to take it from there is to import the top.
    """
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            if node.module == "fpid_pin":
                yield from (a.name if is_module(a.name) else TOP for a in node.names)
            elif node.module and node.module.startswith("fpid_pin."):
                yield node.module.split(".")[1]
        elif isinstance(node, ast.Import):
            for alias in node.names:
                head, _, rest = alias.name.partition(".")
                if head == "fpid_pin":
                    yield rest.split(".")[0] or TOP


MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py")


def test_imports_go_one_way():
    for path in MODULES:
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        assert any(room in rooms for rooms in TIERS), f"{room} is in none of the tiers"
        for other in rooms_imported(path.read_text()):
            assert other == room or tier(other) < tier(room), f"{path} imports {other}"


def needed(path, room):
    """Return the files of a room that one of them needs when it runs, however late."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in (node.module, *names):
                head, _, file = name.partition(f"fpid_pin.{room}.")
                if not head and (path.parent / f"{file}.py").exists():
                    yield file


@pytest.mark.parametrize("room", sorted(p.parent.name for p in PACKAGE.glob("*/__init__.py")))
def test_no_two_files_of_a_room_need_each_other(room):
    files = {p.stem: set(needed(p, room)) for p in (PACKAGE / room).glob("*.py")}
    assert len(list(TopologicalSorter(files).static_order())) == len(files)
    assert room not in ("kernels", "control", "simulation") or any(files.values())


def test_no_import_goes_unseen():
    code = "from fpid_pin import checks, Arm\nimport fpid_pin as fp, fpid_pin.view.plots as plots\n"
    code += "def late():\n    from fpid_pin.cli.configuration import load"
    assert list(rooms_imported(code)) == ["checks", TOP, TOP, "view", "cli"]
    assert tier(TOP) > tier("cli")


INIT = (PACKAGE / "__init__.py").read_text()


def test_the_face_is_what_it_says():
    assert dir(fpid_pin) == sorted(fpid_pin.__all__)
    for name in fpid_pin.__all__:
        assert getattr(fpid_pin, name) is vars(fpid_pin)[name]
    # What type checkers see is what is fetched.
    imports = next(node for node in ast.parse(INIT).body if isinstance(node, ast.If)).body
    written = {alias.name for node in imports for alias in node.names}
    assert written | {"__version__"} == set(fpid_pin.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = fpid_pin.nothing


def test_importing_the_package_loads_nothing_heavy_and_a_name_when_it_is_asked_for():
    code = (
        f"import sys, fpid_pin as fp; print([m for m in {HEAVY!r} if m in sys.modules]); fp.Arm; "
        "print('pinocchio' in sys.modules, 'fpid_pin.tuning' in sys.modules); import fpid_pin.view;"
        "print([m for m in ('matplotlib', 'meshcat', 'tornado', 'IPython') if m in sys.modules])"
    )
    out = finished([sys.executable, "-c", code], check=True)
    assert out.stdout.splitlines() == ["[]", "True False", "[]"]


@pytest.mark.parametrize("room", [name for name in fpid_pin.__all__ if is_module(name)])
def test_a_room_can_be_entered_both_ways_and_lists_what_it_has(room):
    module = importlib.import_module(f"fpid_pin.{room}")
    assert getattr(fpid_pin, room) is module
    assert len(set(module.__all__)) == len(module.__all__)
    for name in module.__all__:
        assert hasattr(module, name), name


def test_no_name_of_a_room_hides_one_of_its_files():
    """`fpid_pin.tuning.tune` must not be a function here and a module there."""
    hidden = set()
    for path in PACKAGE.rglob("__init__.py"):
        room = ".".join(path.parent.relative_to(PACKAGE.parent).parts)
        names = vars(importlib.import_module(room))
        for file in pkgutil.iter_modules([str(path.parent)]):
            if not isinstance(names.get(file.name, sys), types.ModuleType):
                hidden.add(f"{room}.{file.name}")
    assert hidden == set()


def test_every_file_is_readable_in_one_sitting():
    long = {
        p.name: n for p in PACKAGE.rglob("*.py") if (n := len(p.read_text().splitlines())) > 400
    }
    assert long == {}


def public(owner):
    """Yield the public functions and classes of a room, and methods of its classes, by name."""
    for name in getattr(owner, "__all__", vars(owner)):
        thing = inspect.getattr_static(owner, name, None)
        thing = getattr(owner, name) if thing is None else getattr(thing, "__func__", thing)
        if name[0] != "_" and getattr(thing, "__module__", "").startswith("fpid_pin"):
            if inspect.isclass(thing) and not inspect.isclass(owner):
                yield from ((f"{name}.{method}", each) for method, each in public(thing))
            if inspect.isclass(thing) or inspect.isfunction(thing):
                yield name, thing


def listed_parameters(thing):
    """Return the names under Parameters, and Attributes of a class, of a docstring."""
    found = set()
    for section in ("Parameters", "Attributes"):
        text = inspect.getdoc(thing) or ""
        listed = re.search(rf"(?ms)^{section}\n-+\n(.*?)(?=^\w+\n-+$|\Z)", text)
        for line in re.findall(r"(?m)^(?! )(.+)$", listed[1] if listed else ""):
            found |= {name.strip(" *") for name in line.partition(" : ")[0].split(",")}
    return found


@pytest.mark.parametrize("room", [name for name in fpid_pin.__all__ if is_module(name)])
def test_a_docstring_that_lists_parameters_lists_those_of_its_signature(room):
    for name, thing in public(importlib.import_module(f"fpid_pin.{room}")):
        assert thing.__doc__, name
        if "Parameters\n" in thing.__doc__:
            listed, known = listed_parameters(thing), set(inspect.signature(thing).parameters)
            bases = thing.__mro__[1:] if inspect.isclass(thing) else ()
            listed = listed.union(*(listed_parameters(base) for base in bases))
            known = {each for each in known if each[0] != "_" and each not in ("self", "cls")}
            assert known <= listed, f"{room}.{name} does not tell of {known - listed}"
            assert inspect.isclass(thing) or listed <= known, f"{name} has no {listed - known}"


UNIT = re.compile(
    r"(?:, |in |^ *)(?:rad(?:/s(?:\^2)?)?|N m(?: s/rad)?|m/s\^2|kg(?: m\^2)?|m|s)(?=[,;:.)]|$)",
    re.MULTILINE,
)


def test_units_stand_in_brackets():
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
                text = re.sub(r"``.*?``|\[.*?\]", "", ast.get_docstring(node) or "")
                found = UNIT.findall(text)
                assert not found, f"{path}: {found} in {text}"
