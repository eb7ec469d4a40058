"""Any text is a configuration, or lines that name the file and the key."""

import copy
import functools
import itertools
import operator
import re
import tomllib

import pytest
import tomli_w
from bounded import FULL
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fpid_pin.cli.campaign import read_campaign
from fpid_pin.cli.configuration import demo_config, parse
from fpid_pin.cli.tune import read_plan
from fpid_pin.exceptions import ConfigError

pytestmark = pytest.mark.torture
MANY = settings(max_examples=4000 if FULL else 30)
TEXT = (
    demo_config().text
    + """
[plant]
payload = { mass = 0.5 }
viscous_friction = 0.1
[sensors]
velocity_noise = 0.05
[[condition]]
name = "nominal"
[[condition]]
name = "noisy"
sensors = { delay = 2 }
[tune]
population = 6
generations = 2
seeds = [0, 1]
reduce = "worst"
[tune.cost]
kind = "quadratic_cost"
[tune.space]
kp = [1, 100, "log"]
integral_order = { low = 0.1, high = 1, shared = true }
[campaign]
runs = 4
[campaign.uncertain]
mass = { kind = "uniform", low = 0.8, high = 1.2 }
"""
)
TABLE = tomllib.loads(TEXT)

names = st.sampled_from(
    ["self", "kind", "name", "cls", "path", "arm", "kp", "low", "high", "a", "", "é", "\x1b[2J",
     "__class__", "model_config", "copy", "a.b", 'a"b', "a\nb"]
)  # fmt: skip
integers = st.integers(-(2**63), 2**63 - 1) | st.sampled_from(
    [0, 1, -1, 10**6, 2**63 - 1, -(2**63)]
)
leaves = (
    integers
    | st.floats()
    | st.sampled_from([5e-324, 1e-300, 1e300, 1e308, float("inf"), float("nan"), -0.0])
    | st.booleans()
    | names
    | st.text(max_size=5)
    | st.datetimes().map(lambda when: when.replace(fold=0))
    | st.dates()
)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


def places(table, path=()):
    """Yield the way to everything in a table."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in pairs:
        yield (*path, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*path, key))


PLACES = list(places(TABLE))


@st.composite
def spoilt(draw):
    """Return the demo's table with some of it replaced, removed or added."""
    table = copy.deepcopy(TABLE)
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(PLACES))
        try:
            inner = functools.reduce(operator.getitem, path[:-1], table)
            how = draw(st.sampled_from(["replace", "replace", "remove", "add"]))
            if how == "remove":
                del inner[path[-1]]
            elif how == "add" and isinstance(inner, dict):
                inner[draw(names)] = draw(values)
            elif isinstance(path[-1], int) == isinstance(inner, list):
                inner[path[-1]] = draw(values)
        except (KeyError, IndexError, TypeError):
            continue  # what an earlier change has taken away
    return tomli_w.dumps(table)


@st.composite
def torn(draw):
    """Return the demo's text with a piece cut out, repeated, or overwritten."""
    a, b = sorted((draw(st.integers(0, len(TEXT))), draw(st.integers(0, len(TEXT)))))
    noise = draw(st.text(max_size=8) | st.sampled_from(['"""', "[[", "]]", "=", "\n", "{", "#"]))
    return draw(
        st.sampled_from([TEXT[:a], TEXT[:a] + TEXT[b:], TEXT[:b] + TEXT[a:], TEXT[:a] + noise
                         + TEXT[a:], TEXT[:a] + noise + TEXT[a + len(noise):]])
    )  # fmt: skip


def fault_of(text, folder):
    try:
        config = parse(text, "x.toml", folder)
        read_plan(config)
        read_campaign(config)
    except ConfigError as error:
        lines = str(error).split("\n")
        keyed = all(re.match(r"x\.toml: .+: ", line) or "not valid TOML" in line for line in lines)
        return "" if keyed else str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def test_a_key_of_any_table_may_be_called_as_an_argument_is(tmp_path, tally):
    """``[plant.payload] self = 0`` was a traceback."""
    assert fault_of(TEXT, tmp_path) == ""
    names = ("self", "cls", "kind", "path", "args", "kwargs")
    for path, name in itertools.product([(), *PLACES], names if FULL else names[:3]):
        table = copy.deepcopy(TABLE)
        inner = functools.reduce(operator.getitem, path, table)
        if isinstance(inner, dict):
            inner[name] = 0
            fault = fault_of(tomli_w.dumps(table), tmp_path)
            tally("a key called as an argument is", fault and f"{path}, {name}: {fault}")


@MANY
@example(f'"" = 0\n{TEXT}')
@given(spoilt())
def test_tables_that_are_spoilt(tmp_path, tally, text):
    fault = fault_of(text, tmp_path)
    tally("spoilt tables", fault)
    assert fault == ""


@MANY
@given(torn())
def test_texts_that_are_torn(tmp_path, tally, text):
    fault = fault_of(text, tmp_path)
    tally("torn texts", fault)
    assert fault == ""
