"""Text made fit to be shown: visible, on one line, not too long; lists and tables of it.

Terminals obey control characters, and some characters turn a line around or hide what follows:
what is shown has them written out. What a message quotes may be as long as a file.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from html import escape
from typing import Any

#: Characters of a line in an error message, and of what it quotes.
MOST = 200
#: Characters of a name in a message, and names listed in one.
_NAME, _LISTED = 60, 3
#: Lines of a listing below its title.
_ROWS = 14
#: Parts that have a word, by how many of them make a whole.
_PARTS = {
    2: "half of", 3: "a third of", 4: "a quarter of", 5: "a fifth of", 10: "a tenth of",
    20: "a twentieth of", 30: "a thirtieth of", 100: "a hundredth of",
}  # fmt: skip
#: Units of joints that turn, and what they are of joints that slide.
_OF_SLIDES = {"N²m²s": "N²s", "N m": "N", "mrad": "mm", "rad": "m"}
_SLIDING = re.compile(rf"(?<!\w)({'|'.join(_OF_SLIDES)})(?![a-z])")
_CUT = re.compile(r"\.\.\. \(\d+ characters\)$")
# What `str.isspace` takes for white space although it ends a line or is a control character.
_BREAKS = "".join(map(chr, (*range(9, 14), *range(28, 32), 0x85, 0x2028, 0x2029)))


def visible(text: str, keep: str = "") -> str:
    r"""Write out, as Python does (``\n``, ``\x1b``, ``\u202e``), what has no shape of its own.

    These are control and format characters, line separators, halves of surrogate pairs, and
    characters that Unicode does not know; those in `keep` are left as they are.
    """
    if text.isprintable():
        return text
    return "".join(c if c in keep else _visible(c) for c in text)


def _visible(character: str) -> str:
    # Spaces of other widths count as unprintable; they do no harm.
    if character.isprintable() or (character.isspace() and character not in _BREAKS):
        return character
    return character.encode("unicode_escape").decode("ascii")


def cut(text: str, most: int = MOST) -> str:
    """Return at most `most` characters of `text`; one that was cut says how long it is, or was."""
    if len(text) <= most:
        return text
    before = _CUT.search(text)
    tail = before.group() if before else f"... ({len(text)} characters)"
    return text[: max(most - len(tail), 0)] + tail


def shown(value: object, most: int = MOST) -> str:
    """Return what Python writes for `value`, visible, on one line and cut.

    Of a text the length is its own, without quotes. What cannot be written at all is described.
    """
    if isinstance(value, str) and len(value) > most:
        return cut(f"{value[:most]!r}... ({len(value)} characters)", most)
    try:
        text = repr(value)
    except RecursionError:
        return f"a {type(value).__name__} nested too deeply to be written"
    except ValueError:
        # Python refuses to write whole numbers of more than some thousand digits.
        return f"a {type(value).__name__} too long to be written"
    return cut(visible(text), most)


def named(name: object) -> str:
    """Return a name as messages quote it."""
    return shown(name, _NAME)


def listed(names: Iterable[object], write: Callable[[object], str] = named) -> str:
    """Return names as messages list them: the first few, each as `write` has it."""
    several = list(names)
    return ", ".join(map(write, several[:_LISTED])) + (", ..." if several[_LISTED:] else "")


def differences(there: Any, here: Any, path: str = "") -> list[str]:
    """Return how two plain tables differ: a line for each key, with its path and both values."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        keys = sorted({*there, *here})
        pairs = [(key, there.get(key), here.get(key)) for key in keys]
        if there == here and list(there) != list(here):
            return [f"{path or 'keys'} in another order"]
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        pairs = [(k, *pair) for k, pair in enumerate(zip(there, here, strict=True))]
    elif there == here or (there != there and here != here):
        return []
    else:
        return [f"{path} is {named(there)} there and {named(here)} here"]
    dot = f"{path}." if path else ""
    return [line for key, one, two in pairs for line in differences(one, two, f"{dot}{key}")]


class ReprMixin:
    """What prints as a report: `repr` is its first line, a notebook has all of it."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {str(self).splitlines()[0]}>"

    def _repr_html_(self) -> str:
        return f"<pre>{fit(self, keep=chr(10))}</pre>"


def listing(title: str, rows: Iterable[tuple[str, Any, str]]) -> str:
    """Return a title and a line for each (name, plain value, unit), numbers with four digits.

    What fills no screen: of more than fourteen the last ones are counted.
    """
    found = [(name, cut(brief(value), 72), unit) for name, value, unit in rows]
    if found[_ROWS:]:
        found[_ROWS - 1 :] = [("...", f"and {len(found) - _ROWS + 1} more", "")]
    width = max((len(name) for name, _, _ in found), default=0)
    return "\n".join([title, *(f"  {n:{width}}  {v} {u}".rstrip() for n, v, u in found)])


def brief(value: Any) -> str:
    """Return a plain value on one line; numbers that are all alike are one."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{k} {brief(v)}" for k, v in value.items() if k != "kind")
        return f"{value['kind']} ({inner})" if "kind" in value else inner
    if isinstance(value, (list, tuple)):
        parts = list(map(brief, value))
        return parts[0] if len(set(parts)) == 1 else f"[{' '.join(parts)}]"
    return visible(str(value))


def unit_for(unit: str, angles: Collection[str]) -> str:
    """Return a unit of joints that turn as it is for joints whose angles are in these units.

    ``"N m/rad"`` is ``"N/m"`` where that is ``"m"``, and both where joints of both kinds are meant.
    """
    own = {"rad": unit, "m": _SLIDING.sub(lambda found: _OF_SLIDES[found[0]], unit)}
    return " or ".join(dict.fromkeys(own[angle] for angle in own if angle in angles))


def head_for(head: str, angles: Collection[str]) -> str:
    """Return the head of a column with its unit, ``"peak [N m]"``, for such joints."""
    return re.sub(r"(?<=\[).*(?=\]$)", lambda found: unit_for(found[0], angles), head)


def percent(part: float) -> str:
    """Return a part as a percentage of two digits: 12 %, 0.53 %, 100 %."""
    return f"{float(f'{100.0 * part:.2g}'):g} %"


def against(value: float, other: float) -> str:
    """Say how a positive number is to another: ``12 % less than``, ``a third of``, ``30 times``."""
    if not other:
        return "more than"
    part = value / other
    for parts, words in _PARTS.items():
        if abs(part * parts - 1.0) < 0.07:
            return words
    if part < 0.6:
        return f"{percent(part)} of"
    if part > 2.0:
        return f"{float(f'{part:.2g}'):g} times"
    return f"{percent(abs(1.0 - part))} {'less' if part < 1.0 else 'more'} than"


def enumerated(names: Sequence[str]) -> str:
    """Return names as a sentence has them: a, b and c."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def fit(value: Any, keep: str = "") -> str:
    """Return a value as text for HTML; a number with four significant digits."""
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return escape(visible(text, keep=keep))


def html_table(caption: object, head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; everything in it is escaped."""
    lines = [f"<caption>{fit(caption)}</caption>"]
    lines.append("<tr>" + "".join(f"<th>{fit(cell)}</th>" for cell in head) + "</tr>")
    lines += ["<tr>" + "".join(f"<td>{fit(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return "<table>" + "\n".join(lines) + "</table>"
