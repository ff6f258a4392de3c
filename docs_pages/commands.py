"""A page for a program: what `--help` says, of every command."""

from __future__ import annotations

from collections.abc import Iterator

import click

WIDTH = 100


def command_pages(name: str, program: click.Group) -> str:
    """Sections, one for the program and one for each command below it."""
    return "\n\n".join(_section(path, command) for path, command in _commands(name, program))


def command_names(name: str, program: click.Group) -> list[str]:
    """The words that call each command, the program's own first."""
    return [path for path, _ in _commands(name, program)]


def _commands(path: str, command: click.Command) -> Iterator[tuple[str, click.Command]]:
    yield path, command
    if isinstance(command, click.Group):
        context = click.Context(command, info_name=path)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                yield from _commands(f"{path} {name}", below)


def _section(path: str, command: click.Command) -> str:
    context = click.Context(
        command, info_name=path, terminal_width=WIDTH, max_content_width=WIDTH, **command.context_settings
    )
    return f"## `{path}`\n\n```\n{command.get_help(context)}\n```"
