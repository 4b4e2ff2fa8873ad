"""Inspect a xacro or MJCF model in a process of its own, with the time and memory limits of a scenario.

xacro evaluates code of strangers and may never end; MuJoCo needs minutes for some small files. The process answers on
its standard output and is killed at the time limit. Memory is limited on Linux only.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Final

from sim_action.app.inspect import Inspection, inspect_model
from sim_action.core.errors import ModelError
from sim_action.core.field_types import FrozenModel
from sim_action.core.workspace import Workspace
from sim_action.results.masking import Mask
from sim_action.robot.model.robot_spec import Robot
from sim_action.runner.isolation.child_process import environment
from sim_action.runner.process_output import redirect_output
from sim_action.scenario.model import MEMORY, WALL_SECONDS

_CALL: Final = [sys.executable, "-P", "-m", "sim_action.app.inspect_process"]


class _Answer(FrozenModel):
    """The answer of the process: an inspection, the reason for a refusal, or a traceback."""

    found: Inspection | None = None
    refused: str = ""
    fault: str = ""


def inspect_apart(
    robot: Robot, workspace: Workspace, seconds: float = WALL_SECONDS, memory: int = MEMORY
) -> Inspection:
    """Inspect a model; xacro and MJCF are limited to `seconds` of wall time and `memory` bytes. Raises ModelError."""
    if not (robot.is_xacro or robot.is_mjcf):
        return inspect_model(robot, workspace)
    answer = _asked(robot, workspace, seconds, memory)
    if answer.refused:
        raise ModelError(Mask.of(os.environ, workspace.pass_env).message(answer.refused))
    if answer.found is None:
        raise RuntimeError(answer.fault)
    return answer.found


def _asked(robot: Robot, workspace: Workspace, seconds: float, memory: int) -> _Answer:
    task, quiet = pickle.dumps((robot, workspace, memory)), subprocess.DEVNULL
    variables = environment(workspace.pass_env)
    try:
        ended = subprocess.run(  # noqa: S603 - this interpreter, and nothing from a model
            _CALL, input=task, stdout=subprocess.PIPE, stderr=quiet, timeout=seconds, env=variables, check=False
        )
    except subprocess.TimeoutExpired:
        found, remedy = "reading it", "simplify the model, or reduce the counts of <replicate>"
        if robot.is_xacro:
            found, remedy = "the evaluation", "check the file for an endless recursion"
        raise ModelError(f"{robot.model}: {found} was stopped after {seconds:g} s; {remedy}") from None
    if ended.returncode or not ended.stdout:
        code = ended.returncode
        raise ModelError(f"{robot.model}: the process that read it ended with exit code {code} without a result")
    return _Answer.model_validate_json(ended.stdout)


def main() -> None:
    """Run the process: read the request from standard input, write the answer to standard output."""
    robot, workspace, memory = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    with os.fdopen(os.dup(1), "wb") as answer:
        redirect_output(Path(os.devnull))
        if sys.platform == "linux":
            from sim_action.runner.isolation.process_control import end_with_parent, impose_limits

            end_with_parent(os.getppid(), signal.SIGKILL)
            impose_limits(memory)
        answer.write(_looked(robot, workspace, memory).model_dump_json().encode())


def _looked(robot: Robot, workspace: Workspace, memory: int) -> _Answer:
    try:
        return _Answer(found=inspect_model(robot, workspace))
    except ModelError as error:
        return _Answer(refused=str(error))
    except MemoryError:
        return _Answer(
            refused=f"{robot.model}: reading it needs more than {memory / 2**30:.4g} GiB of memory; simplify it"
        )
    except Exception:  # noqa: BLE001 - the parent reports a fault of sim-action
        return _Answer(fault=traceback.format_exc())


if __name__ == "__main__":
    main()
