"""Runs the script of a step."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.integration.github.commands import parse_outputs
from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.values import Value

_FILES: Final = ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY", "GITHUB_ENV", "GITHUB_PATH", "GITHUB_STATE")
# Without `shell:`, the runner is less strict.
_SHELLS: Final = {"bash": ("bash", "--noprofile", "--norc", "-e", "-o", "pipefail"), "": ("bash", "-e")}


@dataclass(frozen=True, slots=True)
class Script:
    """What a step runs."""

    text: str
    shell: str  # empty if the step does not say
    variables: Mapping[str, str]  # beside those of the machine
    github: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Finished:
    """How a script ended, and what it said to the runner."""

    exit_code: int
    outputs: Mapping[str, str]


def run_script(machine: Machine, script: Script) -> Finished:
    """Runs a script; what it writes for the runner is taken in however it ends. Raises StepFailed."""
    if script.shell not in _SHELLS or (machine.os == "Windows" and not script.shell):
        raise UnsupportedFeature(f"shell: {script.shell or 'the default'} on {machine.os}")
    with tempfile.TemporaryDirectory(prefix="step-", dir=machine.temp) as scratch:
        exit_code, log = _run(machine, script, Path(scratch))
        machine.record.hear(log)
        return Finished(exit_code, _taken_in(machine, Path(scratch)))


def _run(machine: Machine, script: Script, scratch: Path) -> tuple[int, str]:
    file, event = scratch / "step.sh", scratch / "event.json"
    file.write_text(script.text, encoding="utf-8")
    event.write_text(json.dumps(script.github["event"]), encoding="utf-8")
    files = {name: scratch / name for name in _FILES}
    for path in files.values():
        path.touch()
    variables = machine.variables(script.variables, script.github)
    variables |= {name: str(path) for name, path in {**files, "GITHUB_EVENT_PATH": event}.items()}
    with subprocess.Popen(
        [*_SHELLS[script.shell], file],
        cwd=machine.workspace,
        env=variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    ) as process:
        return _finished(process, _time_left(machine))


def _finished(process: subprocess.Popen[bytes], timeout: float | None) -> tuple[int, str]:
    note = ""
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
        note = "\n::error::The operation was canceled: it has timed out\n"
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    code = process.returncode
    return 128 - code if code < 0 else code, output.decode("utf-8", errors="replace") + note


def _time_left(machine: Machine) -> float | None:
    return machine.deadline - time.monotonic() if machine.deadline is not None else None


def _taken_in(machine: Machine, scratch: Path) -> dict[str, str]:
    said = {name: _text(scratch / name) for name in _FILES}
    if said["GITHUB_STATE"]:
        raise UnsupportedFeature("GITHUB_STATE")
    machine.record.summarise(said["GITHUB_STEP_SUMMARY"])
    machine.record.exported += said["GITHUB_ENV"] + said["GITHUB_PATH"]
    machine.path += [line for line in said["GITHUB_PATH"].splitlines() if line]
    try:
        machine.environment |= parse_outputs(said["GITHUB_ENV"])
        return parse_outputs(said["GITHUB_OUTPUT"])
    except ValueError as error:
        raise StepFailed(f"Unable to process file command successfully: {error}") from error


def _text(file: Path) -> str:
    # A step may remove what it was given.
    return file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""
