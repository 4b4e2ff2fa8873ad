"""A controller in any language: `process: [node, controller.js]`, which answers lines of JSON.

Its messages are JSON: observations and the robot's description out, commands back. Names and units are as in the
Python API. Reading is strict: an answer that could have several meanings is an error.
"""

from __future__ import annotations

import base64
import json
import math
import os
import re
import shlex
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, NoReturn

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.controller_answers import RobotDescription, Saturation, answer_problem
from sim_action.commands.line_protocol import AnswerLimit, LineProcess
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import NamesFile, PositiveSeconds
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.wording import did_you_mean, shown
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import why_no_link
from sim_action.state.command import WORLD_FRAME, Answer, Command, JointTargets, LinkWrench
from sim_action.state.observation import Contact, Observation
from sim_action.world.scene import Scene

VERSION: Final = 1  # the version of the protocol
_DAY_S: Final = 86_400  # system calls accept only limited times

# Linux refuses a longer argument, and, with the environment, about 2 MB of them.
_MAX_ARGUMENT_BYTES: Final = 131_071
_MAX_ARGUMENTS_BYTES: Final = 1_000_000
_ARGUMENT_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_ENCODER: Final = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _words(value: object) -> object:
    """Split text into words; return a list unchanged. Raises ValueError."""
    if isinstance(value, str):
        try:
            value = tuple(shlex.split(value))
        except ValueError as error:
            raise ValueError(f"the command cannot be split into words: {error}") from None
    if isinstance(value, tuple) and any(isinstance(word, str) and "\0" in word for word in value):
        raise ValueError("a command cannot contain a NUL character")
    if isinstance(value, tuple):
        _refuse_long([word for word in value if isinstance(word, str)])
    return value


def _refuse_long(arguments: Sequence[str]) -> None:
    """Raise ValueError for arguments with which no program can be started."""
    sizes = [len(argument.encode("utf-8", errors="replace")) for argument in arguments]
    for argument, size in zip(arguments, sizes, strict=True):
        if size > _MAX_ARGUMENT_BYTES:
            problem = f"the argument {argument[:20]}... has {size:,} bytes"
            raise ValueError(f"{problem}; at most {_MAX_ARGUMENT_BYTES:,} are allowed: use a file instead")
    if sum(sizes) > _MAX_ARGUMENTS_BYTES:
        problem = f"the arguments have {sum(sizes):,} bytes"
        raise ValueError(f"{problem}; at most {_MAX_ARGUMENTS_BYTES:,} are allowed: use a file instead")


