"""CONTRIBUTING.md does not rot: its examples run, and its table is the house."""

import re
import sys
from pathlib import Path

from bounded import finished
from test_house import PACKAGE, TIERS, is_module

PAGE = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
SECTIONS = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
EXAMPLES = {
    section.splitlines()[0]: re.findall(r"^```python\n(.*?)^```$", section, re.M | re.S)
    for section in SECTIONS
    if section.startswith("To add ")
}
MOST_LINES = 25


def test_each_recipe_has_one_example():
    assert [name.removeprefix("To add ") for name in EXAMPLES] == [
        "an arm", "a law", "a fractional law", "a fractional sliding surface",
        "a law of the whole robot", "a law in plain Python", "a reference", "a disturbance",
        "a cost", "a fractional design",
    ]  # fmt: skip
    assert {len(examples) for examples in EXAMPLES.values()} == {1}
    assert PAGE.count("```python") == len(EXAMPLES)


def test_its_examples_are_short_and_what_they_assert_is_true(tmp_path):
    """In a process of their own: what they register under a name is not there for other tests."""
    script = "import runpy\n"
    for k, (example,) in enumerate(EXAMPLES.values()):
        lines = example.splitlines()
        assert len(lines) <= MOST_LINES
        assert max(map(len, lines)) <= 100
        assert any(line.startswith("assert ") for line in lines)
        (tmp_path / f"example{k}.py").write_text(example, encoding="utf-8")
        script += f"runpy.run_path('example{k}.py', run_name='__main__')\n"
    done = finished([sys.executable, "-W", "error", "-c", script], cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_table_is_the_house():
    rows = re.findall(r"^\| (`.*?) \|", PAGE, re.MULTILINE)
    told = [set(re.findall(r"`(\w+)`", row)) for row in rows]
    assert told == [{room for room in tier if is_module(room)} for tier in TIERS]


def test_every_file_that_it_names_is_there():
    for name in re.findall(r"`([\w/]+(?:/|\.py|\.md))`", PAGE):
        places = [PACKAGE.parent / name, PACKAGE / name]
        assert any(place.exists() for place in places), name
