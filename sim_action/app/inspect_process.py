"""A look at a model that has to be evaluated: in a process of its own, with no more time and memory than a scenario.

What xacro evaluates is a stranger's, and may take for ever. The process answers on its standard output, and is ended
when its time is over; memory is limited on Linux, as that of scenarios is.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Final

from sim_action.app.inspect import Inspection, inspect_model
from sim_action.core.errors import ModelError
from sim_action.core.field_types import FrozenModel
from sim_action.core.workspace import Workspace
from sim_action.robot.spec import Robot
from sim_action.runner.isolation.child_process import environment
from sim_action.runner.process_output import redirect_output
from sim_action.scenario.model import MEMORY, WALL_SECONDS

_CALL: Final = [sys.executable, "-P", "-m", "sim_action.app.inspect_process"]


class _Answer(FrozenModel):
    """One of: what was found, why the model cannot be read, how sim-action failed."""

    found: Inspection | None = None
    refused: str = ""
    fault: str = ""


def inspect_apart(
    robot: Robot, workspace: Workspace, seconds: float = WALL_SECONDS, memory: int = MEMORY
) -> Inspection:
    """As `inspect_model`, within `seconds` of wall time and `memory` bytes if xacro is evaluated. Raises ModelError."""
    if not robot.is_xacro:
        return inspect_model(robot, workspace)
    answer = _asked(robot, workspace, seconds, memory)
    if answer.refused:
        raise ModelError(answer.refused)
    if answer.found is None:
        raise RuntimeError(answer.fault)
    return answer.found


def _asked(robot: Robot, workspace: Workspace, seconds: float, memory: int) -> _Answer:
    task, quiet = pickle.dumps((robot, workspace, memory)), subprocess.DEVNULL
    try:
        ended = subprocess.run(  # noqa: S603 - this interpreter, and nothing from a model
            _CALL, input=task, stdout=subprocess.PIPE, stderr=quiet, timeout=seconds, env=environment(), check=False
        )
    except subprocess.TimeoutExpired:
        message = f"{robot.model}: not evaluated after {seconds:g} s: does something in it go on without end?"
        raise ModelError(message) from None
    if ended.returncode or not ended.stdout:
        code = ended.returncode
        raise ModelError(f"{robot.model}: the process that evaluated it ended with exit code {code} and no answer")
    return _Answer.model_validate_json(ended.stdout)


def main() -> None:
    """The process: what to look at comes on standard input."""
    robot, workspace, memory = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    with os.fdopen(os.dup(1), "wb") as answer:
        redirect_output(Path(os.devnull))
        if sys.platform == "linux":
            from sim_action.runner.isolation.process_control import impose_limits

            impose_limits(memory)
        answer.write(_looked(robot, workspace, memory).model_dump_json().encode())


def _looked(robot: Robot, workspace: Workspace, memory: int) -> _Answer:
    try:
        return _Answer(found=inspect_model(robot, workspace))
    except ModelError as error:
        return _Answer(refused=str(error))
    except MemoryError:
        return _Answer(refused=f"{robot.model}: it takes more than {memory / 2**30:.4g} GiB of memory to evaluate")
    except Exception:  # noqa: BLE001 - a fault of ours is told by the parent
        return _Answer(fault=traceback.format_exc())


if __name__ == "__main__":
    main()
