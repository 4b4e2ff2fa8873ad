"""Options and messages that several subcommands share: paths, selection, reports, robot models."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource
from typing_extensions import override

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.wording import counted, escaped_line, log_line, nearest, note, shown, warn
from sim_action.engines import ENGINES

if TYPE_CHECKING:
    from sim_action.core.permissions import Permissions
    from sim_action.core.workspace import Workspace
    from sim_action.reports import ReportRequest
    from sim_action.robot.model.robot_spec import Robot
    from sim_action.runner.run_plan import PlanRequest
    from sim_action.scenario.selection import Selection, Suite


_MAX_MISNAMED: Final = 5  # the number of misnamed files that a note names


class Bounded(click.ParamType):  # type: ignore[type-arg] # generic in new versions of click only
    """A number within bounds; unlike click's, its errors are plain words, and `--help` does not list them."""

    def __init__(self, number: click.IntRange | click.FloatRange) -> None:
        """Take the type that checks the bounds."""
        self.name = number.name
        self._number = number

    @override
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return self._number.convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected {self._allowed}, found {shown(value)}", param, ctx)

    @property
    def _allowed(self) -> str:
        """The allowed numbers, such as "a whole number from 1 to 256"."""
        number = self._number
        noun = "a whole number" if isinstance(number, click.IntRange) else "a number"
        if number.max is None:
            return f"{noun} {'greater than' if number.min_open else 'of at least'} {number.min}"
        if number.min_open:
            return f"{noun} greater than {number.min} and at most {number.max:,.0f}"
        return f"{noun} from {number.min} to {number.max}"


_PATH: Final = re.compile(r".*[/*?].*|.*\.ya?ml")


class OptionalValue(click.Option):
    """An option whose value may be left out, in a `CommandWithOptionalValues`."""

    def __init__(self, names: Sequence[str], *, pattern: str, **settings: Any) -> None:
        """`pattern`: a regular expression for the words behind the option that are its value."""
        self.pattern = re.compile(pattern)
        super().__init__(names, is_flag=False, **settings)


class CommandWithOptionalValues(click.Command):
    """A command in which a path may follow an option without a value; click would take the path as the value."""

    @override
    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        options = {name: param for param in self.params if isinstance(param, OptionalValue) for name in param.opts}
        end = args.index("--") if "--" in args else len(args)
        words = list(args)
        for position, (word, following) in enumerate(pairwise(args[:end])):
            is_path = _PATH.fullmatch(following) or os.path.exists(following)  # noqa: PTH110 - takes any text
            if word in options and is_path and not options[word].pattern.fullmatch(following):
                words[position] = f"{word}={options[word].flag_value}"
        return super().parse_args(ctx, words)


Command = Callable[..., ExitCode]
Option = Callable[[Callable[..., Any]], Callable[..., Any]]


def not_empty(_: click.Context, param: click.Parameter, value: Any) -> Any:
    """Return the value of an option, or raise BadParameter for an empty text: a shell variable may be unset."""
    if value == "" or (isinstance(value, tuple) and "" in value):
        raise click.BadParameter("it is empty; leave the option out, or give it a value", param=param)
    return value


def text_option(*names: str, text: str, env: bool = False, **settings: Any) -> Option:
    """Return an option that takes a text, but not an empty one; `env`: also by the variable SIM_ACTION_NAME."""
    return click.option(*names, callback=not_empty, envvar=_variable(names[0], env), help=text, **settings)


def flag(*names: str, text: str, env: bool = False) -> Option:
    """Return an option without a value."""
    return click.option(*names, is_flag=True, envvar=_variable(names[0], env), help=text)


def switch(name: str, purpose: str, *, env: bool = False, default: bool = False) -> Option:
    """Return the options --NAME and --no-NAME."""
    text = f"{purpose}  [default: {'yes' if default else 'no'}]"
    return click.option(f"--{name}/--no-{name}", envvar=_variable(name, env), default=default, help=text)


def _variable(name: str, env: bool) -> str | None:
    return f"SIM_ACTION_{name.lstrip('-').upper().replace('-', '_')}" if env else None


DEFAULT_OUTPUT_DIR: Final = "sim-results"
PATHS: Final = click.argument("paths", nargs=-1, metavar="[PATHS]...")
ALLOW_OUTSIDE: Final = flag(
    "--allow-outside",
    text="Allow files outside the workspace. The workspace is the git repository of the scenario, else the current "
    "folder.",
)


