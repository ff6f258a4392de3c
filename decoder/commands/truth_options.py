"""The options by which commands are told of a truth: whose names, whose clock, which limits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from decoder.truth_request import AUTO, TIME_COLUMN, WINDOW_S


def _offset(_context: click.Context, _option: click.Parameter, value: str | None) -> str | float | None:
    if value is None or value == AUTO:
        return value
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is neither auto nor a number of seconds") from error


_OPTIONS = (
    click.option("--map", "map_file", type=click.Path(path_type=Path), metavar="YAML",
                 help="What the truth calls them."),
    click.option("--time", "time_column", metavar="COLUMN",
                 help=f"The truth's column of times.  [default: {TIME_COLUMN}]"),
    click.option("--offset", callback=_offset, metavar="auto|SECONDS", help="What to add to the truth's times."),
    click.option("--window", "window_s", type=click.FloatRange(min=1), default=WINDOW_S, show_default=True, metavar="S",
                 help="How far `--offset auto` looks, seconds to either side."),
    click.option("--limits", "wants_limits", is_flag=True, help="Judge parameters by published recorder accuracies."),
)  # fmt: skip


def truth_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds them: map_file, time_column, offset, window_s, wants_limits."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
