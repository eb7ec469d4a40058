"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fpid_pin import own_code

ConfigFile = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="What to simulate.")]


def _allow(given: bool) -> bool:
    own_code.allowed.set(given)
    return given


AllowImport = Annotated[
    bool,
    typer.Option("--allow-import", callback=_allow, help="Run the Python files it imports."),
]
Workers = Annotated[int | None, typer.Option(help="Threads, or processes for laws in Python.")]
Dask = Annotated[str | None, typer.Option(help="Or a scheduler: tcp://127.0.0.1:8786.")]
Page = Annotated[Path | None, typer.Option(help="Write one page that opens anywhere.")]
