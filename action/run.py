"""Runs the subcommand of sim-action that its one argument names, with what the action's inputs say.

Inputs come in as INPUT_ variables, which are kept from the scripts of scenarios. Exits as sim-action does.
"""

from __future__ import annotations

from sim_action.core.process import hold_signals

if __name__ == "__main__":
    # Before the imports, which take a moment: a cancelled workflow still gets its reports.
    hold_signals()

import io
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from sim_action.cli.main import call, leave
from sim_action.cli.options import DEFAULT_OUTPUT_DIR
from sim_action.cli.pyproject import default_map
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.files import similar_path
from sim_action.core.wording import escaped_line, shown, system_reason
from sim_action.reports.github.annotations import complaint
from sim_action.results.output_folder import JUNIT_FILE

TRUE_OR_FALSE: Final = ("true", "false")
ROSTEST_ACTION: Final = (
    "was removed: a rostest has its own action, sim-action/sim-action/rostest@v0, with the inputs package, file and "
    "arguments"
)


class InputError(Exception):
    """An input of the action that means nothing."""


@dataclass(frozen=True)
class Subcommand:
    """The way from inputs to a command line. An empty input is left out: the command line has the defaults.

    Attributes:
        arguments: inputs with one argument per line.
        lists: input -> option that is given for each line.
        options: input -> option that takes its value, one line.
        switches: input -> the options for true and for false.
        required: inputs that must not be empty.
        single: inputs among the arguments with one line at most.
        moved: input that means nothing -> the reason, and what to do.
    """

    arguments: tuple[str, ...]
    lists: Mapping[str, str]
    options: Mapping[str, str]
    switches: Mapping[str, tuple[str, str]]
    required: tuple[str, ...] = ()
    single: tuple[str, ...] = ()
    moved: Mapping[str, str] = field(default_factory=dict)

    def command_line(self, inputs: Mapping[str, str]) -> Iterator[str]:
        """Yield its arguments. Raises InputError."""
        self._check(inputs)
        for name, option in self.options.items():
            if value := inputs[name].strip():
                yield f"{option}={value}"
        for name, spellings in self.switches.items():
            if inputs[name].strip():
                yield spellings[TRUE_OR_FALSE.index(one_of(TRUE_OR_FALSE, name, inputs))]
        for name, option in self.lists.items():
            yield from (f"{option}={line}" for line in lines(inputs[name]))
        yield "--"
        for name in self.arguments:
            yield from lines(inputs[name])

    @property
    def names(self) -> Mapping[str, str]:
        """Option -> input, for messages."""
        options = {option: name for name, option in {**self.options, **self.lists}.items()}
        return options | {option: name for name, spellings in self.switches.items() for option in spellings}

    def _check(self, inputs: Mapping[str, str]) -> None:
        """Raise InputError for an input that was removed, is missing, or has too many lines."""
        for name, replacement in self.moved.items():
            value = inputs.get(name, "").strip()
            if value and not (value == "false" and name in SUBCOMMANDS["run"].switches):
                raise InputError(f"the input {name} {replacement}")
        for name in self.required:
            refuse_empty(name, inputs)
        for name in (*self.options, *self.single):
            if len(lines(inputs[name])) > 1:
                raise InputError(f"the input {name} must be one line, and has {len(lines(inputs[name]))}")


