"""Attacks: a few of each in the suite, all of them by `make torture`; a table at the end.

A test counts its attacks with `tally`; of one that does not, the table has a line all the same.
"""

import os

import pytest

#: Whether all attacks are made, or the few that a suite has time for.
FULL = os.environ.get("FPID_TORTURE") == "full"
#: By attack: how often it was tried, and what went wrong.
TRIED: dict[str, tuple[int, list[str]]] = {}
COUNTED: set[str] = set()


@pytest.fixture
def full():
    return FULL


@pytest.fixture
def tally(request):
    """Return a function that counts a try of an attack; whatever was bad fails the test."""
    mine, faults = [], []
    COUNTED.add(request.node.nodeid)

    def count(attack, fault=""):
        tried, bad = TRIED.setdefault(attack, (0, []))
        TRIED[attack] = (tried + 1, [*bad, fault] if fault else bad)
        mine.append(attack)
        faults.extend([f"{attack}: {fault}"] if fault else [])

    yield count
    assert mine, "nothing was tried"
    assert faults == []


def pytest_runtest_logreport(report):
    here = "torture" in report.nodeid.split("::")[0]
    if here and report.when == "call" and report.nodeid not in COUNTED and not report.skipped:
        test = report.nodeid.split("::")[-1].partition("[")[0]
        name = test.removeprefix("test_").replace("_", " ")
        tried, bad = TRIED.get(name, (0, []))
        TRIED[name] = (tried + 1, [*bad, "failed"] if report.failed else bad)


def pytest_terminal_summary(terminalreporter):
    if TRIED:
        terminalreporter.section("torture")
        width = max(map(len, TRIED))
        terminalreporter.write_line(f"{'attack':<{width}}  {'tried':>8}  {'bad':>5}")
        for attack, (tried, bad) in TRIED.items():
            terminalreporter.write_line(f"{attack:<{width}}  {tried:>8,}  {len(bad):>5}")
