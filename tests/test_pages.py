"""What README, CONTRIBUTING, docs and examples show runs, prints what they say, leads somewhere."""

import contextlib
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from bounded import finished
from test_house import PACKAGE, TIERS, is_module

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.results import show
from fpid_pin.control import fpid

ROOT = PACKAGE.parent
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md"))
README, CONTRIBUTING = (path.read_text(encoding="utf-8") for path in PAGES[:2])
SECTIONS = re.split(r"^## ", CONTRIBUTING, flags=re.MULTILINE)[1:]
RECIPES = {
    section.splitlines()[0].removeprefix("To add "): section
    for section in SECTIONS
    if section.startswith("To add ")
}
MOST_LINES = 25
#: One process for all: to begin takes longer than most of them do.
RUN = """
import runpy, sys

if __name__ == "__main__":
    for path in sys.argv[1:]:
        print("example", path, flush=True)
        runpy.run_path(path, run_name="__main__")
"""


def code(text, language="python"):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def alike(told, printed, tolerance=0.02):
    """Return whether two texts differ in their numbers alone, and these by little.

    Searches end elsewhere by the last digits on another machine.
    """
    ours, theirs = ([float(x) for x in NUMBER.findall(text)] for text in (told, printed))
    words = NUMBER.sub("#", told).split() == NUMBER.sub("#", printed).split()
    return words and np.allclose(ours, theirs, rtol=tolerance, atol=0.0)


def run(folder, *paths):
    """Run programs one after another, away from what this process has registered."""
    (folder / "run.py").write_text(RUN, encoding="utf-8")
    done = finished([sys.executable, "-W", "error", "run.py", *paths], cwd=folder, timeout=280)
    assert done.returncode == 0, done.stdout.splitlines()[-1] + done.stderr
    told = done.stdout.split("example ")[1:]
    return [text.removeprefix(f"{path}\n") for path, text in zip(paths, told, strict=True)]


@pytest.mark.parametrize("part", range(3))
def test_examples_run_and_each_says_something(part, tmp_path):
    paths = sorted((ROOT / "examples").glob("*.py"))[part::3]
    told = run(tmp_path, *paths)
    assert len(told) > 3
    assert all(told)


def cells(notebook):
    """Yield each cell of code of a notebook with what it has stored as printed."""
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            kinds = [output["output_type"] for output in cell["outputs"]]
            assert "error" not in kinds
            printed = [o["text"] for o in cell["outputs"] if o["output_type"] == "stream"]
            yield "".join(cell["source"]), "".join(line for text in printed for line in text)


