"""Compare the numbers that README and docs publish with the stored output that stands beside them.

    python docs/published_numbers.py

A page is cut at its headings. A number in a section's sentences and tables is in a file that the
section names, by a link or in `code`: the stored output of a script of benchmarks/ (naming
one of the two names both), or a file of the repository that is no page, such as the file of a law
for its defaults; or in a block of code on the page, which the tests run. It may be rounded, to two
digits at least. Left out are code and HTML, labels such as (22), section 5.1, [3] and years, and
whole numbers up to 10. The file to name is the one that the number is from: in a large one any
number of two digits is found.

A table that begins like one of the stored output which its section names is written as it stands
there, and the numbers that are nowhere are printed. `benchmarks/record.py` does this, too.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: But the one that is written from the descriptions.
PAGES = (
    ROOT / "README.md",
    *sorted(p for p in (ROOT / "docs").glob("*.md") if p.name != "configuration.md"),
)
NUMBER = re.compile(
    r"(?<![\w.^])(?<![A-Za-z]-)(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)"
)
LABEL = re.compile(
    r"^\[\d\] (?:.+\n?)*|\(\d+\)|\[\d+\]|section \d\S*|\b(?:19|20)\d\d\b",
    re.IGNORECASE | re.MULTILINE,
)
BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def sections(text: str) -> list[str]:
    """Cut a page at its headings, those in blocks of code apart."""
    hidden = BLOCK.sub(lambda block: "\0" * len(block[0]), text)
    starts = [0, *(found.start() for found in re.finditer(r"^#+ ", hidden, re.MULTILINE))]
    return [text[a:b] for a, b in zip(starts, [*starts[1:], len(text)], strict=True)]


def named(section: str, folder: Path) -> set[Path]:
    """Return the files that a section names and that are no pages; a script with its output."""
    links = {folder / name for name in re.findall(r"\]\(([^)#\s]+)", section)}
    spans = {ROOT / name for name in re.findall(r"`(?:python )?([\w./-]+\.\w+)[^`]*`", section)}
    files = {path.resolve() for path in links | spans if path.is_file()}
    results = ROOT / "benchmarks" / "results"
    for path in tuple(files):
        if path.parent == results or path.parent == results.parent:
            files |= {results / f"{path.stem}.md", results.parent / f"{path.stem}.py"}
    return {
        path
        for path in files
        if path.is_file()
        and ((path.parent == results and path.suffix == ".md") or path.suffix in (".py", ".toml"))
    }


def numbers(text: str) -> Iterator[tuple[str, float, float]]:
    """Yield each number as it is written, its value, and how much it may be rounded by."""
    for found in NUMBER.findall(text):
        digits, _, exponent = found.replace(",", "").partition("e")
        unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
        exact = len(digits.replace(".", "").lstrip("0")) < 2
        yield found, float(found.replace(",", "")), 0.0 if exact else 0.5 * unit


def missing(text: str, folder: Path) -> list[str]:
    """Return what a page publishes and nothing beside it holds: a section's title and a number."""
    blocks, lacking = " ".join(BLOCK.findall(text)), []
    for section in sections(text):
        files = [path.read_text(encoding="utf-8") for path in named(section, folder)]
        stored = " ".join([blocks, *files]).replace("_", "")
        known = [value for _, value, _ in numbers(stored)]
        prose = BLOCK.sub("", section)
        prose = re.sub(
            r"^    .*$|`[^`]*`|<\w[^>]*>|(?<=\])\([^)]*\)", "", prose, flags=re.MULTILINE
        )
        for written, value, room in numbers(LABEL.sub("", prose)):
            free = value <= 10.0 and re.fullmatch(r"\d+", written)
            near = 1e-9 * value + room
            if not free and not any(abs(value - other) <= near for other in known):
                lacking.append(f"{section.splitlines()[0]}: {written}")
    return lacking


def head(table: str) -> str:
    """Return the first line of a table, by which it is known."""
    return table.partition("\n")[0]


def renewed(text: str, folder: Path) -> str:
    """Return a page with its tables as the stored output has them."""
    parts = []
    for section in sections(text):
        stored = [
            table
            for path in sorted(named(section, folder))
            if path.suffix == ".md"
            for table in TABLE.findall(path.read_text(encoding="utf-8"))
        ]

        def newest(match: re.Match[str], stored: list[str] = stored) -> str:
            for k, table in enumerate(stored):
                if head(table) == head(match[0]):
                    return stored.pop(k)
            return match[0]

        parts.append(TABLE.sub(newest, section))
    return "".join(parts)


def main() -> int:
    """Renew the tables of all pages; return how many numbers are nowhere."""
    lacking = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        new = renewed(text, page.parent)
        if new != text:
            page.write_text(new, encoding="utf-8")
            print(f"{page.name}: tables renewed")
        lacking += [f"{page.name}: {where}" for where in missing(new, page.parent)]
    print("\n".join([*lacking, f"{len(lacking)} numbers are in nothing that stands beside them"]))
    return len(lacking)


if __name__ == "__main__":
    sys.exit(min(main(), 1))
