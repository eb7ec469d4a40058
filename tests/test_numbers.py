"""Numbers that README and docs publish are in the stored output of the script named beside them."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "docs" / "published_numbers.py"
spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
numbers = importlib.util.module_from_spec(spec)
spec.loader.exec_module(numbers)
DOCS = ROOT / "docs"
VALIDATION = DOCS / "validation.md"


@pytest.mark.parametrize("page", numbers.PAGES, ids=lambda page: page.name)
def test_every_number_has_its_source_beside_it_and_tables_are_as_stored(page):
    text = page.read_text(encoding="utf-8")
    assert numbers.missing(text, page.parent) == []
    assert numbers.renewed(text, page.parent) == text, f"write it anew: python {SCRIPT}"


@pytest.mark.parametrize(
    ("sentence", "found"),
    [
        ("It errs by 77.31 mrad.", ["77.31"]),
        ("It takes 41 % of 1,234,567 ticks at 3.3e-7.", ["41", "1,234,567", "3.3e-7"]),
        # In the stored output: 7.9 and 99.0; 2.583, rounded; but nothing that rounds to 2.59.
        ("From 99.0 to 7.9, with ([figures](../benchmarks/results/validation.md)).", []),
        ("2.58, not 2.59, by `benchmarks/validation.py`.", ["2.59"]),
        # Of the record nobody finds a number.
        ("It errs by 99.0 mrad ([record](../benchmarks/RECORD.md)).", ["99.0"]),
        # A default, in the file of its law.
        ("gamma is 25 ([law](../fpid_pin/control/fpid.py)).", []),
        ("By (22), [31], section 5.1, SHA-256, h^12, `kp = 99`, in 2009 and in 3 steps.", []),
        ('<iframe style="width: 100%; border: 1px solid #8888"></iframe>', []),
        ("```python\nprint(77.31)\n```\n\nThat is 77.31.\n", []),
        ("# Here\n\n99.0\n\n## There\n\n[source](../benchmarks/results/validation.md)\n", ["99.0"]),
    ],
)
def test_a_number_without_a_source_is_found(sentence, found):
    said = numbers.missing(f"{sentence}\n", DOCS)
    assert [line.rpartition(": ")[2] for line in said] == found


def test_a_number_that_is_made_up_is_found_in_a_page_and_a_table_that_is_old_renewed():
    text = VALIDATION.read_text(encoding="utf-8")
    old = text.replace("| 7.9 / 5.1 |", "| 6.543 / 5.1 |")
    assert old != text
    (line,) = numbers.missing(old, DOCS)
    assert line == "## A real double pendulum: 6.543"
    assert numbers.renewed(old, DOCS) == text
