"""The commands in one application, and what becomes of errors and warnings: one line, and an exit code for errors."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from typing import Annotated, cast

import typer

from topobelief.cli.benchmark import benchmark
from topobelief.cli.command import Command, PlaceCommand
from topobelief.cli.convert import convert
from topobelief.cli.datasets import datasets
from topobelief.cli.info import info
from topobelief.cli.plan import plan
from topobelief.cli.reproduce import reproduce
from topobelief.cli.ros import ros
from topobelief.cli.serve import serve
from topobelief.cli.simulate import simulate, simulate_compare
from topobelief.cli.study import study, study_report
from topobelief.errors import TopobeliefError

BAD_INPUT = 2
INTERRUPTED = 130

# what all errors about options derive from, which typer does not export
_UsageError = cast("type[Exception]", typer.BadParameter.__mro__[1])

app = typer.Typer(name="topobelief", pretty_exceptions_enable=False)
app.command(cls=PlaceCommand)(plan)
app.command(cls=PlaceCommand)(serve)
app.command(cls=Command, context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(ros)
app.command(cls=PlaceCommand)(info)
app.command(cls=Command)(convert)
app.command(cls=Command)(datasets)
app.command(cls=Command)(benchmark)
app.command(cls=Command)(reproduce)
app.command(cls=Command)(simulate)
app.command(cls=Command)(simulate_compare)
app.command(cls=Command)(study)
app.command(cls=Command)(study_report)


@app.callback(invoke_without_command=True)
def _topobelief(  # pyright: ignore[reportUnusedFunction]  (typer calls it)
    context: typer.Context,
    show_version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Where should a robot drive next, when its map is a pose graph?

    Ranks paths by the topology of the graph that they leave, with bounds on what that can cost.
    """
    if show_version:
        from topobelief.version import __version__  # slow to load

        typer.echo(f"topobelief {__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _warned
            code = app(args=None if arguments is None else list(arguments), prog_name="topobelief", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except TopobeliefError as error:
        return _failed(str(error))
    except _UsageError as error:
        describe = getattr(error, "format_message", error.__str__)  # which names the option
        command = getattr(getattr(error, "ctx", None), "command_path", "topobelief")
        return _failed(f"{describe().rstrip('.')}; see `{command} --help`")
    if code == INTERRUPTED:
        print("topobelief: interrupted; nothing was left half-written", file=sys.stderr)
    return int(code or 0)


def _failed(message: str) -> int:
    _say(message)
    return BAD_INPUT


def _warned(message: Warning | str, *_: object, **__: object) -> None:
    _say(f"warning: {message}")


def _say(message: str) -> None:
    print(f"topobelief: {' '.join(message.split())}", file=sys.stderr)
