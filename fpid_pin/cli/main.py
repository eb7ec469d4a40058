"""The `fpid-pin` command: what its subcommands are, and how errors reach the user."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Annotated

import typer

from fpid_pin.exceptions import FpidError, FpidWarning

app = typer.Typer(
    help="Adaptive fractional-order PID control of robot arms on Pinocchio.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ConfigFile = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="What to simulate.")]
OutputPath = Annotated[Path | None, typer.Option("--out", help="Folder for the results.")]


@app.command()
def demo(out: OutputPath = None) -> None:
    """Run section 5.1 of the paper: fractional against integer adaptive PID."""
    from fpid_pin.cli.experiments import run_demo

    run_demo(out or Path("runs/demo"))


@app.command()
def run(
    config: ConfigFile,
    out: OutputPath = None,
    controller: Annotated[str | None, typer.Option(help="Which controller, by name.")] = None,
) -> None:
    """Simulate one controller of a configuration and record everything."""
    from fpid_pin.cli.experiments import run_one

    run_one(config, out or Path("runs") / config.stem, controller)


@app.command()
def compare(config: ConfigFile, out: OutputPath = None) -> None:
    """Simulate every controller of a configuration under every condition, side by side."""
    from fpid_pin.cli.experiments import run_comparison

    run_comparison(config, out or Path("runs") / config.stem)


def _plain_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int,
    file: object = None, line: str | None = None,
) -> None:  # fmt: skip
    text = str(message) if issubclass(category, FpidWarning) else f"{category.__name__}: {message}"
    sys.stderr.write(f"fpid-pin: warning: {text}\n")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; errors a user can act on are plain lines and exit status 2."""
    warnings.showwarning = _plain_warning
    try:
        app(args=arguments, standalone_mode=False)
    except FpidError as error:
        for text in str(error).splitlines():
            sys.stderr.write(f"fpid-pin: {text}\n")
        return 2
    except typer.Exit as leave:
        return int(leave.exit_code)
    except (typer.Abort, KeyboardInterrupt):
        sys.stderr.write("fpid-pin: stopped\n")
        return 130
    except Exception as error:
        # click's usage errors: an unknown command or option, a missing argument.
        show = getattr(error, "format_message", None)
        if show is None:
            raise
        sys.stderr.write(f"fpid-pin: {show()}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
