"""A controller in Python: `script: controller.py`, a function from an observation to a command.

The function gets a `sim_action.Observation` and returns a `sim_action.Twist`, `sim_action.JointTargets`, or None to
leave the last command standing.
"""

from __future__ import annotations

import ast
import runpy
import sys
import traceback
from pathlib import Path
from typing import Annotated, ClassVar, Final, cast

from pydantic import Field

from sim_action.command import Command, JointTargets, is_finite
from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.errors import ScriptError
from sim_action.geometry import Twist
from sim_action.location import Location
from sim_action.messages import did_you_mean
from sim_action.observation import Observation
from sim_action.robot_model import RobotModel
from sim_action.scene import Scene, SpecProblems
from sim_action.workspace import PathError, Workspace

_MOST_BYTES: Final = 1_000_000


class ScriptCommands(CommandSource):
    """Asks a Python function of the user's for every command."""

    runs_user_code: ClassVar[bool] = True

    script: Annotated[str, Field(min_length=1, description="path of the Python file")]
    function: Annotated[str, Field(min_length=1, description="which function of the file is asked")] = "control"

    def problems(self, workspace: Workspace) -> SpecProblems:
        """A file that is not there, is no Python, or has no such function. Reads it; does not run it."""
        try:
            path = workspace.file(self.script)
            with path.open("rb") as file:
                source = file.read(_MOST_BYTES + 1)
            if len(source) > _MOST_BYTES:
                yield ("script",), f"{self.script}: a script of more than {_MOST_BYTES // 1000} kB is not read"
                return
            tree = ast.parse(source, filename=str(path))
        except PathError as error:
            yield ("script",), str(error)
        except OSError as error:
            yield ("script",), f"{self.script}: cannot be read: {error.strerror}"
        except SyntaxError as error:
            line = "" if error.lineno is None else f":{error.lineno}"
            yield ("script",), f"{self.script}{line}: not valid Python: {error.msg}"
        except (ValueError, RecursionError, MemoryError) as error:
            yield ("script",), f"{self.script}: not valid Python: {error}"
        else:
            names = _names_bound_by(tree)
            if self.function not in names and "*" not in names:
                yield (
                    ("function" if "function" in self.model_fields_set else "script",),
                    (f"{self.script} defines no function '{self.function}'{did_you_mean(self.function, names)}"),
                )

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises ScriptError."""
        path = scene.workspace.file(self.script)
        where = Location(str(path))
        sys.path.insert(0, str(path.parent))
        try:
            function = runpy.run_path(str(path)).get(self.function)
        except BaseException as error:  # noqa: BLE001 - sys.exit() in a script must not end the run unseen
            raise _script_error(error, path) from None
        if not callable(function):
            raise ScriptError(f"{path.name} defines no function '{self.function}'", where)

        def command(observation: Observation) -> Command | None:
            try:
                answer = function(observation)
            except BaseException as error:  # noqa: BLE001 - as above
                raise _script_error(error, path) from None
            if problem := _problem_with(answer, scene.model):
                raise ScriptError(f"{self.function}() returned {problem}", where)
            return cast(Command | None, answer)

        return ClosedLoop(command)


def _names_bound_by(tree: ast.Module) -> set[str]:
    """What the module defines, imports or assigns outside its functions and classes, also in an `if` or a `try`."""
    names, waiting = set(), list[ast.AST](tree.body)
    while waiting:
        match node := waiting.pop():
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
                continue
            case ast.alias():
                names.add(node.asname or node.name)
            case ast.Name(ctx=ast.Store()):
                names.add(node.id)
        waiting += ast.iter_child_nodes(node)
    return names


def _script_error(error: BaseException, path: Path) -> ScriptError:
    """Says where in the user's file it happened, which is not where our own frames are."""
    if isinstance(error, SyntaxError) and error.filename:
        return ScriptError(f"SyntaxError: {error.msg}", Location(error.filename, error.lineno))
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    what = traceback.format_exception_only(error)[-1].strip()
    return ScriptError(f"the controller raised {what}", Location(str(path), lines[-1] if lines else None))


def _problem_with(answer: object, model: RobotModel) -> str | None:
    if answer is None:
        return None
    if not isinstance(answer, (Twist, JointTargets)):
        return f"a {type(answer).__name__}; it may return a Twist, JointTargets or None"
    if isinstance(answer, Twist) and not _has_three_each(answer):
        return f"{answer!r}; a Twist has two vectors of 3 numbers: Twist.planar(linear, angular) makes one"
    try:
        finite = is_finite(answer)
        names = () if isinstance(answer, Twist) else (*answer.names(), *answer.max_effort)
    except (TypeError, ValueError, AttributeError):
        return f"{answer!r}, whose values are not numbers"
    if not finite:
        return f"{answer!r}, in which not every value is finite"
    troubles = [trouble for name in names if (trouble := model.why_not_driven(str(name))) is not None]
    return f"a target that no motor can take: {troubles[0]}" if troubles else None


def _has_three_each(twist: Twist) -> bool:
    try:
        return len(twist.linear_xyz) == len(twist.angular_xyz) == 3
    except TypeError:
        return False
