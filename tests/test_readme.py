"""What README prints is what is printed, and the law that is quoted is the one that runs."""

import contextlib
import io
import re
from pathlib import Path

import fpid_pin as fp
from fpid_pin.control import fpid

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
#: Code blocks and their languages, in order.
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def block(start):
    (text,) = (text for _, text in BLOCKS if text.startswith(start))
    return text


def test_what_the_demo_prints_is_what_the_readme_says(monkeypatch, capsys):
    from fpid_pin.cli.configuration import demo_config
    from fpid_pin.cli.results import show

    config = demo_config()
    show(config, fp.compare(config.conditions, config.controllers), Path("runs/demo"))
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert block("Least RMS error").splitlines() == printed


def test_ten_lines_of_python_print_what_stands_below_them():
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(block("import fpid_pin as fp"), {})
    assert ("text", printed.getvalue()) in BLOCKS


def test_the_law_that_is_quoted_is_the_law_that_runs():
    source = [line.strip() for line in Path(fpid.__file__).read_text().splitlines()]
    page = (Path(__file__).parents[1] / "docs/reading-the-paper.md").read_text(encoding="utf-8")
    quoted = page.split("```python\nc.s = ")[1].split("```")[0]
    where = 0
    for line in ("c.s = " + quoted).splitlines():
        if line != "...":
            where = source.index(line.strip(), where) + 1


def test_every_name_of_the_face_that_is_used_is_there():
    for path in set(re.findall(r"`fp\.([a-z_A-Z.]+)", README)) - {"something"}:
        thing = fp
        for name in path.split("."):
            thing = getattr(thing, name)
