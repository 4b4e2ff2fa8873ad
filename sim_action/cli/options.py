"""What several subcommands take and say: the paths of scenarios, and remarks on standard error."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.messages import shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.core.workspace import Workspace
    from sim_action.reports import ReportRequest
    from sim_action.robot.spec import Robot
    from sim_action.scenario.selection import Selection, Suite


PATHS: Final = click.argument("paths", nargs=-1, metavar="[PATHS]...")
ALLOW_OUTSIDE: Final = click.option(
    "--allow-outside", is_flag=True, help="Let scenarios name files outside of their workspace."
)


def discovered(paths: Sequence[str], flags: dict[str, Any] | None = None) -> Suite:
    """What is named; if nothing is, as pyproject.toml says, or all below. `flags`: as `taken_selection` has them."""
    from sim_action.core.discovery import compared_name, discover, unique
    from sim_action.scenario.selection import Selection, Suite, split

    named = [split(path) for path in named_paths(paths)]
    found = discover(file for file, _ in named)
    # However it is spelled, it is one outcome.
    empty: dict[str, str] = {}
    for pattern in (pattern for pattern, matches in found.items() if not matches):
        empty.setdefault(compared_name(pattern), pattern)
    files = unique(found)
    numbers = _numbers(files, ((found[file], some) for file, some in named))
    selection = Selection() if flags is None else taken_selection(flags)
    for pattern in empty.values():
        # Beside others, it is in the reports.
        (note if files else complain)(f"no scenario in or at '{pattern}'")
    return Suite(files, tuple(empty.values()), numbers, selection)


def named_paths(paths: Sequence[str]) -> Sequence[str]:
    """What was typed, or else what stands in pyproject.toml, or else the current folder."""
    return paths or click.get_current_context().lookup_default("paths") or ["."]


def _numbers(
    files: Sequence[Path], named: Iterable[tuple[Sequence[Path], frozenset[int] | None]]
) -> dict[str, frozenset[int]]:
    """Of files that are named with numbers alone, all of these."""
    from sim_action.core.discovery import compared_name, file_name

    some: dict[str, frozenset[int]] = {}
    whole = set[str]()
    for path, numbers in ((path, numbers) for paths, numbers in named for path in paths):
        name = compared_name(str(path))
        if numbers is None:
            whole.add(name)
        else:
            some[name] = some.get(name, frozenset()) | numbers
    by_name = {compared_name(str(path)): file_name(path) for path in files} if some else {}
    return {by_name[name]: numbers for name, numbers in some.items() if name not in whole}


def note(message: str) -> None:
    """Says something that is no error."""
    from sim_action.core.messages import log_line

    click.echo(log_line(f"sim-action: {message}"), err=True)


def complain(message: str) -> None:
    """Tells an error; on GitHub, as an annotation."""
    from sim_action.reports.github.annotations import complaint

    click.echo(complaint(message, os.environ), err=True)


Command = Callable[..., ExitCode]

_SELECTION: Final = (
    click.option("--only", multiple=True, metavar="PATTERN", help="Scenarios of such names; may be repeated."),
    click.option("--exclude", multiple=True, metavar="PATTERN", help="No scenarios of such names; may be repeated."),
    click.option("--tag", "tags", multiple=True, metavar="TAG", help="Scenarios with the tag; may be repeated."),
    click.option(
        "--exclude-tag", "exclude_tags", multiple=True, metavar="TAG", help="None with the tag; may be repeated."
    ),
)


def selection_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in reversed(_SELECTION):
        command = option(command)
    return command


def taken_selection(flags: dict[str, Any]) -> Selection:
    """What was typed, by the names that click gives it, which are taken out."""
    from sim_action.scenario.selection import Selection

    return Selection(**{name: tuple(flags.pop(name)) for name in ("only", "exclude", "tags", "exclude_tags")})


_FILES: Final = (
    click.option(
        "--output-dir",
        envvar="SIM_ACTION_OUTPUT_DIR",
        default="sim-results",
        show_default=True,
        help="Where results, JUnit and traces go.",
    ),
    click.option(
        "--junit",
        envvar="SIM_ACTION_JUNIT",
        metavar="PATH",
        help="Where the JUnit XML goes.  [default: junit.xml in the output dir]",
    ),
    click.option(
        "--junit-strict",
        envvar="SIM_ACTION_JUNIT_STRICT",
        is_flag=True,
        help="Leave out of it what junit-10.xsd forbids.",
    ),
)
_SWITCHES: Final = (
    click.option(
        "--report/--no-report",
        envvar="SIM_ACTION_REPORT",
        default=True,
        help="Write report.html, with a replay of each run.  [default: yes]",
    ),
    click.option(
        "--summary/--no-summary",
        envvar="SIM_ACTION_SUMMARY",
        default=True,
        help="Write the job summary, on GitHub.  [default: yes]",
    ),
    click.option(
        "--annotations/--no-annotations",
        envvar="SIM_ACTION_ANNOTATIONS",
        default=True,
        help="Annotate lines, on GitHub.  [default: yes]",
    ),
)
_VERBOSITY: Final = (
    click.option(
        "--verbose",
        "-v",
        envvar="SIM_ACTION_VERBOSE",
        is_flag=True,
        help="Show notes, diagnostics and what controllers print.",
    ),
    click.option(
        "--quiet", "-q", envvar="SIM_ACTION_QUIET", is_flag=True, help="Show what failed, and one closing line."
    ),
)


def report_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in reversed((*_FILES, *_SWITCHES, *_VERBOSITY)):
        command = option(command)
    return command


def report_request(flags: Mapping[str, Any]) -> ReportRequest:
    """What was typed, by the names that click gives it. Raises UsageError."""
    from pathlib import Path

    from sim_action.reports import ReportRequest

    if flags["verbose"] and flags["quiet"]:
        raise UsageError("--verbose and --quiet do not go together")
    return ReportRequest(
        folder=Path(flags["output_dir"]),
        junit=Path(flags["junit"]) if flags["junit"] else None,
        junit_strict=flags["junit_strict"],
        verbosity="verbose" if flags["verbose"] else "quiet" if flags["quiet"] else "normal",
        silenced=frozenset(name for name in ("report", "summary", "annotations") if not flags[name]),
    )


def model_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in (
        click.option("--package", "packages", multiple=True, metavar="NAME=FOLDER", help="As robot.packages."),
        click.option("--arg", "args", multiple=True, metavar="NAME=VALUE", help="Of a xacro file, as robot.args."),
    ):
        command = option(command)
    return command


def asked_model(model: str, flags: Mapping[str, Any]) -> tuple[Robot, Workspace]:
    """The robot of what was typed, and where its files are looked for. Raises UsageError."""
    from sim_action.core.workspace import Workspace
    from sim_action.robot.spec import Robot

    robot = Robot(model=model, args=_pairs("--arg", flags["args"]), packages=_pairs("--package", flags["packages"]))
    return robot, Workspace.around(Path("a scenario"), allow_outside=flags["allow_outside"])


def _pairs(option: str, texts: Iterable[str]) -> dict[str, Any]:
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"{option} takes NAME=VALUE, found {shown(text)}")
        pairs[name] = value
    return pairs