def _checked_settings(settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return parameters that can be arguments. Raises ValueError."""
    if (wrong := next((name for name in settings if not _ARGUMENT_NAME.fullmatch(name)), None)) is not None:
        raise ValueError(f"{wrong!r} cannot be the name of an argument; use letters, digits, '_', '-' and '.'")
    arguments = _arguments(settings)
    if any("\0" in argument for argument in arguments):
        raise ValueError("an argument cannot contain a NUL character")
    _refuse_long(arguments)
    return settings


def _arguments(settings: Mapping[str, Any]) -> list[str]:
    """Return the arguments of a program for parameters of the scenario."""
    texts = {
        name: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        for name, value in settings.items()
    }
    return [f"--{name}={text}" for name, text in texts.items()]


class ProcessCommands(CommandSource):
    """Asks a program in any language for each command, with lines of JSON on its standard input and output.

    The program is started once, in the folder of the scenario. It answers each line with one line, which it must flush.
    Sim time stops meanwhile, so a slow answer has no effect. Write everything else to standard error; it is saved with
    the result. `with: {kp: 1.2}` adds the argument `--kp=1.2`; a value that is not text is JSON: `--gains=[1, 2]`.

    The first line describes the robot; the answer is `{}`. The lines of the built-in burger, with fewer digits, joints
    and contacts:

    ```json
    {"type":"reset","version":1,"robot":{"name":"turtlebot3_burger","base":"base_footprint","links":["base_footprint",
    "base_scan"],"joints":{"wheel_left_joint":{"type":"continuous","moves":true,"lower":null,"upper":null,
    "max_effort":10.0,"max_velocity":100.0,"mimics":null}}},"rate":20.0,"seed":0}
    ```

    Then, at every tick, a line such as

    ```json
    {"type":"step","time":0.05,"pose":{"position_xyz":[0.1,0.0,0.0],"orientation_xyzw":[0.0,0.0,0.0,1.0],"yaw":0.0},
    "twist":{"linear_xyz":[0.2,0.0,0.0],"angular_xyz":[0.0,0.0,0.0]},"joints":{"wheel_left_joint":{"position":3.03,
    "velocity":6.06,"effort":0.01}},"contacts":[{"link":"wheel_left_link","body":"ground","position_xyz":[0.1,0.08,
    0.0],"force":3.03,"has_force":true,"depth":1e-05}],"sensors":{"scan":{"time":0.0,"angle_min":-3.14,
    "angle_increment":2.09,"range_min":0.0,"range_max":10.0,"ranges":[null,1.5,0.7]}}}
    ```

    The pose and the twist describe the base link in the world frame; units are SI. Each JSON is one line, with
    other keys to ignore. In `sensors`, null stands for inf (nothing in range), and 0 for -inf (too near); an image has
    `shape`, `type` and `base64`: bytes row by row, little-endian. With `links: [tool0]`, the line has `links`: name ->
    `pose` and `twist`. The answer is one of these, or several together:

    - `{}` or `null`: the last command stays in effect.
    - `{"twist": {"linear": 0.2, "angular": 0, "lateral": 0}}`: m/s and rad/s of the base, each 0 by default.
    - `{"position": {...}, "velocity": {...}, "effort": {...}, "max_effort": {...}}`: joint targets by name, each
      optional, as in `sim_action.JointTargets`.
    - `{"wrenches": [{"link": "rotor", "force": [0, 0, 9.81], "torque": [0, 0, 0.1], "frame": "rotor"}]}`: as in
      `sim_action.LinkWrench`, with an optional `point`; only `link` is required.

    After the run, standard input is closed; a program that has not exited one second later is killed. Numbers have 17
    digits, so that they are the same 64-bit floats when read. With as many in answers, the same controller in another
    language gives the same run. An answer has at most 1 MB.
    """

    key: ClassVar[str] = "process"
    runs_user_code: ClassVar[bool] = True
    map_key: ClassVar[str | None] = "command"

    process: Annotated[
        tuple[str, ...],
        NamesFile(if_there=True),
        BeforeValidator(_words),
        WithJsonSchema({"type": ["array", "string"], "items": {"type": "string"}, "minItems": 1, "minLength": 1}),
        Field(
            min_length=1,
            description="the program and its arguments, as a list or as text, which is split like a shell command; no "
            "shell is run. A program with a slash is a file of the workspace, any other is searched on PATH",
        ),
    ]
    settings: Annotated[
        Mapping[str, Any],
        AfterValidator(_checked_settings),
        Field(alias="with", description="parameters: each is one more argument, such as --kp=1.2"),
    ] = {}
    links: Annotated[
        tuple[str, ...], Field(description="links of the robot whose pose and twist each line of a tick has")
    ] = ()
    answer_within: Annotated[PositiveSeconds, Field(le=_DAY_S, description="limit on the wall time of each answer")] = (
        2.0
    )
    start_within: Annotated[
        PositiveSeconds, Field(le=_DAY_S, description="limit on the wall time from the start to the first answer")
    ] = 10.0

    @property
    @override
    def code(self) -> str:
        return f"process {shlex.join(self.process)}"

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield a problem if the program does not exist. Nothing is run."""
        try:
            find_program(self.process[0], workspace)
        except PathError as error:
            yield ("process",), str(error)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems. Yield links that the robot does not have."""
        for index, name in enumerate(self.links):
            if (problem := why_no_link(scene.model, name)) is not None:
                yield ("links", index), problem

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Start the program. Raises ScriptError."""
        program, *arguments = *self.process, *_arguments(self.settings)
        called = shlex.join(self.process)
        robot = RobotDescription.of(scene, self.rate, self.code)
        try:
            path = find_program(program, scene.workspace)
        except PathError as error:
            raise ScriptError(str(error)) from None
        process = LineProcess([str(path), *arguments], scene.workspace.directory, called)
        session = _Session(process, scene, called, self.links)
        try:
            session.reset(robot, AnswerLimit(self.start_within, "start_within"))
        except BaseException:
            session.close()
            raise
        limit = AnswerLimit(self.answer_within, "answer_within")
        return ClosedLoop(lambda seen: session.step(seen, limit), close=session.close, notes=session.notes)


class _Session:
    """The exchange of messages with a program."""

    def __init__(self, lockstep: LineProcess, scene: Scene, called: str, links: tuple[str, ...]) -> None:
        self._lockstep, self._links = lockstep, links
        self._scene = scene
        self._motors = Saturation(scene.model, f"'{called}'")
        self.notes = self._motors.notes

    def close(self) -> None:
        """End the program, and add a note if it wrote too many lines."""
        self._lockstep.close()
        if (unasked := self._lockstep.unasked()) is not None:
            self.notes.append(unasked)

    def reset(self, robot: RobotDescription, limit: AnswerLimit) -> None:
        """Send the first line. Raises ScriptError."""
        head = {"type": "reset", "version": VERSION, "robot": robot_json(robot)}
        line = self._lockstep.ask(_line({**head, "rate": robot.rate, "seed": robot.seed}), limit)
        try:
            is_empty = is_empty_answer(line)
        except AnswerError as error:
            raise self._lockstep.refusal(line, str(error)) from None
        if not is_empty:
            raise self._lockstep.refusal(line, "it contains a command, but the run has not begun; answer reset with {}")

    def step(self, observation: Observation, limit: AnswerLimit) -> Answer:
        """Send an observation and return the answer. Raises ScriptError."""
        line = self._lockstep.ask(_line({"type": "step", **observation_json(observation, self._links)}), limit)
        try:
            answer = parse_answer(line)
        except AnswerError as error:
            raise self._lockstep.refusal(line, str(error)) from None
        if problem := answer_problem(answer, self._scene):
            raise self._lockstep.refusal(line, f"it is {problem}")
        return self._motors.clip_answer(answer)


def _line(question: dict[str, Any]) -> bytes:
    try:
        return _ENCODER.encode(question).encode("utf-8", errors="replace")
    except ValueError:
        # The watchdog reports the same at the end of this period, with more detail.
        raise ScriptError("the state of the robot is no longer finite") from None


def find_program(word: str, workspace: Workspace) -> Path:
    """Return the path of a program: a file of the workspace if it has a slash, else from PATH. Raises PathError."""
    if "/" in word or os.sep in word:
        if not os.access(workspace.file(word), os.X_OK):
            raise PathError(
                f"'{word}' is not executable; run chmod +x, or start it with an interpreter such as python3"
            )
        # Links are kept: Python finds its virtual environment by the name it is called by.
        return (workspace.directory / word).absolute()
    on_path = shutil.which(word)
    if on_path is None:
        beside = workspace.directory / word
        is_beside = os.path.isfile(beside)  # noqa: PTH113 - a name that is too long is no file
        hint = f"; for the file next to the scenario, write './{word}'" if is_beside else ""
        raise PathError(f"program {shown(word)} was not found on PATH{hint}")
    return Path(on_path).absolute()


Json = dict[str, Any]
_TARGETS: Final = ("position", "velocity", "effort", "max_effort")
_WRENCH: Final = ("link", "force", "torque", "frame", "point")
_SPEEDS: Final = ("linear", "angular", "lateral")


def observation_json(observation: Observation, links: Collection[str] = ()) -> Json:
    """Return an observation as JSON values, with the state of some links; numbers keep all their bits."""
    document = {
        "time": observation.time,
        "pose": _pose(observation.pose),
        "twist": _twist(observation.twist),
        "joints": {name: state._asdict() for name, state in observation.joints.items()},
        "contacts": [_contact(contact) for contact in observation.contacts],
        "sensors": {name: _record(reading, _value) for name, reading in observation.sensors.items()},
    }
    if links:
        states = {name: observation.links[name] for name in links}
        document["links"] = {name: {"pose": _pose(at.pose), "twist": _twist(at.twist)} for name, at in states.items()}
    return document


def robot_json(robot: RobotDescription) -> Json:
    """Return the description of the robot as JSON values, without rate and seed."""
    joints = {name: _record(joint, _limit) for name, joint in robot.joints.items()}
    return {"name": robot.name, "base": robot.base, "links": robot.links, "joints": joints}


def _record(record: Any, as_json: Callable[[Any], Any]) -> Json:
    return {field.name: as_json(getattr(record, field.name)) for field in fields(record)}


def _value(value: Any) -> Any:
    """Return a field of a reading as a JSON value. JSON has no infinities.

    Only distances can be infinite (ROS REP 117): inf means that nothing is in range, and becomes null; -inf means that
    something is too near to be measured, and becomes 0, which a sensor with a minimum range never measures.
    """
    match value:
        case Pose():
            return _pose(value)
        case Twist():
            return _twist(value)
        case float():
            return value if math.isfinite(value) else 0.0 if value == -math.inf else None
        case tuple() | list():
            return [_value(item) for item in value]
        case _ if hasattr(value, "__array_interface__"):
            return _array(value)
        case _:
            return value


def _array(array: Any) -> Any:
    """Return a list for an array of one dimension, and the bytes for more dimensions, such as an image."""
    if array.ndim <= 1:
        return _value(array.tolist())
    data = array.astype(array.dtype.newbyteorder("<"), order="C", copy=False).tobytes()
    return {"shape": list(array.shape), "type": array.dtype.name, "base64": base64.b64encode(data).decode("ascii")}


def _pose(pose: Pose) -> Json:
    return {"position_xyz": pose.position_xyz, "orientation_xyzw": pose.orientation_xyzw, "yaw": pose.yaw}


def _twist(twist: Twist) -> Json:
    return {"linear_xyz": twist.linear_xyz, "angular_xyz": twist.angular_xyz}


def _contact(contact: Contact) -> Json:
    return {name: value for name, value in contact._asdict().items() if name not in ("time", "normal_xyz")}


def _limit(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


class AnswerError(ValueError):
    """A line is not a valid answer; in the message, "it" is the line."""


def parse_answer(line: bytes) -> Answer:
    """Return the command in an answer; None if the last command stays in effect. Raises AnswerError."""
    answer = _object(_parsed_line(line))
    _check_keys(answer, ("twist", *_TARGETS, "wrenches"), "it")
    commands: list[Command] = [_twist_command(answer["twist"])] if "twist" in answer else []
    if any(key in answer for key in _TARGETS):
        position, velocity, effort, max_effort = (_numbers(answer.get(key, {}), key) for key in _TARGETS)
        commands.append(JointTargets(position, velocity, effort, max_effort))
    if "wrenches" in answer:
        commands += _wrench_commands(answer["wrenches"])
    return tuple(commands) if len(commands) > 1 else next(iter(commands), None)


def is_empty_answer(line: bytes) -> bool:
    """Return True if an answer contains no command. Raises AnswerError."""
    return parse_answer(line) is None


def _parsed_line(line: bytes) -> Any:
    try:
        return json.loads(line, object_pairs_hook=_without_duplicates, parse_constant=_refuse_constant)
    except UnicodeDecodeError:
        raise AnswerError("it is not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise AnswerError(f"it is not JSON: {error.msg} (column {error.colno})") from None
    except RecursionError:
        raise AnswerError("it is nested too deeply") from None
    except AnswerError:
        raise
    except ValueError as error:  # such as an integer of thousands of digits
        raise AnswerError(f"it cannot be read: {error}") from None


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members: dict[str, Any] = {}
    for name, value in pairs:
        if name in members:
            raise AnswerError(f"it contains the key {shown(name)} twice")
        members[name] = value
    return members


def _refuse_constant(name: str) -> NoReturn:
    raise AnswerError(f"it contains {name}, which is neither JSON nor a valid target")


def _object(value: Any) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise AnswerError(f"it is {_shown(value)}; expected an object, such as {{}}")
    return value


def _check_keys(members: Mapping[str, Any], allowed: Collection[str], where: str) -> None:
    for key in members:
        if key not in allowed:
            raise AnswerError(f"{where} contains the unknown key {shown(key)}{did_you_mean(key, allowed)}")


def _twist_command(value: Any) -> Twist:
    speeds = _numbers(value, "twist")
    _check_keys(speeds, _SPEEDS, "'twist'")
    return Twist.planar(speeds.get("linear", 0.0), speeds.get("angular", 0.0), lateral=speeds.get("lateral", 0.0))


def _wrench_commands(value: Any) -> Iterator[LinkWrench]:
    if not isinstance(value, list):
        raise AnswerError(f"'wrenches' is {_shown(value)}; expected a list of objects")
    for index, wrench in enumerate(value):
        where = f"wrenches.{index}"
        if not isinstance(wrench, dict):
            raise AnswerError(f"'{where}' is {_shown(wrench)}; expected an object with 'link' and 'force' or 'torque'")
        _check_keys(wrench, _WRENCH, f"'{where}'")
        if "link" not in wrench:
            raise AnswerError(f"'{where}' has no 'link'")
        vectors = (_vector(wrench.get(key, [0, 0, 0]), f"{where}.{key}") for key in ("force", "torque", "point"))
        force, torque, point = vectors
        link, frame = (_name(wrench.get(key, WORLD_FRAME), f"{where}.{key}") for key in ("link", "frame"))
        yield LinkWrench(link, force, torque, frame, point)


def _name(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise AnswerError(f"'{where}' is {_shown(value)}; expected a name")
    return value


def _vector(value: Any, where: str) -> Vector3:
    if not isinstance(value, list) or len(value) != 3:
        raise AnswerError(f"'{where}' is {_shown(value)}; expected a list of 3 numbers")
    x, y, z = (_number(number, f"'{where}.{index}'") for index, number in enumerate(value))
    return x, y, z


def _numbers(value: Any, where: str) -> dict[str, float]:
    if not isinstance(value, dict):
        raise AnswerError(f"'{where}' is {_shown(value)}; expected an object of numbers by name")
    return {name: _number(number, f"'{where}.{name}'") for name, number in value.items()}


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise AnswerError(f"{where} is {_shown(value)}; expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise AnswerError(f"{where} is too large")
    return number


def _shown(value: Any) -> str:
    return "null" if value is None else "an object" if isinstance(value, dict) else shown(value)
