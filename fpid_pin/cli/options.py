"""Arguments and options of the commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

# Of most commands.
ConfigFile = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="What to simulate.")]
AllowImport = Annotated[
    bool, typer.Option("--allow-import", help="Run the Python files it imports.")
]
Chosen = Annotated[str | None, typer.Option(help="Which controller, by name.")]
Condition = Annotated[str | None, typer.Option(help="Under which condition, by name.")]
Page = Annotated[Path | None, typer.Option(help="Write one page that opens anywhere.")]

# Of those that simulate.
OutputPath = Annotated[Path | None, typer.Option("--out", help="Folder for the results.")]
Every = Annotated[int, typer.Option(help="Save one row of a run in so many.")]
NoRuns = Annotated[bool, typer.Option("--no-runs", help="Save no runs.")]
Png = Annotated[bool, typer.Option("--png", help="Draw figures as PNG, too.")]
NoFigures = Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")]
Workers = Annotated[int | None, typer.Option(help="Threads, or processes for laws in Python.")]
Dask = Annotated[str | None, typer.Option(help="Or a scheduler: tcp://127.0.0.1:8786.")]

# Of an arm.
ArmName = Annotated[str, typer.Argument(metavar="ARM", help="A name of `arms`, or a robot's file.")]
Locks = Annotated[list[str] | None, typer.Option(help="Hold a joint: NAME=VALUE; repeat.")]
Tip = Annotated[str | None, typer.Option(metavar="TIP", help="The arm's last link; hold the rest.")]
PackageDirs = Annotated[list[Path] | None, typer.Option(help="Where meshes are; repeat.")]
Inertia = Annotated[
    str | None,
    typer.Option(metavar="nearest|accept", help="Of a link's inertia that no body has."),
]
Tool = Annotated[str | None, typer.Option(metavar="FRAME", help="The tool's frame.")]

# Of a view.
Browser = Annotated[bool, typer.Option(help="Open the browser.")]
Port = Annotated[int | None, typer.Option(help="Of the view, on 127.0.0.1.")]
