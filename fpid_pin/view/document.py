"""A page that is one text: it asks for nothing and runs no script but those it was made with."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib import resources
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


def document(
    title: str, *, style: str, body: str, scripts: Sequence[str] = (), comment: str = "",
    live: bool = False, embedded: str = "",
) -> str:  # fmt: skip
    """Return a whole page.

    Parameters
    ----------
    title
        Plain text.
    style, body, scripts
        CSS; HTML; scripts in the order in which they run, after the body.
    comment
        For who reads the page's source.
    live
        Whether it may connect to this machine.
    embedded
        A page in a frame of this one, which this one's policy binds as well: it names its scripts.
    """
    codes = [closed(script) for script in scripts]
    policy = _policy(codes, _hashes_of(embedded)) + _LIVE * live
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


def _policy(scripts: Sequence[str], others: Sequence[str] = ()) -> str:
    hashes = [f"'sha256-{_digest(script)}'" for script in scripts]
    return _POLICY.format(scripts=" ".join([*hashes, *others]) or "'none'")


def _hashes_of(page: str) -> list[str]:
    policy = page.partition('http-equiv="Content-Security-Policy" content="')[2].partition('"')[0]
    return re.findall(r"'sha256-[^']*'", policy)


def _digest(script: str) -> str:
    # A browser makes all ends of lines alike before it looks.
    text = script.replace("\r\n", "\n").replace("\r", "\n")
    return base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
