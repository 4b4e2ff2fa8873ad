"""Runs a composite action as a GitHub runner would: action.yml + inputs -> steps -> what the caller gets to see.

It knows only the features that this repository's action uses, and refuses everything else, so that a green test never
rests on something that was skipped.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import yaml

_EXPRESSION: Final = re.compile(r"\$\{\{\s*([\w.-]+)\s*}}")
_HEREDOC: Final = re.compile(r"(?P<name>[^=]+?)<<(?P<delimiter>.+)")
_COMMAND: Final = re.compile(r"::(?P<level>error|warning|notice)(?: (?P<properties>[^:]*))?::(?P<message>.*)")

_STEP_KEYS: Final = frozenset({"name", "id", "uses", "with", "run", "shell", "env", "working-directory"})
_FILES: Final = ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY", "GITHUB_ENV", "GITHUB_PATH")
# A runner starts from its machine's environment; what belongs to a run around these tests is not part of that.
_FOREIGN: Final = ("GITHUB_", "RUNNER_", "ACTIONS_", "INPUT_", "PYTHON", "PYTEST_", "COV_", "VIRTUAL_ENV")


class UnsupportedFeature(Exception):
    """The action uses something that this executor does not know."""


@dataclass(frozen=True, slots=True)
class Annotation:
    """A workflow command that GitHub would show beside a line; text as it was before its escaping."""

    level: str
    message: str
    file: str | None
    line: int | None


@dataclass(frozen=True, slots=True)
class ActionResult:
    """What a job gets to see of the action.

    Attributes:
        exit_code: of the last step that ran.
        steps: the names of the steps that ran.
        exported: what was written to GITHUB_ENV and GITHUB_PATH, for later steps of the job.
    """

    exit_code: int
    steps: tuple[str, ...]
    outputs: Mapping[str, str]
    annotations: tuple[Annotation, ...]
    summary: str
    log: str
    exported: str


@dataclass(frozen=True, slots=True)
class Runner:
    """A machine that runs actions.

    Attributes:
        temp: RUNNER_TEMP; what one action leaves there, the next one in the job finds.
        variables: what the job has in its environment.
    """

    workspace: Path
    temp: Path
    os: str = "Linux"
    arch: str = "X64"
    variables: Mapping[str, str] = field(default_factory=dict)

    def run(self, action_path: Path, inputs: Mapping[str, str] | None = None) -> ActionResult:
        """Runs an action with the inputs of its `with:`. Raises UnsupportedFeature."""
        action = yaml.safe_load((action_path / "action.yml").read_text(encoding="utf-8"))
        if action["runs"]["using"] != "composite":
            raise UnsupportedFeature(f"runs.using: {action['runs']['using']}")
        return _Job(self, action_path, _resolved(action["inputs"], inputs or {})).run(action)


def base_python() -> Path:
    """The interpreter that this one's virtual environment was made with."""
    return Path(sys.base_prefix, "bin", f"python{sys.version_info.major}.{sys.version_info.minor}")


def parse_outputs(text: str) -> dict[str, str]:
    """What a GITHUB_OUTPUT file says: `name=value` lines and heredocs."""
    outputs = {}
    lines = iter(text.split("\n"))
    for line in lines:
        if heredoc := _HEREDOC.fullmatch(line):
            outputs[heredoc["name"]] = "\n".join(_until(heredoc["delimiter"], lines))
        elif line:
            name, separator, value = line.partition("=")
            if not separator:
                raise ValueError(f"neither name=value nor name<<delimiter: {line!r}")
            outputs[name] = value
    return outputs


def parse_annotations(log: str) -> tuple[Annotation, ...]:
    """The annotations in what a step printed; nothing between ::stop-commands::token and ::token:: counts."""
    annotations = []
    token = None
    for line in log.split("\n"):
        if token:
            token = None if line == f"::{token}::" else token
        elif line.startswith("::stop-commands::"):
            token = line.removeprefix("::stop-commands::")
        elif command := _COMMAND.fullmatch(line):
            annotations.append(_annotation(command))
    return tuple(annotations)


def evaluate(text: str, contexts: Mapping[str, str]) -> str:
    """Text with its `${{ name }}` replaced, once: what comes in is not looked at again. Raises UnsupportedFeature."""

    def value(expression: re.Match[str]) -> str:
        if expression[1] not in contexts:
            raise UnsupportedFeature(f"expression {expression[0]}")
        return contexts[expression[1]]

    if "${{" in _EXPRESSION.sub("", text):
        raise UnsupportedFeature(f"expression in {text!r}")
    return _EXPRESSION.sub(value, text)


