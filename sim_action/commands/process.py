"""A controller in any language: `process: [node, controller.js]`, which is asked in lines of JSON."""

from __future__ import annotations

import json
import os
import shlex
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

from pydantic import BeforeValidator, Field, WithJsonSchema

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.answers import problem_with
from sim_action.commands.json_protocol import AnswerError, answer_of, is_acknowledgement, observation_json, robot_json
from sim_action.commands.line_protocol import Lockstep, Patience
from sim_action.commands.robot_description import RobotDescription
from sim_action.commands.saturation import Saturation
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import NamesFile, PositiveSeconds
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import Answer
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


VERSION: Final = 1
"""Of the protocol."""

# In s: no clock of a system can wait for as long as a float can say.
_A_DAY: Final = 86_400

_ENCODER: Final = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _words(value: object) -> object:
    """Text, split into words; a list is left to be checked as one. Raises ValueError."""
    if isinstance(value, str):
        try:
            value = tuple(shlex.split(value))
        except ValueError as error:
            raise ValueError(f"cannot be split into words: {error}") from None
    if isinstance(value, tuple) and any(isinstance(word, str) and "\0" in word for word in value):
        raise ValueError("a NUL cannot be part of a command")
    return value


class ProcessCommands(CommandSource):
    """Asks a program in any language for every command, by lines of JSON on its standard input and output.

    The program is started once, in the folder of the scenario. Each line that it gets on standard input is one object
    of JSON, and it answers each by one line on standard output, which it must flush. Sim time stands still meanwhile:
    an answer that is slow, but within its limit, changes nothing. Whatever else it has to say belongs on standard
    error, which is kept with the outcome.

    First it gets `{"type": "reset", "version": 1, "robot": {...}, "rate": 20.0, "seed": 0}`, where `robot` has `name`,
    `base`, `links` and `joints` (by name: `type`, `moves`, `lower`, `upper`, `max_effort`, `max_velocity`, `mimics`),
    `rate` is how often it will be asked, in Hz of sim time, and `seed` is the scenario's, for what it draws at random.
    It answers `{}`.

    Then, at every tick, it gets `{"type": "step", "time": 0.05, "pose": {...}, "twist": {...}, "joints": {...},
    "contacts": [...], "sensors": {...}}`. `pose` is that of the base link in the world frame, as `position_xyz`,
    `orientation_xyzw` and `yaw`; `twist` has `linear_xyz` and `angular_xyz`, in the world frame; each of `joints`, by
    name, `position`, `velocity` and `effort`; each contact `link`, `body`, `position_xyz` and `force`; each of
    `sensors`, by name, the fields of its latest reading. There, JSON has no infinities: where Python has inf, because
    nothing is there, it gets null, and for -inf, because something is too near to be measured, 0. An image is an object
    of `shape`, `type` (such as "uint8") and `base64`, its bytes row by row, little-endian, with infinities as they are.
    Units are SI. Keys may be added; a program should pass over those that it does not know. It answers one of these:

    - `{}` or `null`: the last command stands.
    - `{"twist": {"linear": 0.2, "angular": 0, "lateral": 0}}`: m/s and rad/s of the base, each 0 when left out.
    - `{"position": {...}, "velocity": {...}, "effort": {...}, "max_effort": {...}}`: targets for joints, by name; any
      of the four may be left out. They mean what `sim_action.JointTargets` does, and saturate as those of scripts.
    - `twist` beside these, for a base and the arm on it: both at once.

    After the run, its standard input ends. A program that has not left a second later is killed.

    Numbers are written so that whoever reads them as 64-bit floats has the same bits, and should be answered with as
    many digits (17): then the same controller in another language gives the same run. An answer has
    1 MB at the most. The program runs within `memory_limit`, which counts addresses, and with the environment of the
    job, but for `GITHUB_TOKEN`, `GH_TOKEN`, the files by which steps talk to the runner (`GITHUB_ENV`, `GITHUB_OUTPUT`,
    ...), and what begins with `ACTIONS_` or `INPUT_`.
    """

    runs_user_code: ClassVar[bool] = True

    process: Annotated[
        tuple[str, ...],
        NamesFile(if_there=True),
        BeforeValidator(_words),
        WithJsonSchema({"type": ["array", "string"], "items": {"type": "string"}, "minItems": 1, "minLength": 1}),
        Field(
            min_length=1,
            description="the program and its arguments, or text, which is split as a shell would, but no shell is run; "
            "a program with a slash in it is a file of the workspace, else it is looked for on PATH",
        ),
    ]
    answer_within: Annotated[PositiveSeconds, Field(le=_A_DAY, description="of wall time, for each answer")] = 2.0
    start_within: Annotated[
        PositiveSeconds, Field(le=_A_DAY, description="of wall time, from its start to its first answer")
    ] = 10.0

    @property
    def code(self) -> str:
        """See CommandSource.code."""
        return f"process {shlex.join(self.process)}"

    def problems(self, workspace: Workspace) -> SpecProblems:
        """A program that is not there. Nothing is run."""
        try:
            program_of(self.process[0], workspace)
        except PathError as error:
            yield ("process",), str(error)

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open: starts the program. Raises ScriptError."""
        program, *arguments = self.process
        called = shlex.join(self.process)
        robot = RobotDescription.of(scene, self.rate, self.code)
        try:
            path = program_of(program, scene.workspace)
        except PathError as error:
            raise ScriptError(str(error)) from None
        talk = _Talk(Lockstep([str(path), *arguments], scene.workspace.directory, called), scene.model, called)
        try:
            talk.reset(robot, Patience(self.start_within, "start_within"))
        except BaseException:
            talk.close()
            raise
        patience = Patience(self.answer_within, "answer_within")
        return ClosedLoop(lambda seen: talk.step(seen, patience), close=talk.close, notes=talk.notes)


class _Talk:
    """What is said to a program, and what its answers mean for this robot."""

    def __init__(self, lockstep: Lockstep, model: RobotModel, called: str) -> None:
        self._lockstep = lockstep
        self._model = model
        self._motors = Saturation(model, f"'{called}'")
        self.notes = self._motors.notes

    def close(self) -> None:
        """Ends the program, and notes what else it had to say."""
        self._lockstep.close()
        if (unasked := self._lockstep.unasked()) is not None:
            self.notes.append(unasked)

    def reset(self, robot: RobotDescription, patience: Patience) -> None:
        """Raises ScriptError."""
        head = {"type": "reset", "version": VERSION, "robot": robot_json(robot)}
        line = self._lockstep.ask(_line({**head, "rate": robot.rate, "seed": robot.seed}), patience)
        try:
            is_empty = is_acknowledgement(line)
        except AnswerError as error:
            raise self._lockstep.refusal(line, str(error)) from None
        if not is_empty:
            raise self._lockstep.refusal(
                line, "it commands something before the run has begun; reset is answered by {}"
            )

    def step(self, observation: Observation, patience: Patience) -> Answer:
        """Raises ScriptError."""
        line = self._lockstep.ask(_line({"type": "step", **observation_json(observation)}), patience)
        try:
            answer = answer_of(line)
        except AnswerError as error:
            raise self._lockstep.refusal(line, str(error)) from None
        if problem := problem_with(answer, self._model):
            raise self._lockstep.refusal(line, f"it is {problem}")
        return self._motors.of_answer(answer)


def _line(question: dict[str, Any]) -> bytes:
    try:
        return _ENCODER.encode(question).encode("utf-8", errors="replace")
    except ValueError:
        # The watchdog finds the same at the end of this period, and says more.
        raise ScriptError("the state of the robot is no longer finite") from None


def program_of(word: str, workspace: Workspace) -> Path:
    """With a slash it is a file of the workspace; else it is looked for on PATH. Raises PathError."""
    if "/" in word or os.sep in word:
        if not os.access(workspace.file(word), os.X_OK):
            raise PathError(f"'{word}' may not be executed; chmod +x, or begin with what runs it, such as python3")
        # Not what a link leads to: a Python knows its virtual environment by the name that it was called by.
        return (workspace.directory / word).absolute()
    on_path = shutil.which(word)
    if on_path is None:
        beside = workspace.directory / word
        hint = f"; the file beside the scenario is './{word}'" if beside.is_file() else ""
        raise PathError(f"no program '{word}' is on PATH{hint}")
    return Path(on_path).absolute()