def with_options(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Return a decorator that adds options to a command; `--help` lists them in this order."""

    def added(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return added


code_flags: Final = with_options(
    click.option(
        "--allow-scripts",
        type=click.Choice(("auto", "true", "false")),
        default="auto",
        show_default=True,
        help="Allow code of the repository to run: scripts, processes, assertion classes, xacro, ROS nodes and launch "
        "files. auto: yes, except in GitHub workflows on events that strangers can trigger with the rights of the "
        "repository, and in checkouts of a fork or a pull request on events other than pull_request.",
    ),
    click.option(
        "--pass-env",
        multiple=True,
        metavar="NAME",
        help="Let code of the repository see this environment variable; repeatable. Reports show its value as ***.",
    ),
)
"""The options of every command that may run code of the repository."""


def code_permissions(
    flags: dict[str, Any], folders: Iterable[Path] = (), *, outside: bool = False, packages: Iterable[str] = ()
) -> Permissions:
    """Return the permissions that the options of `code_flags` give, and remove these options from `flags`.

    `folders`: the folders of the files that may run code, besides the current folder; `outside`, `packages`: the values
    of ALLOW_OUTSIDE and PACKAGES, if the command has them. Raises UsageError.
    """
    from sim_action.core.permissions import Permissions, checked_names, scripts_refused

    names = checked_names(flags.pop("pass_env"))
    for name in names:
        if name not in os.environ:
            near = nearest(name, sorted(os.environ))
            hint = "" if near is None else f"did you mean '{near}'? Otherwise "
            warn(f"--pass-env {name}: this variable is not set; {hint}set it, on GitHub with 'env:' of the step")
    refused = scripts_refused(flags.pop("allow_scripts"), os.environ, (Path.cwd(), *folders))
    return Permissions(outside, scripts_refused=refused, pass_env=names, packages=named_packages(packages))


def typed(*names: str) -> list[str]:
    """Return the options on the command line among the given parameters; defaults and variables do not count."""
    context = click.get_current_context()
    typed_options = []
    for param in context.command.params:
        if param.name in names and context.get_parameter_source(param.name) is ParameterSource.COMMANDLINE:
            is_off = context.params[param.name] is False and param.secondary_opts
            typed_options.append((param.secondary_opts if is_off else param.opts)[0])
    return typed_options


def refuse_typed(reason: str, *names: str) -> None:
    """Raise UsageError if one of the parameters is on the command line: it would be ignored."""
    if typed_options := typed(*names):
        raise UsageError(f"{reason} cannot be combined with {', '.join(typed_options)}")


PORT: Final = click.option(
    "--port",
    type=Bounded(click.IntRange(0, 65535)),
    default=0,
    metavar="N",
    help="Port of --live on this machine.  [default: a free one]",
)


def live_port(*, live: bool, port: int, watch: bool = True) -> int | None:
    """Return the port of --live; None if nothing is served. Raise UsageError for an option without what it needs."""
    if typed("port") and not live:
        raise UsageError("--port needs --live")
    if live and not watch:
        raise UsageError("--live needs --watch; `sim-action view --live` follows any run from another terminal")
    return port if live else None


SEED: Final = Bounded(click.IntRange(0, 2**63 - 1))
SEED_OPTION: Final = click.option(
    "--seed",
    envvar="SIM_ACTION_SEED",
    type=SEED,
    metavar="N",
    help='Random seed for all scenarios.  [default: "seed:" in the file of each scenario]',
)


strict_option: Final = switch(
    "strict", "Fail on each warning of the audit of claims, such as a check that saw nothing.", env=True
)


ENGINE_OPTION: Final = click.option(
    "--backend",
    envvar="SIM_ACTION_BACKEND",
    type=click.Choice(tuple(ENGINES)),
    help='Physics engine for all scenarios.  [default: "backend:" in the file of each scenario]',
)


def jobs_option(noun: str) -> Callable[[Command], Command]:
    """Return the option for the number of processes; `noun`: what they run."""
    return click.option(
        "--jobs",
        "-j",
        envvar="SIM_ACTION_JOBS",
        type=Bounded(click.IntRange(min=1, max=256)),
        metavar="N",
        help=f"Number of {noun} in parallel, 1 to 256.  [default: number of cores]",
    )


def discovered(paths: Sequence[str], flags: dict[str, Any] | None = None, *, outside: bool = False) -> Suite:
    """Return the scenarios that the command line names.

    Without paths, the paths of pyproject.toml count, or else the current folder. `flags` are the options of
    `taken_selection`; None selects everything. `outside`: True if links out of the workspace are followed. A
    path without scenarios is reported on standard error.
    """
    from sim_action.core.workspace import file_name, misnamed
    from sim_action.scenario.selection import Selection, find_suite

    selection = Selection() if flags is None else taken_selection(flags)
    named_at = None if typed("paths") else click.get_current_context().lookup_default("paths_location")
    suite = find_suite(named_paths(paths), selection, outside=outside, named_at=named_at, warn=warn)
    for pattern in suite.empty:
        # If other scenarios were found, the reports also show this as an error.
        (note if suite.files else complain)(f"no scenario found at '{pattern}'")
    if others := misnamed(named_paths(paths), outside=outside):
        names = ", ".join(map(file_name, others[:_MAX_MISNAMED])) + (", ..." if others[_MAX_MISNAMED:] else "")
        verb = "looks like a scenario" if len(others) == 1 else "look like scenarios"
        note(f"{counted(len(others), 'file')} {verb}, but names of scenarios end with .sim.yml: {names}")
    return suite


def plan_request(paths: Sequence[str], flags: dict[str, Any]) -> PlanRequest:
    """Return the runs that the command line asks for, and remove their options from `flags`. Raises UsageError."""
    from sim_action.runner.run_plan import PlanRequest

    outside = flags.pop("allow_outside")
    suite = discovered(paths, flags if "tags" in flags else None, outside=outside)
    folders = {path.parent: None for path in suite.files}
    permissions = code_permissions(flags, folders, outside=outside, packages=flags.pop("packages"))
    return PlanRequest(suite, permissions, flags.pop("shard", None), flags.pop("backend"), flags.pop("seed"))


def named_paths(paths: Sequence[str]) -> Sequence[str]:
    """Return the paths of the command line, or else of pyproject.toml, or else the current folder."""
    return paths or click.get_current_context().lookup_default("paths") or ["."]


def complain(message: str) -> None:
    """Print an error on standard error; on GitHub, as an annotation."""
    line = log_line(f"sim-action: {message}")
    if os.environ.get("GITHUB_ACTIONS") == "true":
        # Without the files of this module, the line is better than nothing.
        with suppress(OSError, ImportError):
            from sim_action.reports.github.annotations import complaint

            line = complaint(message, os.environ)
    click.echo(line, err=True)


selection_flags: Final = with_options(
    text_option(
        "--only", metavar="PATTERN", text="Select scenarios by name; * and ? are wildcards; repeatable.", multiple=True
    ),
    text_option(
        "--exclude", metavar="PATTERN", text="Skip scenarios by name; * and ? are wildcards; repeatable.", multiple=True
    ),
    text_option("--tag", "tags", metavar="TAG", text="Select scenarios with this tag; repeatable.", multiple=True),
    text_option(
        "--exclude-tag", "exclude_tags", metavar="TAG", text="Skip scenarios with this tag; repeatable.", multiple=True
    ),
)
"""The options that select scenarios."""


def taken_selection(flags: dict[str, Any]) -> Selection:
    """Return the selection that the options ask for, and remove these options from `flags`."""
    from sim_action.scenario.selection import Selection

    return Selection(**{name: tuple(flags.pop(name)) for name in ("only", "exclude", "tags", "exclude_tags")})


def output_dir(purpose: str) -> Option:
    """Return the option for the output folder; `purpose` is its help."""
    return text_option(
        "--output-dir", metavar="FOLDER", text=purpose, env=True, default=DEFAULT_OUTPUT_DIR, show_default=True
    )


def switches(report: str, annotations: str) -> Callable[[Command], Command]:
    """Return a decorator that adds the options to switch reports off; its arguments say what two of them do."""
    return with_options(
        switch("report", report, env=True, default=True),
        switch("summary", "On GitHub, write the job summary.", env=True, default=True),
        switch("annotations", annotations, env=True, default=True),
    )


def silenced(flags: Mapping[str, Any]) -> frozenset[str]:
    """Return the names of the reports that the options of `switches` leave out."""
    return frozenset(name for name in ("report", "summary", "annotations") if not flags[name])


report_flags: Final = with_options(
    output_dir("Folder for results, JUnit XML, traces and reports."),
    text_option(
        "--junit", metavar="FILE", text="File for the JUnit XML.  [default: junit.xml in the output folder]", env=True
    ),
    switch(
        "junit-strict",
        "Write JUnit XML for strict readers: only what the schema junit-10.xsd of Jenkins allows.",
        env=True,
    ),
    text_option(
        "--against",
        metavar="OLD",
        text="Compare with an earlier run in report.html: what changed, and the earlier motion as a ghost in each "
        "replay. OLD is its results.json, or a folder with one, or with those of all shards.",
    ),
    switches("Write report.html with a replay of each run.", "On GitHub, mark the line of each failed expectation."),
    flag("--verbose", "-v", text="Show also notes, messages of the engine, and the output of controllers.", env=True),
    flag("--quiet", "-q", text="Show only failures and one line with the totals.", env=True),
    flag(
        "--json",
        "as_json",
        text="Print results.json on standard output instead of the report for people, and no annotations.",
    ),
)
"""The options for output and reports."""


def report_request(flags: Mapping[str, Any]) -> ReportRequest:
    """Return the reports that the options ask for. Raises UsageError."""
    from sim_action.reports import ReportRequest

    quiet, verbose, as_json = flags["quiet"], flags["verbose"], flags["as_json"]
    if as_json:
        refuse_typed("--json prints nothing else, and", "quiet", "verbose")
    if quiet and verbose and not as_json:
        # The command line is stronger than a variable or pyproject.toml.
        typed_options = typed("quiet", "verbose")
        if len(typed_options) != 1:
            raise UsageError("--verbose and --quiet cannot be combined")
        verbose = typed_options == ["--verbose"]
    return ReportRequest(
        folder=Path(flags["output_dir"]),
        junit=Path(flags["junit"]) if flags["junit"] else None,
        junit_strict=flags["junit_strict"],
        verbosity="json" if as_json else "verbose" if verbose else "quiet" if quiet else "normal",
        silenced=silenced(flags) | ({"annotations"} if as_json else set()),
        against=flags["against"],
    )


PACKAGES: Final = click.option(
    "--package",
    "packages",
    multiple=True,
    metavar="NAME=FOLDER",
    help="Folder of a ROS package, which may be outside the workspace; it comes before robot.packages; repeatable.",
)


def named_packages(texts: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the packages that `--package` names, see `package_folders`."""
    from sim_action.core.permissions import package_folders

    return package_folders(_pairs("--package", texts, "NAME=FOLDER"))


model_flags: Final = with_options(
    click.option(
        "--arg",
        "args",
        multiple=True,
        metavar="NAME=VALUE",
        help="Argument of a xacro file, as in robot.args; repeatable.",
    ),
    PACKAGES,
)
"""The options of a robot model."""


def asked_model(model: str, flags: dict[str, Any]) -> tuple[Robot, Workspace]:
    """Return the robot on the command line and its workspace. Raises UsageError, also for code that may not run."""
    from sim_action.core.workspace import Workspace
    from sim_action.robot.model.robot_spec import Robot

    # As typed: the result shows them as keys of a scenario.
    mapped = _pairs("--package", flags["packages"], "NAME=FOLDER")
    robot = Robot(model=model, packages=mapped)
    if arguments := _pairs("--arg", flags["args"], "NAME=VALUE"):
        if not robot.is_xacro:
            raise UsageError(escaped_line(f"--arg needs a xacro file, and {shown(model)} is not one; remove it"))
        robot = Robot(model=model, args=arguments, packages=mapped)
    robot = robot.model_copy(update={"srdf": flags.get("srdf")})
    permissions = code_permissions(flags, outside=flags["allow_outside"], packages=flags["packages"])
    if robot.is_xacro:
        permissions.require_scripts(f"{shown(model)} is xacro, which runs code")
    return robot, Workspace.around(Path("a scenario"), permissions)


def _pairs(option: str, texts: Iterable[str], form: str) -> dict[str, Any]:
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"{option} takes {form}, found {shown(text)}")
        if name in pairs:
            raise UsageError(f"{option} names {shown(name)} twice; remove one")
        pairs[name] = value
    return pairs
