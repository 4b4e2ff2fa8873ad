"""The page of the command line: each subcommand with its help text and a table of its options."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

import click

from sim_action.cli.main import program
from tools.docs.generators.markdown import escaped, table

# The end of a help text that states a default in words.
_DEFAULT: Final = re.compile(r"\s*\[default: (.*)\]$")


def overview() -> str:
    """Return the table of subcommands; each links to its section."""
    rows = (
        (f"[`{command.name}`](#sim-action-{command.name})", _first_line(command))
        for command in program.commands.values()
    )
    return table(("command", "purpose"), rows)


def commands() -> str:
    """Return a section for each subcommand."""
    return "\n".join(_section(command) for command in program.commands.values())


def _first_line(command: click.Command) -> str:
    return escaped(" ".join((command.help or "").strip().split("\n\n")[0].split()))


def _section(command: click.Command) -> str:
    arguments = [parameter for parameter in command.params if isinstance(parameter, click.Argument)]
    usage = " ".join(["sim-action", command.name or "", "[OPTIONS]", *map(_argument, arguments)])
    paragraphs = (" ".join(paragraph.split()) for paragraph in (command.help or "").strip().split("\n\n"))
    text = "\n\n".join(escaped(paragraph) for paragraph in paragraphs)
    options = list(_options(command))
    parts = [f"## `sim-action {command.name}`\n", f"{text}\n", f"```text\n{usage}\n```\n"]
    if options:
        parts.append(table(("option", "meaning", "default"), options))
    return "\n".join(parts)


def _argument(argument: click.Argument) -> str:
    name = argument.metavar or (argument.name or "").upper()
    if isinstance(argument.type, click.Choice) and not argument.metavar:
        name = "|".join(map(str, argument.type.choices))
    many = "..." if argument.nargs == -1 and "..." not in name else ""
    return f"{name}{many}" if argument.required or name.startswith("[") else f"[{name}]{many}"


def _options(command: click.Command) -> Iterator[tuple[str, str, str]]:
    for option in command.params:
        if isinstance(option, click.Option) and not option.hidden:
            yield f"`{_names(option)}`", _meaning(option), _default(option)


def _names(option: click.Option) -> str:
    names = ", ".join(sorted(option.opts, key=len))
    if option.secondary_opts:
        names += f" / {', '.join(option.secondary_opts)}"
    return names if option.is_flag else f"{names} {_value(option)}"


def _value(option: click.Option) -> str:
    if option.metavar:
        return option.metavar
    if isinstance(option.type, click.Choice):
        return "|".join(map(str, option.type.choices))
    return option.type.name.upper()


def _meaning(option: click.Option) -> str:
    return escaped(_DEFAULT.sub("", option.help or "").rstrip())


def _default(option: click.Option) -> str:
    if stated := _DEFAULT.search(option.help or ""):
        return escaped(stated[1])
    if option.required:
        return "required"
    if option.show_default and isinstance(option.default, str | int | float):
        return f"`{option.default}`"
    return ""