@dataclass(slots=True)
class _Job:
    """One run of an action, and what its steps have left so far."""

    runner: Runner
    action_path: Path
    contexts: dict[str, str]
    log: str = ""
    summary: str = ""
    exported: str = ""

    def __post_init__(self) -> None:
        self.contexts |= {
            "runner.temp": str(self.runner.temp),
            "runner.os": self.runner.os,
            "runner.arch": self.runner.arch,
            "github.action_path": str(self.action_path),
            "github.workspace": str(self.runner.workspace),
        }

    def run(self, action: Mapping[str, Mapping[str, object]]) -> ActionResult:
        exit_code, ran = 0, []
        steps = action["runs"]["steps"]
        assert isinstance(steps, list)
        for step in steps:
            if exit_code == 0:
                ran.append(step["name"])
                exit_code = self._run_step(step)
        return ActionResult(
            exit_code=exit_code,
            steps=tuple(ran),
            # A step that did not run has no outputs, and GitHub takes what is not there for the empty string.
            outputs={name: self._output(output) for name, output in action["outputs"].items()},
            annotations=parse_annotations(self.log),
            summary=self.summary,
            log=self.log,
            exported=self.exported,
        )

    def _output(self, output: object) -> str:
        assert isinstance(output, dict)
        names = _EXPRESSION.findall(output["value"])
        absent = {name: "" for name in names if name.startswith("steps.")}
        return evaluate(output["value"], absent | self.contexts)

    def _run_step(self, step: dict[str, object]) -> int:
        if unknown := step.keys() - _STEP_KEYS:
            raise UnsupportedFeature(f"keys of a step: {', '.join(sorted(unknown))}")
        if uses := step.get("uses"):
            assert isinstance(uses, str)
            self._keep(step, _provided(uses))
            return 0
        return self._run_script(step)

    def _run_script(self, step: dict[str, object]) -> int:
        if step["shell"] != "bash":
            raise UnsupportedFeature(f"shell: {step['shell']}")
        script = self.runner.temp / f"step-{os.urandom(8).hex()}.sh"
        script.write_text(self._text(step["run"]), encoding="utf-8")
        files = {name: script.with_suffix(f".{name}") for name in _FILES}
        for file in files.values():
            file.touch()
        process = subprocess.run(
            ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", script],
            cwd=self.runner.workspace / self._text(step.get("working-directory", "")),
            env=self._environment(step, files),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            check=False,
        )
        said = {name: file.read_text(encoding="utf-8") for name, file in files.items()}
        self.log += process.stdout
        self.summary += said["GITHUB_STEP_SUMMARY"]
        self.exported += said["GITHUB_ENV"] + said["GITHUB_PATH"]
        self._keep(step, parse_outputs(said["GITHUB_OUTPUT"]))
        return process.returncode

    def _environment(self, step: dict[str, object], files: Mapping[str, Path]) -> dict[str, str]:
        machine = {name: value for name, value in os.environ.items() if not name.startswith(_FOREIGN)}
        given = step.get("env", {})
        assert isinstance(given, dict)
        return {
            **machine,
            **self.runner.variables,
            "CI": "true",
            "GITHUB_ACTIONS": "true",
            "GITHUB_WORKSPACE": str(self.runner.workspace),
            "GITHUB_ACTION_PATH": str(self.action_path),
            "RUNNER_TEMP": str(self.runner.temp),
            "RUNNER_OS": self.runner.os,
            "RUNNER_ARCH": self.runner.arch,
            **{name: str(file) for name, file in files.items()},
            **{name: self._text(value) for name, value in given.items()},
        }

    def _text(self, value: object) -> str:
        assert isinstance(value, str), f"{value!r} is not text"
        return evaluate(value, self.contexts)

    def _keep(self, step: dict[str, object], outputs: Mapping[str, str]) -> None:
        if identity := step.get("id"):
            self.contexts |= {f"steps.{identity}.outputs.{name}": value for name, value in outputs.items()}


def _resolved(declared: Mapping[str, Mapping[str, str]], given: Mapping[str, str]) -> dict[str, str]:
    if unknown := given.keys() - declared.keys():
        raise UnsupportedFeature(f"unexpected inputs: {', '.join(sorted(unknown))}")
    return {f"inputs.{name}": given.get(name, spec["default"]) for name, spec in declared.items()}


def _provided(uses: str) -> dict[str, str]:
    """The outputs of another action, which is not run: what it provides is on this machine already."""
    if not uses.startswith("actions/setup-python@"):
        raise UnsupportedFeature(f"uses: {uses}")
    return {"python-path": str(base_python())}


def _until(delimiter: str, lines: Iterator[str]) -> Iterator[str]:
    for line in lines:
        if line == delimiter:
            return
        yield line
    raise ValueError(f"no closing {delimiter!r}")


def _annotation(command: re.Match[str]) -> Annotation:
    properties = dict(item.split("=", 1) for item in (command["properties"] or "").split(",") if item)
    file, line = properties.get("file"), properties.get("line")
    return Annotation(
        level=command["level"],
        message=_unescaped(command["message"]),
        file=_unescaped(file) if file else None,
        line=int(line) if line else None,
    )


def _unescaped(text: str) -> str:
    for escape, character in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
        text = text.replace(escape, character)
    return text
