"""Arguments and options of the commands."""

from pathlib import Path
from typing import Annotated

import typer

# Of most commands.
ConfigFile = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="Configuration file.")]
AllowImport = Annotated[
    bool, typer.Option("--allow-import", help="Run the Python files that the file imports.")
]
Chosen = Annotated[str | None, typer.Option(help="Name of the controller.")]
Condition = Annotated[str | None, typer.Option(help="Name of the condition.")]
Page = Annotated[Path | None, typer.Option(help="Write one HTML page.")]

# Of those that simulate.
OutputPath = Annotated[Path | None, typer.Option("--out", help="Folder for the results.")]
Every = Annotated[int, typer.Option(help="Save only every Nth row of a run.")]
NoRuns = Annotated[bool, typer.Option("--no-runs", help="Save no runs.")]
Png = Annotated[bool, typer.Option("--png", help="Also write figures as PNG.")]
NoFigures = Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")]
Workers = Annotated[int | None, typer.Option(help="Threads (plain Python laws: processes).")]
Dask = Annotated[str | None, typer.Option(help="Dask scheduler to use: tcp://127.0.0.1:8786.")]

# Of an arm.
ArmName = Annotated[str, typer.Argument(metavar="ARM", help="A name from `arms`, or a robot file.")]
Locks = Annotated[list[str] | None, typer.Option(help="Hold a joint: NAME=VALUE; repeatable.")]
Tip = Annotated[str | None, typer.Option(metavar="TIP", help="Last link; hold the other joints.")]
PackageDirs = Annotated[list[Path] | None, typer.Option(help="Folder with meshes; repeatable.")]
Inertia = Annotated[
    str | None,
    typer.Option(metavar="nearest|accept", help="What to do with an impossible inertia."),
]
Tool = Annotated[str | None, typer.Option(metavar="FRAME", help="The tool's frame.")]

# Of a view.
Browser = Annotated[bool, typer.Option(help="Open the browser.")]
Port = Annotated[int | None, typer.Option(help="Port on 127.0.0.1.")]
