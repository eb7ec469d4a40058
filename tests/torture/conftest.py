"""Attacks: a few of each in the suite, all of them by `make torture`; a table at the end.

Every test counts its attacks with `tally`.
"""

from collections import defaultdict

import pytest

#: By attack: what went wrong with each try, "" where nothing did.
TRIED = defaultdict(list)


@pytest.fixture
def tally():
    """Return a function that counts a try of an attack; whatever was bad fails the test."""
    faults = []

    def count(attack, fault=""):
        TRIED[attack].append(fault)
        faults.append(fault and f"{attack}: {fault}")

    yield count
    assert faults, "nothing was tried"
    assert [fault for fault in faults if fault] == []


def pytest_terminal_summary(terminalreporter):
    if TRIED:
        terminalreporter.section("torture")
        width = max(map(len, TRIED))
        terminalreporter.write_line(f"{'attack':<{width}}  {'tried':>8}  {'bad':>5}")
        for attack, faults in TRIED.items():
            line = f"{attack:<{width}}  {len(faults):>8,}  {sum(map(bool, faults)):>5}"
            terminalreporter.write_line(line)