_REPORTS: Final = {"output-directory": "--output-dir", "junit-path": "--junit"}
_SWITCHES: Final = {
    "junit-strict": ("--junit-strict", "--no-junit-strict"),
    "report": ("--report", "--no-report"),
    "summary": ("--summary", "--no-summary"),
    "annotations": ("--annotations", "--no-annotations"),
}
_SELECTION: Final = {"only": "--only", "exclude": "--exclude", "tags": "--tag", "exclude-tags": "--exclude-tag"}
SUBCOMMANDS: Final = {
    "run": Subcommand(
        arguments=("scenario",),
        lists={**_SELECTION, "packages": "--package", "pass-env": "--pass-env"},
        options={
            **_REPORTS,
            "backend": "--backend",
            "seed": "--seed",
            "repeat": "--repeat",
            "unexercised": "--unexercised",
            "confidence": "--confidence",
            "jobs": "--jobs",
            "shard": "--shard",
            "against": "--against",
            "record": "--record",
            "allow-scripts": "--allow-scripts",
        },
        switches={
            **_SWITCHES,
            "fail-fast": ("--fail-fast", "--no-fail-fast"),
            "resume": ("--resume", "--no-resume"),
            "strict": ("--strict", "--no-strict"),
        },
        required=("allow-scripts",),
        moved=dict.fromkeys(("rostest", "sim-time-limit", "allow-losses"), ROSTEST_ACTION),
    ),
    "rostest": Subcommand(
        arguments=("package", "file", "arguments"),
        lists={"pass-env": "--pass-env"},
        options={
            **_REPORTS,
            "backend": "--backend",
            "seed": "--seed",
            "sim-time-limit": "--sim-time-limit",
            "allow-scripts": "--allow-scripts",
        },
        switches={
            **_SWITCHES,
            "allow-losses": ("--allow-losses", "--no-allow-losses"),
            "strict": ("--strict", "--no-strict"),
        },
        required=("package", "file", "allow-losses", "allow-scripts"),
        single=("package", "file"),
    ),
    "margins": Subcommand(
        arguments=("scenario",),
        lists={**_SELECTION, "packages": "--package", "pass-env": "--pass-env"},
        options={
            **_REPORTS,
            "backend": "--backend",
            "seed": "--seed",
            "jobs": "--jobs",
            "shard": "--shard",
            "allow-scripts": "--allow-scripts",
        },
        switches={**_SWITCHES, "resume": ("--resume", "--no-resume")},
        required=("allow-scripts",),
        moved=dict.fromkeys(
            ("repeat", "unexercised", "confidence", "against", "record", "fail-fast", "strict"),
            "cannot be combined with margins; remove one of the two",
        ),
    ),
    "prove": Subcommand(
        arguments=("scenario",),
        lists={"mutants": "--only", "packages": "--package", "pass-env": "--pass-env"},
        options={
            "output-directory": "--output-dir",
            "json-path": "--json",
            "budget": "--budget",
            "backend": "--backend",
            "seed": "--seed",
            "jobs": "--jobs",
            "allow-scripts": "--allow-scripts",
        },
        switches={
            "strict": ("--strict", "--no-strict"),
            **{name: _SWITCHES[name] for name in ("report", "summary", "annotations")},
        },
        required=("strict", "allow-scripts"),
    ),
    "matrix": Subcommand(
        arguments=("scenario",),
        lists=_SELECTION,
        options={"shards": "--shards", "durations": "--durations"},
        switches={},
        required=("shards",),
    ),
    "compare": Subcommand(
        arguments=("old", "new"),
        lists={},
        options={"margin": "--margin", "slower": "--slower", "markdown": "--markdown"},
        switches={
            "strict": ("--strict", "--no-strict"),
            "allow-removed": ("--allow-removed", "--no-allow-removed"),
            "summary": ("--summary", "--no-summary"),
        },
        required=("old", "strict", "allow-removed"),
        single=("old", "new"),
    ),
    "merge": Subcommand(
        arguments=("results",),
        lists={**_SELECTION, "scenario": "--scenarios"},
        options={**_REPORTS, "against": "--against"},
        switches=_SWITCHES,
        required=("results",),
    ),
}


def lines(text: str) -> list[str]:
    """The lines of an input, those without text left out."""
    return [line.strip() for line in text.split("\n") if line.strip()]


def one_of(allowed: tuple[str, ...], name: str, inputs: Mapping[str, str]) -> str:
    """Return the value of an input. Raises InputError."""
    value = inputs[name].strip()
    if value not in allowed:
        shown_value = f"'{value}'" if value else "empty"
        raise InputError(f"the input {name} must be {' or '.join(allowed)}, and is {shown_value}")
    return value


def refuse_empty(name: str, inputs: Mapping[str, str]) -> None:
    """Raise InputError for an input that must have a value."""
    if not inputs[name].strip():
        raise InputError(f"the input {name} is empty; an expression may have no value, such as a misspelled one")


def enter(folder: str) -> None:
    """Go to the folder where paths start. Raise InputError.

    A workflow may name a folder outside the workspace of the job. A link in the workspace may not lead to one: its
    author may be a stranger.
    """
    try:
        if problem := _left_workspace(folder, os.environ.get("GITHUB_WORKSPACE", "")):
            raise InputError(f"the input working-directory {problem}; name a folder of the workspace")
        os.chdir(folder)
    except FileNotFoundError:
        hint = similar_path(Path(folder)) or "; name a folder that is checked out, from its top"
        raise InputError(f"the input working-directory: there is no folder {shown(folder)}{hint}") from None
    except NotADirectoryError:
        raise InputError(f"the input working-directory: {shown(folder)} is a file; name a folder") from None
    except (OSError, ValueError) as error:
        reason = f"{shown(folder)} cannot be entered: {system_reason(error)}"
        raise InputError(f"the input working-directory: {reason}") from None


def _left_workspace(folder: str, workspace: str) -> str | None:
    """Return a clause about the link that leads out of the workspace of the job; None: there is none."""
    named, real = Path(os.path.abspath(folder)), Path(os.path.realpath(folder))  # noqa: PTH100 - links are not followed
    bound = Path(os.path.realpath(workspace))
    is_below = any(Path(os.path.realpath(place)) == bound for place in named.parents)
    if not workspace or not is_below or real.is_relative_to(bound):
        return None
    return f"leads through a link to {escaped_line(str(real))}, outside the workspace {escaped_line(str(bound))}"


