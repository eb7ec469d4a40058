"""What is shown of text from outside: visible, on one line, not too long."""

import pickle
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError, ArmError, ConfigError, FpidError, FpidWarning
from fpid_pin.text import MOST, against, cut, listed, listing, named, percent, shown, visible

ANY = st.text(st.characters())  # with control characters and halves of surrogate pairs
UNSEEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


@given(ANY)
def test_nothing_that_a_terminal_obeys_is_left(text):
    seen = visible(text)
    assert not {unicodedata.category(c) for c in seen} & UNSEEN
    assert visible(seen) == seen
    assert len(seen.splitlines()) <= 1


SEEN = ["joint 1", "käfig", "关节", "a\u00a0b", "λ = 0.9", "[red]x[/]", "\\n"]
UNSEEN_TEXTS = {
    "\x1b[31mred": "\\x1b[31mred", "a\nb\tc": "a\\nb\\tc", "\u202egnp": "\\u202egnp",
    "\x9b2J": "\\x9b2J", "a\u2028b": "a\\u2028b", "\ud800": "\\ud800", "\x00": "\\x00",
}  # fmt: skip


def test_what_can_be_seen_is_left_alone_and_what_cannot_is_written_out():
    for text, seen in [*zip(SEEN, SEEN, strict=True), *UNSEEN_TEXTS.items()]:
        assert visible(text) == seen


@given(ANY, st.integers(40, 300), st.integers(40, 300))
def test_a_cut_text_is_short_and_says_how_long_it_was(text, most, less):
    text = text * 40
    short = cut(text, most)
    assert len(short) <= most
    assert short == text if len(text) <= most else f"... ({len(text)} characters)" in short
    # What was cut before says what it said.
    if len(text) > most > less:
        assert f"... ({len(text)} characters)" in cut(short, less)


def test_values_that_python_does_not_write_are_described():
    deep = []
    for _ in range(100_000):
        deep = [deep]
    assert shown(deep) == "a list nested too deeply to be written"
    assert shown(10**5000) == "a int too long to be written"
    assert shown("x" * 5000, 80).endswith("xxx... (5000 characters)")
    assert shown({"a": "\x1b"}) == "{'a': '\\x1b'}"


def test_lists_of_names_are_short():
    assert listed("ab") == "'a', 'b'"
    assert listed(range(20_000)) == "0, 1, 2, ..."
    assert len(listed(["n" * 1000] * 9)) < 200
    assert named("a\n") == "'a\\n'"


LONG = "k" * 5000


def test_a_line_is_cut_at_200_characters_and_gives_the_lengths_of_key_and_value():
    text = str(ArgumentError(LONG, "a number", repr(LONG)))
    assert len(text) <= MOST
    assert "k... (5000 characters): expected a number, got 'k" in text
    assert text.endswith("k... (5002 characters)")
    assert str(ArgumentError("kp", "a number", shown(LONG))).endswith("... (5000 characters)")
    # What is expected is ours and stays whole; the value has 80 characters at least.
    text = str(ArgumentError("kp", "one of " + "x" * 180, repr(LONG)))
    assert len(text.partition(", got ")[2]) == 80
    with pytest.raises(ArgumentError) as caught:
        checks.choice(LONG, LONG, [f"option{k}" for k in range(20_000)])
    assert len(str(caught.value)) < 400


@given(ANY, ANY, ANY)
def test_every_error_is_one_visible_line(name, expected, got):
    for error in (ArgumentError(name, expected, got), ArmError(name), FpidWarning(got)):
        assert not {unicodedata.category(c) for c in str(error)} & UNSEEN
        assert len(str(error)) <= 5 * MOST
    error = ArgumentError(name, expected, got)
    assert (error.name, error.expected, error.got) == (name, expected, got)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_configuration_has_a_line_a_fault():
    lines = str(ConfigError(f"a.toml: x\x1b\nb: {LONG}")).split("\n")
    assert lines[0] == "a.toml: x\\x1b"
    assert len(lines[1]) == 5 * MOST
    assert isinstance(ConfigError(), FpidError)


def test_a_listing_fits_a_screen_and_percentages_have_no_exponent():
    lines = listing("law", [(f"field {k}", 1.0, "rad") for k in range(40)]).splitlines()
    assert len(lines) == 15
    assert lines[-1].split() == ["...", "and", "27", "more"]
    assert [percent(x) for x in (0.999, 1.0, 2.5, 0.0123)] == ["100 %", "100 %", "250 %", "1.2 %"]
    assert [against(*x) for x in ((1, 3.03), (88, 100), (120, 100), (1, 7.3), (61, 2), (1, 0))] == [
        "a third of", "12 % less than", "20 % more than", "14 % of", "30 times", "more than",
    ]  # fmt: skip