def test_the_code_of_a_page_runs_from_top_to_bottom_and_prints_what_stands_there(tmp_path):
    """A block of text below one of code is what it prints, and so is a comment beside a print.

    Notebooks are pages, too.
    """
    pages = {}
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if code(text):
            pages[page.stem] = re.findall(
                r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```$)?", text, re.M | re.S
            )
    for notebook in sorted((ROOT / "examples").glob("*.ipynb")):
        assert notebook.stat().st_size < 400_000
        pages[notebook.stem] = list(cells(notebook))
    for name, blocks in pages.items():
        program = "".join(f'{block}\nprint("end of block")\n' for block, _ in blocks)
        (tmp_path / f"{name}.py").write_text(program, encoding="utf-8")
    assert len(pages) > 5
    told = run(tmp_path, *(f"{name}.py" for name in pages))
    for (name, blocks), printed in zip(pages.items(), told, strict=True):
        for (block, text), lines in zip(blocks, printed.split("end of block\n"), strict=False):
            assert not text or alike(text, lines), f"{name} prints {lines}"
            for comment in re.findall(r"^print\(.*\)  # (.*)$", block, re.M):
                assert any(alike(comment, line) for line in lines.splitlines()), (
                    f"{name} prints {lines}"
                )


def test_every_link_leads_somewhere_and_every_file_that_is_named_is_there():
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
    for name in re.findall(r"`([\w/]+(?:/|\.py|\.md))`", CONTRIBUTING):
        assert (ROOT / name).exists() or (PACKAGE / name).exists(), name


def test_what_the_demo_prints_is_what_the_readme_says(capsys):
    config = demo_config()
    show(config, fp.compare(config.conditions, config.controllers), Path("runs/demo"))
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert printed in [block.splitlines() for block in code(README, r"\w+")]


def test_ten_lines_of_python_print_what_stands_below_them():
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(next(block for block in code(README) if block.startswith("import fpid_pin")), {})
    assert printed.getvalue() in code(README, "text")


def test_the_law_that_is_quoted_is_the_law_that_runs():
    source = [line.strip() for line in Path(fpid.__file__).read_text().splitlines()]
    page = (ROOT / "docs/reading-the-paper.md").read_text(encoding="utf-8")
    quoted = page.split("```py\nc.s = ")[1].split("```")[0]
    where = 0
    for line in ("c.s = " + quoted).splitlines():
        if line != "...":
            where = source.index(line.strip(), where) + 1


def test_each_equation_of_the_paper_has_its_function_in_the_file_that_is_named():
    page = (ROOT / "docs/reading-the-paper.md").read_text(encoding="utf-8")
    named = re.findall(
        r"((?:`\w+`,? )+)[^|`]*\[`[\w/.]+`\]\(\.\./([^)]*py)\)", page.split("## Misprints")[0]
    )
    assert len(named) >= 20
    for functions, path in named:
        source = (ROOT / path).read_text(encoding="utf-8")
        for name in re.findall(r"\w+", functions):
            assert re.search(rf"^ *(def|class) {name}\b", source, re.M), f"{path}: {name}"


def test_it_is_read_in_one_sitting():
    assert len(README.splitlines()) <= 150


def test_a_release_is_told_by_one_number():
    cite, changes = ((ROOT / name).read_text() for name in ("CITATION.cff", "CHANGELOG.md"))
    assert f"\nversion: {fp.__version__}\n" in cite
    assert f"\n## [{fp.__version__}] - " in changes


def test_every_name_of_the_face_that_is_used_is_there():
    for path in set(re.findall(r"`fp\.([a-z_A-Z.]+)", README)) - {"something"}:
        thing = fp
        for name in path.split("."):
            thing = getattr(thing, name)


def test_each_recipe_has_one_short_example_and_what_it_asserts_is_true(tmp_path):
    assert list(RECIPES) == [
        "an arm", "a law", "a fractional law", "a fractional sliding surface",
        "a law of the whole robot", "a law in plain Python", "a reference", "a disturbance",
        "a cost", "a fractional design",
    ]  # fmt: skip
    assert len(code(CONTRIBUTING)) == len(RECIPES)
    paths = []
    for name, section in RECIPES.items():
        (example,) = code(section)
        lines = example.splitlines()
        assert len(lines) <= MOST_LINES
        assert max(map(len, lines)) <= 100
        assert any(line.startswith("assert ") for line in lines)
        paths.append(f"{name}.py".replace(" ", "_"))
        (tmp_path / paths[-1]).write_text(example, encoding="utf-8")
    run(tmp_path, *paths)


def test_the_table_is_the_house():
    rows = re.findall(r"^\| (`.*?) \|", CONTRIBUTING, re.MULTILINE)
    told = [set(re.findall(r"`(\w+)`", row)) for row in rows]
    assert told == [{room for room in tier if is_module(room)} for tier in TIERS]


def test_the_reference_of_configurations_is_as_the_package_has_it(tmp_path):
    # By itself: tests register kinds of their own.
    script, written = ROOT / "docs" / "configuration.py", tmp_path / "written.md"
    assert finished([sys.executable, script, written]).returncode == 0
    there = script.with_suffix(".md").read_text(encoding="utf-8")
    assert written.read_text(encoding="utf-8") == there, (
        "write it anew: python docs/configuration.py"
    )
