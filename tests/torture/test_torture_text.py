"""Whatever names say: pages, figures, Markdown and the terminal show it, and do nothing of it.

The references are others' parsers: Python's of HTML and XML, and markdown-it.
"""

import dataclasses
import io
import random
import re
import xml.etree.ElementTree as xml
from html.parser import HTMLParser

import pytest
from bounded import FULL
from markdown_it import MarkdownIt
from rich.console import Console

import fpid_pin as fp
from fpid_pin.cli import screen
from fpid_pin.cli.main import main
from fpid_pin.text import visible
from fpid_pin.view import plots, report_html
from fpid_pin.view.replay import replay_html
from fpid_pin.view.style import figure_bytes

pytestmark = pytest.mark.torture
PIECES = [
    "<script>hacked=1</script>", "</script>", "<img src=x onerror=hacked=1>", "<!--", "-->",
    "--!>", "]]>", "<![CDATA[", "</title>", "</svg>", "<svg onload=hacked=1>", '"', "'",
    '" onload="hacked=1', "&lt;", "&#60;", "&", "javascript:hacked=1", "{", "}", "{scripts}", "%s",
    "[red]", "[/]", "[link=http://evil.example]", "[bold", ":smile:", "|", "\\", "\\|", "`", "```",
    "**", "_", "__a__", "~~", "![a](b)", "[a](b)", "<http://evil.example>", "#", "# ", "- ", "+ ",
    "1. ", "2) ", "> ", "---", "===", "    ", "\t", "\n", "\r\n", "\n\n", "\u2028", "\x00",
    "\x1b[2J", "\x1b]8;;http://evil.example\x07", "\x07", "\x9b31m", "\u202e", "\u200b", "\ufeff",
    "\ufffe", "\ud800", "$", "$x^2$", "$\\frac{", "_nolegend_", "\\input", "e\u0301",
    "\U0001f600", "a", " ", "x" * 300,
]  # fmt: skip
#: Elements of matplotlib's figures.
DRAWN = {
    "svg", "metadata", "RDF", "Work", "type", "title", "format", "defs", "style", "g", "path",
    "use", "clipPath", "rect", "image",
}  # fmt: skip
QUIET = {"paragraph_open", "paragraph_close", "inline", "text", "softbreak"}


def names(seed, count):
    """Return hostile names: each piece on its own first, then what chance joins."""
    chance = random.Random(seed)
    joined = ("".join(chance.choices(PIECES, k=chance.randrange(2, 7))) for _ in range(count))
    return [*PIECES, *joined]


def few(count):
    return random.Random(2).sample(names(1, 400), count)


