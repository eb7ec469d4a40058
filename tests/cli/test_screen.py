"""One table for all commands: in a narrow terminal nothing is cut, in a pipe nothing is broken."""

import numpy as np
import pytest
from rich.console import Console

from fpid_pin.cli import screen
from fpid_pin.progress import Progress

NAMES = [
    "adaptive FPID with a long name", "a_name_without_any_place_to_break_it_at_all", "PID", "x" * 60
]  # fmt: skip
HEADS = [
    "tail (rms of joints) [mrad]", "RMS (rms of joints) [mrad]", "energy (sum of joints) [N²m²s]"
]  # fmt: skip


def printed(rows, capsys, width=80):
    """Return what a terminal shows of a table, in lines; None: a pipe."""
    console = width and Console(force_terminal=True, width=width, color_system=None)
    screen.print_table(rows, "title", console=console)
    lines = capsys.readouterr().out.splitlines()
    assert not any("…" in line or "..." in line for line in lines)
    return [line.rstrip() for line in lines]


def column(lines, start=0, end=None):
    """Return what stands between two places of all lines, without spaces."""
    return "".join("".join(line[start:end].split()) for line in lines)


@pytest.mark.parametrize("width", [80, 60])
def test_no_number_and_no_name_is_cut_in_a_narrow_terminal(width, capsys):
    rows = [
        {"condition": "calm", "controller": name}
        | {head: 12345.678 * 10.0 ** (3 * j - k) for j, head in enumerate(HEADS)}
        | {"note": "best of all"}
        for k, name in enumerate(NAMES)
    ]
    lines = printed(rows, capsys, width)
    assert max(map(len, lines)) <= 80
    # The names' column is as wide as it is.
    names = [column(lines, 0, end) for end in range(80)]
    assert any(all("".join(name.split()) in text for name in NAMES) for text in names)
    piped = printed(rows, capsys, None)
    for row in rows:
        assert all(screen.cell(row[head]) in " ".join(lines).split() for head in HEADS)
        whole = next(line for line in piped if line.startswith(row["controller"]))
        assert whole.endswith(row["note"])


def test_every_word_of_the_last_column_is_there(capsys):
    """Rich folded it by a width that it then did not give it."""
    notes = ["gravity at home exceeds the effort limit of joint2", "no limits given", "jaw locked"]
    rows = [{"name": f"arm {k}", "effort": "12, " * 9, "friction": "34, " * 9, "note": note}
            for k, note in enumerate(notes)]  # fmt: skip
    lines = printed(rows, capsys)
    start = next(line.index("note") for line in lines if "note" in line)
    assert column(lines, start) == "".join(f"note {' '.join(notes)}".split())


def test_columns_that_do_not_fit_follow_below_with_the_names_again(capsys):
    heads = [f"figure {k} [N m]" for k in range(12)]
    rows = [{"controller": f"law {j}"} | {h: 1.2345 * 10.0**k for k, h in enumerate(heads)}
            for j in range(3)]  # fmt: skip
    rows[1][heads[0]] = None  # not known
    lines = printed(rows, capsys)
    assert max(map(len, lines)) <= 80
    words = " ".join(lines).split()
    for head in heads[1:]:
        assert words.count(screen.cell(rows[0][head])) == 3
    assert " ".join(lines).count("law 1") == words.count("controller") == 2
    assert words.count("-") == 1


def test_what_is_written_has_every_digit_and_what_is_shown_four():
    rows = [{"name": "a|b", "figure": np.float64(1 / 3 * 1e-7)}, {"name": "c", "figure": None}]
    assert screen.comma_separated(rows) == f"name,figure\na|b,{1 / 3 * 1e-7!r}\nc,\n"
    assert screen.markdown(rows).splitlines()[2:] == ["| a\\|b | 3.333e-8 |", "| c | \\- |"]
    assert screen.drop_constant(rows, "figure") == rows
    assert screen.drop_constant(rows[:1], "figure") == [{"name": "a|b"}]


def test_a_terminal_breaks_sentences_between_words_and_addresses_nowhere(capsys):
    sentence = "Least RMS error of the last half: FPID + feedforward + observer, 2.31 mrad; " * 3
    address = "http://127.0.0.1:7000/" + "x" * 100
    console = Console(force_terminal=True, width=60, color_system=None)
    screen.say(sentence, address, f"open {address}", console=console)
    lines = capsys.readouterr().out.splitlines()
    assert " ".join(" ".join(lines).split()) == f"{sentence}{address} open {address}"
    assert all(len(line) <= 60 or address in line for line in lines)
    screen.say(sentence, console=Console(width=60))  # a pipe
    assert capsys.readouterr().out == f"{sentence}\n"


def test_without_a_terminal_there_is_no_bar_and_no_empty_line(capsys, monkeypatch):
    monkeypatch.setattr(screen, "_PATIENCE", -1.0)
    with screen.progress_bar("simulating") as advance:
        for part in (0.1, 0.5, 1.0):
            advance(Progress(part))
    assert capsys.readouterr().err == ""
