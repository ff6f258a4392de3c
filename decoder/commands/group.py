"""Command groups that are tables: what a command is for stands in the table, its module is imported when it is run.

`decode --help` thereby imports none of them, and is quick.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import click

from decoder.interrupts import ends_at_once

CommandTable = Mapping[str, tuple[str, str]]
"""Name: the module that has the click command as `command`, and the line for the group's `--help`."""


class CommandGroup(click.Group):
    """The commands of a table, imported late."""

    def __init__(self, *, table: CommandTable, **options: Any) -> None:  # noqa: ANN401 - click's own, passed through
        super().__init__(**options)
        self.table = table

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """The names in the table."""
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        """The command of that name, its module imported now."""
        if cmd_name not in self.table:
            return None
        with ends_at_once():
            command: click.Command = importlib.import_module(self.table[cmd_name][0]).command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The help of every command from the table, so that `--help` imports none of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self.table.items()])
