"""A hook of mkdocs: pages that stand outside of `docs` are part of the site, too, and a playground.

The record of the benchmarks with its results, CONTRIBUTING and CHANGELOG stay where a repository
has them, and links between them and the pages work in both places. The notebooks of examples/ are
pages with what they have stored.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

import fpid_pin as fp

ROOT = Path(__file__).parents[1]
OUTSIDE = ("CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/RECORD.md", "benchmarks/results/*")


def on_files(files: Any, config: Any) -> Any:
    """Add the pages and pictures from outside, and the playground that `seeing-it.md` shows."""
    paper, law = fp.paper_experiment(duration=10.0), fp.paper_controller(supervised=False)
    page = fp.view.playground(paper, law, title="The paper's experiment")
    files.append(File.generated(config, "pages/playground.html", content=page.text))
    for pattern in OUTSIDE:
        for path in sorted(ROOT.glob(pattern)):
            name = path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path)))
    for path in sorted((ROOT / "examples").glob("*.ipynb")):
        page = "\n\n".join(shown(json.loads(path.read_text(encoding="utf-8"))))
        page = page.replace(".ipynb)", ".md)").replace("](../docs/", "](../")
        files.append(File.generated(config, f"examples/{path.stem}.md", content=page))
    return files


def shown(notebook: dict[str, Any]) -> Iterator[str]:
    """Yield a notebook's cells and what they have stored, as Markdown."""
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        yield text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```"
        for output in cell.get("outputs", []):
            kinds = {kind: "".join(data) for kind, data in output.get("data", {}).items()}
            image = next((kind for kind in kinds if kind.startswith("image/")), None)
            if image:
                yield f'<img alt="Figure" src="data:{image};base64,{kinds[image].strip()}">'
            elif "text/html" in kinds:
                page = re.sub(r"\n\s*\n", "\n", kinds["text/html"])
                # A caption would be as wide as its table, of which a phone shows a part.
                yield re.sub(r"(<table[^>]*>\s*)<caption>(.*?)</caption>", r"<p>\2</p>\1", page)
            else:
                printed = "".join(output.get("text", kinds.get("text/plain", "")))
                yield f"```text\n{printed.rstrip()}\n```"


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Let links lead to where a page has come to; to files that are no pages, nowhere."""
    own = Path(page.file.src_uri)
    inside = not any(own.match(pattern) for pattern in OUTSIDE)
    folder = ROOT / "docs" / own.parent if inside else ROOT / own.parent

    def moved(match: re.Match[str]) -> str:
        text, target, anchor = match.groups()
        place = (folder / target).resolve()
        if not place.is_relative_to(ROOT):
            return match[0]
        name = place.relative_to(ROOT).as_posix().removeprefix("docs/")
        if files.get_file_from_path(name) is None:
            return text if text[0] != "!" else ""
        up = "../" * (len(own.parts) - 1)
        return f"{text}({up}{name}{anchor or ''})"

    def bare(match: re.Match[str]) -> str:
        said = moved(match)
        return said if said != match[1] else match[1].strip("![]")

    return re.sub(r"(!?\[[^\]]*\])\(([^)#:\s]+)(#[^)\s]*)?\)", bare, markdown)
