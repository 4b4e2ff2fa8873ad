"""The entry point of the command line: it runs a subcommand, reports its errors and returns the exit code."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Final, NoReturn

import click
from typing_extensions import override

from sim_action.cli import SUBCOMMANDS
from sim_action.cli.options import complain
from sim_action.core.errors import ExitCode, SimActionError, SystemRefusal, is_refusal
from sim_action.core.process import BEFORE_IMPORTS, forgive_closed_output, release_signals
from sim_action.core.version import __version__
from sim_action.core.wording import escaped_line


def main() -> NoReturn:
    """Run the command line of this process and exit."""
    # Open /dev/null for each standard stream that the shell has closed (`>&-`). Otherwise the next file that is opened
    # gets the number of the stream, and printed text goes into that file.
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)
            # A caller that replaces the stream must not close the descriptor: another file may have it by then.
            setattr(sys, name, os.fdopen(descriptor, "w" if descriptor else "r", closefd=False))
    leave(call(sys.argv[1:]))


def leave(code: int) -> NoReturn:
    """Flush the output and end the process."""
    for stream in (sys.stdout, sys.stderr):
        # The reader, or the terminal, may have gone.
        with suppress(OSError):
            stream.flush()
    # Shutting the interpreter down takes longer than reading a scenario.
    os._exit(code)


def call(arguments: Sequence[str], inputs: Mapping[str, str] | None = None) -> int:
    """Run a command line and return its exit code; errors name `inputs` of the action for their options."""
    os.environ.update(BEFORE_IMPORTS)
    leave_out_plugins()
    try:
        return program.main(list(arguments), standalone_mode=False, prog_name="sim-action") or ExitCode.PASSED
    except click.ClickException as error:
        # Name the environment variable in an error about a value that came from one.
        if isinstance(error, click.BadParameter) and error.ctx is not None and error.param is not None:
            source = error.ctx.get_parameter_source(error.param.name or "")
            if source is click.core.ParameterSource.ENVIRONMENT:
                error.param_hint = f"the variable {error.param.envvar}"
        complain(_with_inputs(error.format_message(), inputs))
        if isinstance(error, click.UsageError) and error.ctx and inputs is None:
            click.echo(f"Try '{error.ctx.command_path} --help'.", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        return ExitCode.INTERRUPTED
    except SimActionError as error:
        for line in str(error).split("\n"):
            complain(_with_inputs(line, inputs))
        return error.exit_code
    except BrokenPipeError:
        # The reader of our output has gone.
        return ExitCode.FAILED
    except Exception as error:  # noqa: BLE001 - the last place where it can be caught
        return _report_unexpected(error)


def leave_out_plugins() -> None:
    """Spare this process the import of pydantic's search for plugins, which takes longer than reading a scenario.

    If another version of pydantic needs more from this module, or has no such module, it gets its own.
    """
    name = "pydantic.plugin._loader"
    if name in sys.modules:
        return
    loader = sys.modules[name] = ModuleType(name)

    def attribute_of(attribute: str) -> object:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        sys.modules.pop(name, None)
        return getattr(import_module(name), attribute)

    vars(loader).update(get_plugins=tuple, __getattr__=attribute_of)


def _with_inputs(message: str, inputs: Mapping[str, str] | None) -> str:
    """Return a message with the names of inputs instead of options."""

    def named(option: re.Match[str]) -> str:
        return f"the input {inputs[option[1]]}" if inputs and option[1] in inputs else option[0]

    return re.sub(r"(?<!\S)'?(--[a-z-]+)\b'?(?: / '-[a-z]')?", named, message)


def _report_unexpected(error: Exception) -> ExitCode:
    """Print an error that no other code expects, and return the exit code."""
    if is_refusal(error):
        complain(escaped_line(str(SystemRefusal(error))))
        return ExitCode.FAILED
    if isinstance(error, FileNotFoundError) and error.filename is None:
        from sim_action.core.workspace import path_problem

        complain(path_problem(error))
        return ExitCode.INVALID
    sys.excepthook(type(error), error, error.__traceback__)
    click.echo("sim-action: this is an internal error of sim-action; please report it with the lines above", err=True)
    return ExitCode.INTERNAL


_HYPHEN: Final = "\N{NON-BREAKING HYPHEN}"


class _HelpFormatter(click.HelpFormatter):
    """Wraps lines at spaces only: an option or a package that is broken at a hyphen cannot be copied."""

    @override
    def write_text(self, text: str) -> None:
        super().write_text(text.replace("-", _HYPHEN))

    @override
    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        super().write_dl([(name, words.replace("-", _HYPHEN)) for name, words in rows], col_max, col_spacing)

    @override
    def getvalue(self) -> str:
        return super().getvalue().replace(_HYPHEN, "-")


class _Context(click.Context):
    formatter_class = _HelpFormatter


class _Subcommands(Mapping[str, click.Command]):
    """The subcommands by name; the module of each is imported when it is asked for."""

    def __getitem__(self, name: str) -> click.Command:
        command: click.Command = getattr(import_module(f"sim_action.cli.{SUBCOMMANDS[name].module}"), name)
        command.context_class = _Context
        return command

    def __iter__(self) -> Iterator[str]:
        return iter(SUBCOMMANDS)

    def __len__(self) -> int:
        return len(SUBCOMMANDS)


class _Program(click.Group):
    @override
    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, SUBCOMMANDS[name].purpose) for name in self.list_commands(ctx)])


@click.group(
    cls=_Program,
    commands=_Subcommands(),
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
    subcommand_metavar="COMMAND [ARGS]...",
)
@click.version_option(__version__, prog_name="sim-action")
@click.pass_context
def program(context: click.Context) -> None:
    """Test robots in simulation: run YAML scenarios in a headless physics engine and report verdicts.

    Many options can also be set by environment variables, such as SIM_ACTION_BACKEND, or below [tool.sim-action] in
    pyproject.toml.
    """
    if context.invoked_subcommand is None:
        # As click 8.2 and later do by themselves: a missing command is an error of usage, and its message is the help.
        click.echo(context.get_help(), err=True)
        context.exit(ExitCode.INVALID)
    subcommand = SUBCOMMANDS[context.invoked_subcommand]
    if subcommand.handles_signals:
        forgive_closed_output()
    else:
        release_signals()
    if subcommand.keys:
        from pathlib import Path

        from sim_action.cli.pyproject import default_map

        context.default_map = default_map(context.invoked_subcommand, Path.cwd())
