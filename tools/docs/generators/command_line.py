"""The page of the command line: each subcommand with its help text and a table of its options."""

from __future__ import annotations

import re
from collections import Counter
from typing import Final

import click

from sim_action.cli.main import program
from tools.docs.generators.markdown import bullets, escaped

# The end of a help text that states a default in words.
_DEFAULT: Final = re.compile(r"\s*\[default: (.*)\]$")


MIN_SHARED: Final = 3  # commands that take the same option, which is then listed once


def commands() -> str:
    """Return a section for each subcommand; a paragraph that several have stands in the first one."""
    counted = Counter(option for command in program.commands.values() for option in _options(command))
    shared = {option for option, number in counted.items() if number >= MIN_SHARED}
    listed = [option for option in counted if option in shared]
    shared_text = "Several commands take these; `sim-action COMMAND --help` lists all options of one:"
    head = f"## Shared options\n\n{shared_text}\n\n{bullets(listed)}\n"
    seen: set[str] = set()
    first: dict[tuple[str, str], str] = {}
    return head + "\n".join(_section(command, shared, seen, first) for command in program.commands.values())


def _section(
    command: click.Command, shared: set[tuple[str, str]], seen: set[str], first: dict[tuple[str, str], str]
) -> str:
    """Return the section of a command; `seen`, `first`: paragraphs and options (of which command) above it."""
    arguments = [parameter for parameter in command.params if isinstance(parameter, click.Argument)]
    usage = " ".join(["sim-action", command.name or "", *map(_argument, arguments)])
    paragraphs = [" ".join(paragraph.split()) for paragraph in (command.help or "").strip().split("\n\n")]
    options = _options(command)
    fresh = [text for text in paragraphs if text not in seen and not text.startswith("Exit code")]
    seen.update(fresh[1:])
    parts = [f"## `sim-action {command.name}`\n", *(f"{escaped(text)}\n" for text in fresh)]
    if arguments:
        parts.append(f"```text\n{usage}\n```\n")
    again: dict[str, list[str]] = {}
    for option in options:
        if option not in shared and option in first:
            again.setdefault(first[option], []).append(option[0])
    fresh_options = [option for option in options if option not in shared and option not in first]
    first |= dict.fromkeys(fresh_options, command.name or "")
    own = bullets([*fresh_options, *((", ".join(names), f"As for `{name}`.") for name, names in again.items())])
    return "\n".join([*parts, *([own] if own else [])])


def _argument(argument: click.Argument) -> str:
    name = argument.metavar or (argument.name or "").upper()
    if isinstance(argument.type, click.Choice) and not argument.metavar:
        name = "|".join(map(str, argument.type.choices))
    many = "..." if argument.nargs == -1 and "..." not in name else ""
    return f"{name}{many}" if argument.required or name.startswith("[") else f"[{name}]{many}"


def _options(command: click.Command) -> list[tuple[str, str]]:
    return [(f"`{_names(option)}`", _help(option)) for option in _shown(command)]


def _shown(command: click.Command) -> list[click.Option]:
    return [option for option in command.params if isinstance(option, click.Option) and not option.hidden]


def _help(option: click.Option) -> str:
    default = _default(option)
    return f"{_meaning(option)} Default: {default}." if default else _meaning(option)


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
    if option.show_default and isinstance(option.default, str | int | float):
        return f"`{option.default}`"
    return ""