def set_up_time(instants: str) -> str:
    """Return the times of the steps before this one, as text.

    `instants` in s: the start, with Python, before and after the installation, and of the ROS 2 step, if any.
    """
    start, with_python, began, installed, *of_ros = map(float, instants.split())
    parts = {"Python": with_python - start, "install": installed - began}
    if len(of_ros) == 2:
        parts["ROS 2"] = of_ros[1] - of_ros[0]
    total = time.time() - start
    parts["other steps"] = max(0.0, total - sum(parts.values()))
    return f"Set-up took {total:.0f} s: {', '.join(f'{name} {seconds:.0f} s' for name, seconds in parts.items())}"


def of_this_use(name: str, inputs: Mapping[str, str]) -> Mapping[str, str]:
    """Return the inputs with an output folder that no earlier use in this job has written to.

    Raises UsageError for an invalid table of the project, OSError.

    A folder that the workflow states is kept, and so is the default of a use that continues an earlier run.
    """
    temp = os.environ.get("RUNNER_TEMP")
    if name not in ("run", "rostest") or not temp:
        return inputs
    noted = Path(temp, "sim-action-output-folders")
    written = noted.read_text(encoding="utf-8", errors="replace").splitlines() if noted.is_file() else []
    project = default_map(name, Path.cwd()).get(name, {})
    stated = inputs["output-directory"].strip()
    first = stated or os.environ.get("SIM_ACTION_OUTPUT_DIR") or project.get("output_dir", DEFAULT_OUTPUT_DIR)
    folder = first
    if not stated and inputs.get("resume", "").strip() != "true":
        number = 1
        while os.path.realpath(folder) in written:
            number += 1
            folder = f"{first}-{number}"
    with noted.open("a", encoding="utf-8") as file:
        file.write(f"{os.path.realpath(folder)}\n")
    if folder == first:
        return inputs
    print(
        f"sim-action: {shown(first)} has the results of an earlier use in this job, so those of this one go to "
        f"{shown(folder)}; the output output-directory says where they are, and the input output-directory states it",
        file=sys.stderr,
    )
    # The project may state one, which the first use has written to.
    return {**inputs, "output-directory": folder, "junit-path": inputs["junit-path"] or f"{folder}/{JUNIT_FILE}"}


def margin_options(factors: Sequence[str]) -> Iterator[str]:
    """Yield an option for each line of the input margins: `all`, FACTOR, FACTOR=FROM:TO or FACTOR=AMOUNT.

    Raise InputError for `all` with other lines, which limit the factors.
    """
    if "all" in factors and len(factors) > 1:
        raise InputError("the input margins has 'all' and other lines; remove 'all', or the other lines")
    for line in factors:
        if line != "all":
            _, equals, value = line.partition("=")
            yield f"--{'at-least' if equals and ':' not in value else 'factor'}={line}"


def run(name: str, inputs: Mapping[str, str]) -> int:
    """The exit code. Raises InputError."""
    forgiving = "fail-on-failure" in inputs and one_of(TRUE_OR_FALSE, "fail-on-failure", inputs) == "false"
    refuse_empty("working-directory", inputs)
    enter(inputs["working-directory"].strip())
    subcommand = SUBCOMMANDS[name]
    # The call reports an invalid table of the project.
    with suppress(UsageError, OSError):
        inputs = of_this_use(name, inputs)
    words = [name, *subcommand.command_line(inputs)]
    if factors := lines(inputs.get("margins", "")) if name == "run" else []:
        subcommand = SUBCOMMANDS["margins"]
        words = ["margins", *margin_options(factors), *subcommand.command_line(inputs)]
    code = call(words, subcommand.names)
    return ExitCode.PASSED if forgiving and code == ExitCode.FAILED else code


def main() -> None:
    """Run the subcommand that the one argument names."""
    for stream in (sys.stdout, sys.stderr):
        # What a runner reads: on Windows, Python would write the code page of a console.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", newline="\n")
    inputs = {
        variable.removeprefix("INPUT_").lower().replace("_", "-"): value
        for variable, value in os.environ.items()
        if variable.startswith("INPUT_")
    }
    if instants := os.environ.get("SET_UP_INSTANTS"):
        print(set_up_time(instants), file=sys.stderr, flush=True)
    try:
        code = run(sys.argv[1], inputs)
    except InputError as error:
        print(complaint(str(error), os.environ), file=sys.stderr)
        code = ExitCode.INVALID
    leave(code)


if __name__ == "__main__":
    main()