class Structure(HTMLParser):
    """The elements of a page and their attributes, what is drawn in a figure aside."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.found, self.inner, self.drawing = [], [], 0
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.drawing += tag == "svg"
        if not self.drawing:
            self.found.append((tag, tuple(key for key, _ in attributes)))
        self.inner += [value for key, value in attributes if key == "srcdoc"]

    def handle_endtag(self, tag):
        self.drawing -= tag == "svg"
        if not self.drawing:
            self.found.append(("/", tag))


def structure(page):
    seen = Structure(page)
    return seen.found + [structure(inner) for inner in seen.inner]


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.paper_experiment(duration=0.05), fp.paper_controller())


def law_called(name):
    return dataclasses.replace(fp.paper_controller(supervised=False), name=name)


def run_called(name):
    return fp.simulate(fp.paper_experiment(duration=0.02), law_called(name))


@pytest.mark.parametrize(("kind", "most"), [("report", 150), ("replay", 150), ("playground", 50)])
def test_a_page_has_the_elements_that_it_has_with_harmless_names(kind, most, tmp_path, tally):
    def page(name):
        if kind == "playground":
            job = fp.paper_experiment(duration=0.02)
            return fp.view.playground(job, law_called(name), title=name).text
        run = run_called(name)
        if kind == "replay":
            return replay_html([run], captions=[name], title=name)
        figures = {name: plots.torque(run)} if FULL else {}
        report_html(run, tmp_path / "report.html", title=name, tables={name: [{name: name}]},
                    figures=figures, config_text=name, captions=[name])  # fmt: skip
        return (tmp_path / "report.html").read_text("utf-8")

    expected = structure(page("x"))
    for name in filter(str.strip, few(most if FULL else 4)):
        same = structure(page(name)) == expected
        tally(f"names in a {kind}", "" if same else f"{name!r} makes elements")


def test_an_svg_is_well_formed_and_has_nothing_but_drawing_in_it(run, tally):
    for name in few(50 if FULL else 2):
        figure = plots.comparison([run_called(name), run])
        tree = xml.fromstring(figure_bytes(figure, "svg"))
        fault = ""
        for element in tree.iter():
            tag = element.tag.rpartition("}")[2]
            keys = {key.rpartition("}")[2] for key in element.keys()}  # noqa: SIM118
            link = [v for k, v in element.items() if k.endswith("href") and v[:1] != "#"]
            if tag not in DRAWN or any(k.startswith("on") for k in keys) or link:
                fault = f"{name!r}: {tag} {sorted(keys)} {link}"
        tally("names in an SVG", fault)


def parsed(text):
    return MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"]).parse(text)


def test_markdown_takes_a_name_for_text(tally):
    for name in names(3, 2000 if FULL else 40):
        rows = [{"controller": name, "figure": 1.0}, {"controller": "x", "figure": 2.0}]
        shown = visible(name).strip()
        where = {
            "a cell": (screen.markdown(rows), {"table", "thead", "tbody", "tr", "th", "td"}),
            "a heading": (f"# {screen.in_markdown(name)}\n", {"heading"}),
            "a list": (f"- {screen.in_markdown(name)}\n- x\n", {"bullet_list", "list_item"}),
        }
        for place, (text, kinds) in where.items():
            tokens = parsed(text)
            children = [child for token in tokens for child in token.children or ()]
            allowed = QUIET | {f"{kind}_{end}" for kind in kinds for end in ("open", "close")}
            strange = {token.type for token in (*tokens, *children)} - allowed
            lines = [
                "".join(c.content for c in t.children) for t in tokens if t.type == "inline"
            ]  # fmt: skip
            told = [line for line in lines if line.strip() == shown] or not shown
            fault = f"{name!r}: {sorted(strange)} {lines[:3]}" if strange or not told else ""
            tally(f"names in {place} of Markdown", fault)


def test_the_terminal_is_told_a_name_and_nothing_else(tally):
    for name in names(4, 2000 if FULL else 40):
        for coloured in (False, True):
            text = io.StringIO()
            console = screen.screen()
            own = Console(
                file=text, width=2000, force_terminal=coloured, markup=console._markup,
                emoji=console._emoji, highlight=False,
            )  # fmt: skip
            screen.say(name, console=own)
            told = text.getvalue() == visible(name) + "\n"
            tally("names on the screen", "" if told else f"{name!r}: {text.getvalue()!r}")
        screen.print_table([{"controller": name, "figure": 1.0}], name, console=own)
        plain = re.sub(r"\x1b\[[\d;]*m", "", text.getvalue())
        # A title wraps as text does; nothing else may happen to it.
        heard = all(c.isprintable() or c.isspace() for c in plain)
        tally("names in a table on the screen", "" if heard else f"{name!r}: {plain!r}")


def test_a_comparison_of_hostile_names_is_readable_everywhere(tmp_path, capsys, tally):
    sound = [name for name in names(5, 60) if "\ud800" not in name and name.strip()]
    chance = random.Random(6)
    for k in range(8 if FULL else 1):
        title, *chosen = chance.sample(sound, 5)
        laws = {name: law_called(name) for name in chosen}
        config, out = tmp_path / f"{k}.toml", tmp_path / str(k)
        text = fp.to_toml(fp.paper_experiment(duration=0.02), laws, title=title)
        config.write_text(text, encoding="utf-8")
        status = main(["compare", str(config), "--out", str(out)])
        said = capsys.readouterr()
        fault = f"{said.err}" if status else ""
        for line in f"{said.out}{said.err}".split("\n"):
            if not all(c.isprintable() or c.isspace() for c in line):
                fault = f"{line!r}"
        table = [t for t in parsed((out / "summary.md").read_text("utf-8")) if t.type == "tr_open"]
        if len(table) != 2 + 3 * len(laws):
            fault = f"{len(table)} rows in summary.md"
        for drawing in out.glob("*.svg"):
            xml.parse(drawing)
        tally("comparisons of hostile names", fault)
