"""A page that is one text: it asks for nothing and runs no script but those it was made with."""

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from fpid_pin.text import cut, visible

# Nothing may be fetched, and no script runs but those named by their hashes: whatever a run's file
# says, the page neither calls home nor does what the file wants. The playground's engine is a
# worker made from the page's own text; what that may do is bound by this policy, too.
_POLICY = (
    "default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; "
    "img-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'"
)
_LIVE = "; connect-src ws://127.0.0.1:* ws://localhost:*"

# What ends a script's element, or keeps its end from being one; both stand in texts alone.
_ENDS = re.compile(r"<(/script|!--)", re.IGNORECASE)

_DOCUMENT = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>{style}</style>
{comment}</head>
<body>
{body}
{scripts}</body>
</html>
"""


@cache
def asset(name: str) -> str:
    """Return the text of a file of this room's assets."""
    return (resources.files("fpid_pin.view") / "assets" / name).read_text(encoding="utf-8")


def as_text(text: str, keep: str = "") -> str:
    """Return what HTML shows as this text, control characters but those to `keep` written out."""
    return escape(visible(text, keep))


class Link(NamedTuple):
    """Words of a page that lead elsewhere: to a file beside it, say."""

    text: str
    href: str

    @property
    def html(self) -> str:
        """The link as an element."""
        return f'<a href="{as_text(self.href)}">{as_text(self.text)}</a>'


class Page:
    """A page that is there; in a notebook it shows itself, shut off from what is around.

    Attributes
    ----------
    text
        HTML.
    path
        Where it was written; None: nowhere.
    """

    def __init__(
        self, text: str, kind: str, height: int, path: Path | None = None,
        rights: str = "allow-scripts",
    ) -> None:  # fmt: skip
        self.text, self.path = text, path
        self._kind, self._height, self._rights = kind, height, rights

    def __repr__(self) -> str:
        return f"<{self._kind}, {len(self.text.encode()) / 1e6:.2f} MB>"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self._height}px; border: 1px solid #8884"
        return framed(self.text, f'title="{self._kind}" style="{style}"', self._rights)


def framed(page: str, attributes: str, rights: str = "allow-scripts") -> str:
    """Return a page in a frame within another, shut off from it."""
    return f'<iframe sandbox="{rights}" {attributes} srcdoc="{escape(page)}"></iframe>'


def document(
    title: str, *, style: str, body: str, scripts: Sequence[str] = (), comment: str = "",
    live: bool = False, embedded: str = "",
) -> str:  # fmt: skip
    """Return a whole page; its scripts run in their order, after the body.

    `comment` is for who reads the page's source; `live`: it may connect to this machine. What is
    `embedded`, a page in a frame of this one, is bound by this one's policy as well, which
    therefore names its scripts.
    """
    codes = [closed(script) for script in scripts]
    inner = embedded.partition('http-equiv="Content-Security-Policy" content="')[2].partition('"')
    hashes = [*map(_hash, codes), *re.findall(r"'sha256-[^']*'", inner[0])]
    policy = _POLICY.format(scripts=" ".join(hashes) or "'none'") + _LIVE * live
    kept = comment.replace("--", "- -").replace(">", "")
    return _DOCUMENT.format(
        policy=policy,
        title=as_text(cut(title)),
        style=asset("page.css") + style,
        comment=f"<!--\n{kept}\n-->\n" if kept else "",
        body=body,
        scripts="".join(f"<script>{code}</script>\n" for code in codes),
    )


def closed(script: str) -> str:
    """Return a script in which no text ends the element that it stands in."""
    return _ENDS.sub(r"<\\\1", script)


def _hash(script: str) -> str:
    # A browser makes all ends of lines alike before it looks.
    text = script.replace("\r\n", "\n").replace("\r", "\n")
    digest = base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
    return f"'sha256-{digest}'"
