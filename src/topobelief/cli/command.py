"""How a command line is read: no option is silently dropped, places take one to three values, and errors name options."""

from __future__ import annotations

from collections import Counter
from typing import Any

import typer
from typer.core import TyperCommand

from topobelief.cli.options_as_typed import name_options
from topobelief.errors import TopobeliefError


class Command(TyperCommand):
    """A command that refuses an option given twice, because the first value would be dropped silently.

    Errors of the library name its options in place of arguments.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as usual, after the check."""
        _, _, order = self.make_parser(ctx).parse_args(args=list(args))
        for parameter, count in Counter(order).items():
            if count > 1 and not getattr(parameter, "multiple", True) and not getattr(parameter, "is_flag", True):
                times = "twice" if count == 2 else f"{count} times"
                raise typer.BadParameter(f"expected it once, got it {times}.", ctx=ctx, param_hint=f"'{parameter.opts[0]}'")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run as usual."""
        try:
            return super().invoke(ctx)
        except TopobeliefError as error:
            name_options(error, self.params)
            raise


class PlaceCommand(Command):
    """A command whose options --start, --goal and --origin take up to three numbers."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as usual, the numbers after such an option taken as one value."""
        for option in ("--start", "--goal", "--origin"):
            args = _numbers_joined(args, option)
        return super().parse_args(ctx, args)


def _numbers_joined(args: list[str], option: str) -> list[str]:
    """Arguments in which the numbers that follow the value of an option, two at most, are part of that value.

    Examples
    --------
    >>> _numbers_joined(["--start", "1", "-2.5", "graph.g2o"], "--start")
    ['--start', '1 -2.5', 'graph.g2o']
    >>> _numbers_joined(["--start", "1", "-2.5", "3", "4"], "--start")
    ['--start', '1 -2.5 3', '4']
    """
    joined: list[str] = []
    for arg in args:
        value = joined[-1].removeprefix(f"{option}=") if joined else ""
        of_option = value != joined[-1] if joined else False
        if joined and (of_option or joined[-2:-1] == [option]) and _are_numbers(value) and _is_number(arg):
            joined[-1] += f" {arg}"
        else:
            joined.append(arg)
    return joined


def _are_numbers(text: str) -> bool:
    """One number, or two."""
    return len(text.split()) in (1, 2) and all(map(_is_number, text.split()))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
