"""Programs as command sources: what is read of them, and what is said to and by a real one."""

from __future__ import annotations

import base64
import json
import math
import shutil
import struct
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError

from sim_action.commands import ClosedLoop
from sim_action.commands.controller_answers import RobotDescription
from sim_action.commands.external_program import (
    AnswerError,
    ProcessCommands,
    find_program,
    observation_json,
    parse_answer,
    robot_json,
)
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Pose, Twist
from sim_action.core.workspace import PathError, Workspace
from sim_action.state.command import JointTargets, LinkWrench, commands_of, is_finite
from sim_action.state.observation import Contact, JointState, LinkState, Observation
from sim_action.state.readings import ContactReading, ImuReading, OdometryReading, Reading
from tests.scenarios import LEAST, load, told
from tests.soak import examples
from tests.traces import START, scene

COMMANDS = "  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n"

ANSWERS = """\
import json, sys
heard = []
for line in sys.stdin:
    heard.append(json.loads(line))
    print({}, flush=True)
"""


def spec(folder: Path, program: str, **more: Any) -> ProcessCommands:
    (folder / "ctl.py").write_text(program)
    return ProcessCommands(process=(sys.executable.rpartition("/")[2], "ctl.py"), **more)


@contextmanager
def opened(folder: Path, program: str, **more: Any) -> Iterator[ClosedLoop]:
    controller = spec(folder, program, **more).open(replace(scene(), workspace=Workspace(folder, folder), seed=9))
    assert isinstance(controller, ClosedLoop)
    try:
        yield controller
    finally:
        controller.close()


def answering(answer: str) -> str:
    """A program that answers the first line with {}, and all others so."""
    return ANSWERS.format(f"'{{}}' if len(heard) == 1 else {answer!r}")


def refusal(folder: Path, answer: str) -> str:
    with opened(folder, answering(answer)) as controller, pytest.raises(ScriptError) as raised:
        controller.command(START)
    return str(raised.value).partition("ctl.py' ")[2]


@pytest.fixture(autouse=True)
def python_is_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", sys.executable.rpartition("/")[0], prepend=":")


@pytest.mark.process
def test_an_answer_is_a_command(tmp_path: Path) -> None:
    answer = '{"twist": {"angular": 1}, "velocity": {"wheel_left_joint": 3}}'
    command = (Twist.planar(0, 1), JointTargets(velocity={"wheel_left_joint": 3.0}))
    with opened(tmp_path, answering(answer)) as controller:
        assert controller.command(START) == controller.command(START) == command


@pytest.mark.process
@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("forward", "answered 'forward': it is not JSON: Expecting value (column 1)"),
        ('{"max_effort": {"wheel_left_joint": -1}}', "a negative max_effort for joint 'wheel_left_joint'"),
    ],
)
def test_any_other_answer_is_an_error_that_quotes_it(answer: str, why: str, tmp_path: Path) -> None:
    assert why in refusal(tmp_path, answer)


@pytest.mark.process
def test_it_hears_of_its_robot_and_then_what_there_is_to_see(tmp_path: Path) -> None:
    keep = "if len(heard) == 3: json.dump(heard, open('heard.json', 'w'))"
    program = ANSWERS.replace("    print", f"    {keep}\n    print").format("'null'")
    seen = replace(START, links={"base_scan": LinkState(Pose((1.0, 2.0, 3.0)), Twist())})
    with opened(tmp_path, program, rate=20, links=("base_scan",)) as controller:
        controller.command(seen)
        controller.command(replace(seen, time=0.05))
    reset, first, second = json.loads((tmp_path / "heard.json").read_text())
    assert (reset["type"], reset["version"], reset["rate"], reset["seed"]) == ("reset", 1, 20.0, 9)
    assert reset["robot"]["joints"]["wheel_left_joint"]["moves"]
    assert (first["type"], first["time"], second["time"]) == ("step", 0.0, 0.05)
    assert first.keys() == {"type", "time", "pose", "twist", "joints", "contacts", "sensors", "links"}
    assert first["links"]["base_scan"]["pose"]["position_xyz"] == [1.0, 2.0, 3.0]


@pytest.mark.process
def test_its_parameters_are_arguments(tmp_path: Path) -> None:
    program = "import json, sys\njson.dump(sys.argv[1:], open('heard.json', 'w'))\nfor line in sys.stdin:\n"
    program += "    print('{}', flush=True)\n"
    settings = {"kp": -1.2, "name": "a b", "slow": True, "gains": (1, {"x": None}), "empty": "", "k.p-i_d": 1e-9}
    source = ProcessCommands.model_validate({**spec(tmp_path, program).model_dump(by_alias=True), "with": settings})
    controller = source.open(replace(scene(), workspace=Workspace(tmp_path, tmp_path)))
    assert isinstance(controller, ClosedLoop)
    controller.close()
    assert json.loads((tmp_path / "heard.json").read_text()) == [
        *("--kp=-1.2", "--name=a b", "--slow=true", '--gains=[1, {"x": null}]', "--empty=", "--k.p-i_d=1e-09")
    ]


def test_unknown_links_are_refused_with_the_nearest_name() -> None:
    source = ProcessCommands.model_validate({"process": "python3 a.py", "links": ("base_scan", "base_scn")})
    ((path, message),) = source.model_problems(scene())
    assert path == ("links", 1)
    assert message.startswith("the robot has no link 'base_scn'; did you mean 'base_scan'?")


@pytest.mark.process
def test_a_bad_start_and_a_state_that_is_not_finite_are_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(ScriptError, match=r"answer reset with \{\}"),
        opened(tmp_path, ANSWERS.format("""'{"twist": {}}'""")),
    ):
        pass
    slow = "import time; time.sleep(600)"
    with (
        pytest.raises(ScriptError, match=r"within 0\.2 s of wall time \(start_within\)"),
        opened(tmp_path, slow, start_within=0.2),
    ):
        pass
    with opened(tmp_path, answering("{}")) as controller, pytest.raises(ScriptError, match="no longer finite"):
        controller.command(replace(START, time=float("nan")))


@pytest.mark.process
def test_motors_saturate_and_that_is_noted(tmp_path: Path) -> None:
    there = scene()
    joints = tuple(replace(joint, max_effort=2.0) for joint in there.model.joints)
    limited = replace(there, model=replace(there.model, joints=joints), workspace=Workspace(tmp_path, tmp_path))
    controller = spec(tmp_path, answering('{"effort": {"wheel_left_joint": 9}}')).open(limited)
    assert isinstance(controller, ClosedLoop)
    assert controller.command(START) == JointTargets(effort={"wheel_left_joint": 2.0})
    controller.close()
    (note,) = controller.notes
    assert "commanded 9 N m for joint 'wheel_left_joint'; it was clipped to 2 N m" in note


def test_text_is_split_as_a_shell_would_and_a_list_is_not() -> None:
    assert ProcessCommands.model_validate({"process": "node 'my controller.js' --fast"}).process == (
        "node",
        "my controller.js",
        "--fast",
    )
    assert ProcessCommands(process=("node", "my controller.js")).process == ("node", "my controller.js")


@pytest.mark.parametrize(
    ("entry", "problem"),
    [
        ("no-such-program x", "5:3: commands.process: program 'no-such-program' was not found on PATH"),
        ("[no-such-program, x]", "5:3: commands.process: program 'no-such-program' was not found on PATH"),
        ("./absent", "'./absent' does not exist (looked for "),
        ("'\"open'", "cannot be split into words: No closing quotation"),
        ("''", "must not be empty"),
        ("[]", "must not be empty"),
        ("{command: {a: b}}", "expected a list, found a map of keys"),
        ("[sleep, 3]", "expected text, found 3; put it in quotes"),
        ("{a: b}", "5:13: commands.process.a: unknown key (allowed: answer_within, command, "),
        ('["a\\0b"]', "a command cannot contain a NUL character"),
        ("sh\n  answer_within: 0", "6:3: commands.answer_within: must be greater than 0, found 0"),
        ("sh\n  answer_within: 1e12", "6:3: commands.answer_within: must be at most 86,400 s"),
        ("sh\n  start_within: 1e12", "6:3: commands.start_within: must be at most 86,400 s"),
        ("sh\n  answer: 3", "unknown key; did you mean 'answer_within'?"),
    ],
)
def test_what_cannot_work_is_told_on_its_line(entry: str, problem: str, tmp_path: Path) -> None:
    text = LEAST.replace(COMMANDS, f"  process: {entry}\n")
    (found,) = told(tmp_path, text)
    assert problem in found


def test_a_program_that_is_there_is_not_run_by_loading(tmp_path: Path) -> None:
    loaded = load(tmp_path, LEAST.replace(COMMANDS, "  process: [sh, -c, 'touch ran']\n"))
    assert loaded.scenario.runs_user_code
    assert not (tmp_path / "ran").exists()


def found(folder: Path, word: str) -> Path:
    return find_program(word, Workspace(folder, folder))


def test_a_word_is_looked_for_on_path_and_one_with_a_slash_in_the_workspace(tmp_path: Path) -> None:
    assert str(found(tmp_path, "sh")) == shutil.which("sh")
    program = tmp_path / "bin/controller"
    program.parent.mkdir()
    program.touch(0o700)
    assert found(tmp_path, "./bin/controller") == found(tmp_path, "bin/controller") == program
    # A link is run under its own name, by which a Python knows its virtual environment, and busybox its applet.
    (tmp_path / "link").symlink_to("bin/controller")
    assert found(tmp_path, "./link") == tmp_path / "link"
    with pytest.raises(ScriptError, match=r"'\./gone' does not exist"):
        ProcessCommands(process=("./gone",)).open(replace(scene(), workspace=Workspace(tmp_path, tmp_path)))


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("no-such-program", "program 'no-such-program' was not found on PATH"),
        ("controller", "program 'controller' was not found on PATH; for the file next to the scenario, write './contr"),
        ("./controller", "'./controller' is not executable; run chmod +x, or start it with an interpreter"),
        ("./absent", "'./absent' does not exist"),
        ("../out", "outside the workspace"),
        ("/bin/sh", "outside the workspace"),
        ("./", "is a folder"),
    ],
)
def test_what_is_no_program(word: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "controller").touch(0o600)
    with pytest.raises(PathError) as raised:
        found(tmp_path, word)
    assert why in str(raised.value)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"with": {"kp": "x" * 131_065}}, None),
        ({"with": {"kp": "x" * 131_067}}, "the argument --kp=xxxxxxxxxxxxxxx... has 131,072 bytes; at most 131,071 ar"),
        ({"with": {"kp": "\u00e9" * 70_000}}, "has 140,005 bytes"),
        ({"with": {f"k{number}": "x" * 100_000 for number in range(11)}}, "the arguments have 1,100,056 bytes; at mos"),
        ({"process": ("sh", "x" * 200_000)}, "has 200,000 bytes; at most 131,071 are allowed: use a file instead"),
    ],
)
def test_arguments_that_no_program_can_have_are_refused(keys: dict[str, Any], message: str | None) -> None:
    spec = {"process": ("sh",), **keys}
    if message is None:
        assert ProcessCommands.model_validate(spec)
        return
    with pytest.raises(ValidationError) as raised:
        ProcessCommands.model_validate(spec)
    assert message in str(raised.value)


SEEN = Observation(
    time=0.1 + 0.2,
    pose=Pose((1 / 3, -2.0, 1e-9), (0.0, 0.0, math.sin(0.5), math.cos(0.5))),
    twist=Twist((0.1, 0.0, -0.0), (0.0, 0.0, 2.0)),
    joints={"wheel": JointState(1.0, 2.0, 3.0)},
    contacts=(Contact(0.3, "base", "ground", (0.1, 0.2, 0.3), 9.81, depth=0.002),),
    sensors={"bumper": ContactReading(time=0.25, touching=True, force=1.5, bodies=("wall",))},
)


def through_json(seen: Observation) -> Any:
    return json.loads(json.dumps(observation_json(seen), allow_nan=False))


def test_everything_that_python_sees_is_there() -> None:
    assert through_json(SEEN) == {
        "time": 0.1 + 0.2,
        "pose": {
            "position_xyz": [1 / 3, -2.0, 1e-9],
            "orientation_xyzw": [0.0, 0.0, math.sin(0.5), math.cos(0.5)],
            "yaw": pytest.approx(1.0),
        },
        "twist": {"linear_xyz": [0.1, 0.0, -0.0], "angular_xyz": [0.0, 0.0, 2.0]},
        "joints": {"wheel": {"position": 1.0, "velocity": 2.0, "effort": 3.0}},
        "contacts": [
            {
                "link": "base",
                "body": "ground",
                "position_xyz": [0.1, 0.2, 0.3],
                "force": 9.81,
                "has_force": True,
                "depth": 0.002,
            }
        ],
        "sensors": {"bumper": {"time": 0.25, "touching": True, "force": 1.5, "bodies": ["wall"]}},
    }


def test_links_are_there_if_they_are_asked_for() -> None:
    state = LinkState(Pose((1.0, 2.0, 3.0)), Twist((4.0, 5.0, 6.0), (7.0, 8.0, 9.0)))
    seen = replace(SEEN, links={"tool0": state, "hand": state})
    assert "links" not in through_json(seen)
    assert json.loads(json.dumps(observation_json(seen, ("tool0",))))["links"] == {
        "tool0": {
            "pose": {"position_xyz": [1.0, 2.0, 3.0], "orientation_xyzw": [0.0, 0.0, 0.0, 1.0], "yaw": 0.0},
            "twist": {"linear_xyz": [4.0, 5.0, 6.0], "angular_xyz": [7.0, 8.0, 9.0]},
        }
    }


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_keep_their_bits(number: float) -> None:
    found = through_json(replace(SEEN, joints={"wheel": JointState(number, 0.0, 0.0)}))
    assert struct.pack("d", found["joints"]["wheel"]["position"]) == struct.pack("d", number)


def test_readings_have_the_fields_that_they_have_in_python() -> None:
    pose, twist = Pose((1.0, 2.0, 0.0)), Twist.planar(0.5)
    sensors: dict[str, Reading] = {
        "imu": ImuReading(0.1, (0.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.0, 9.81)),
        "odom": OdometryReading(0.2, pose, twist),
    }
    found = through_json(replace(SEEN, sensors=sensors))["sensors"]
    assert found["imu"] == {
        "time": 0.1,
        "orientation_xyzw": [0.0, 0.0, 0.0, 1.0],
        "angular_velocity_xyz": [0.1, 0.2, 0.3],
        "linear_acceleration_xyz": [0.0, 0.0, 9.81],
    }
    assert found["odom"]["pose"]["position_xyz"] == [1.0, 2.0, 0.0]
    assert found["odom"]["twist"]["linear_xyz"] == [0.5, 0.0, 0.0]


@dataclass(frozen=True)
class Whatever:
    """A reading of a kind that is still to come."""

    time: float
    value: Any

    def columns(self) -> Mapping[str, Any]:
        return {}


def as_told(value: Any) -> Any:
    return through_json(replace(SEEN, sensors={"s": Whatever(0.0, value)}))["sensors"]["s"]["value"]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (math.inf, None),
        (math.nan, None),
        ((1.0, -math.inf, "a"), [1.0, 0.0, "a"]),
        (np.array([0.5, np.inf, -np.inf, np.nan]), [0.5, None, 0.0, None]),
        (np.array([1, 2], dtype=np.int32), [1, 2]),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (Pose((1.0, 2.0, 3.0)), {"position_xyz": [1.0, 2.0, 3.0], "orientation_xyzw": [0, 0, 0, 1.0], "yaw": 0.0}),
        (Twist((1.0, 2.0, 3.0)), {"linear_xyz": [1.0, 2.0, 3.0], "angular_xyz": [0.0, 0.0, 0.0]}),
        (None, None),
    ],
)
def test_readings_become_what_json_has(value: Any, expected: Any) -> None:
    assert as_told(value) == expected


@pytest.mark.parametrize(
    "image",
    [
        np.arange(24, dtype=np.uint8).reshape(2, 4, 3),
        np.arange(24, dtype=np.uint8).reshape(2, 4, 3)[:, ::2],
        np.arange(6, dtype=">f4").reshape(2, 3),
    ],
    ids=["plain", "a view with gaps", "big-endian"],
)
def test_an_image_is_its_bytes_row_by_row(image: NDArray[Any]) -> None:
    found = as_told(image)
    assert found["type"] == image.dtype.name
    kind = np.dtype(found["type"]).newbyteorder("<")
    again = np.frombuffer(base64.b64decode(found["base64"]), dtype=kind).reshape(found["shape"])
    assert (again == image).all()


def test_a_robot_is_told_without_infinities() -> None:
    there = scene()
    joints = tuple(replace(joint, lower=-math.inf, upper=1.5) for joint in there.model.joints)
    robot = RobotDescription.of(replace(there, model=replace(there.model, joints=joints)), 20.0, "p")
    found = json.loads(json.dumps(robot_json(robot), allow_nan=False))
    assert (found["name"], found["base"]) == ("turtlebot3_burger", "base_footprint")
    assert "wheel_left_link" in found["links"]
    assert found["joints"]["wheel_left_joint"] == {
        "type": "continuous",
        "moves": True,
        "lower": None,
        "upper": 1.5,
        "max_effort": robot.joints["wheel_left_joint"].max_effort,
        "max_velocity": robot.joints["wheel_left_joint"].max_velocity,
        "mimics": None,
    }


MANY = '"{}":1'


@pytest.mark.parametrize(
    ("line", "command"),
    [
        (b"{}", None),
        (b"null", None),
        (b" {} \r", None),
        (b'{"twist": {"linear": 0.2}}', Twist.planar(0.2)),
        (b'{"twist": {"linear": 1, "angular": -2, "lateral": 3e-1}}', Twist.planar(1.0, -2.0, lateral=0.3)),
        (b'{"twist": {}}', Twist()),
        (b'{"position": {"a": 1}}', JointTargets(position={"a": 1.0})),
        (
            b'{"velocity": {"a": 1}, "effort": {"b": 2}, "max_effort": {"a": 3}}',
            JointTargets(velocity={"a": 1.0}, effort={"b": 2.0}, max_effort={"a": 3.0}),
        ),
        ('{"position": {"gelenk_für_öl": 1}}'.encode(), JointTargets(position={"gelenk_für_öl": 1.0})),
        (b'{"velocity": {}}', JointTargets()),
        (
            b'{"position": {"a": 1}, "twist": {"linear": 0.2}, "max_effort": {"a": 3}}',
            (Twist.planar(0.2), JointTargets(position={"a": 1.0}, max_effort={"a": 3.0})),
        ),
        (b'{"wrenches": []}', None),
        (b'{"wrenches": [{"link": "rotor", "force": [0, 0, 9.81]}]}', LinkWrench("rotor", (0.0, 0.0, 9.81))),
        (
            b'{"wrenches": [{"link": "a", "torque": [0, 0, 1], "frame": "base"}, {"link": "b", "point": [1, 2, 3]}]}',
            (LinkWrench("a", torque_xyz=(0.0, 0.0, 1.0), frame="base"), LinkWrench("b", point_xyz=(1.0, 2.0, 3.0))),
        ),
        (
            b'{"effort": {"j": 1}, "wrenches": [{"link": "a", "force": [1, 0, 0], "frame": "a"}]}',
            (JointTargets(effort={"j": 1.0}), LinkWrench("a", (1.0, 0.0, 0.0), frame="a")),
        ),
    ],
)
def test_what_an_answer_means(line: bytes, command: object) -> None:
    assert parse_answer(line) == command


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"", "is not JSON: Expecting value (column 1)"),
        (b"hello", "is not JSON: Expecting value (column 1)"),
        (b"{} {}", "is not JSON: Extra data (column 4)"),
        (b"{'twist': 1}", "is not JSON: Expecting property name"),
        (b"\xff{}", "is not UTF-8 text"),
        (b"[" * 100_000, "is nested too deep"),
        (b"1.0", "it is 1.0; expected an object, such as {}"),
        (b"[1, 2]", "it is a list of 2; expected an object"),
        (b'"forward"', "it is 'forward'; expected an object"),
        (b"true", "it is true; expected an object"),
        (b'{"twits": {}}', "it contains the unknown key 'twits'; did you mean 'twist'?"),
        (b'{"twist": {"liner": 1}}', "'twist' contains the unknown key 'liner'; did you mean 'linear'?"),
        (
            b'{"twist": {}, "x": 1}',
            "it contains the unknown key 'x' (allowed: effort, max_effort, position, twist, velocity, wrenches)",
        ),
        (b'{"twist": {"linear": 1, "linear": 2}}', "contains the key 'linear' twice"),
        (b'{"a": 1, "b": 1, "b": 1, "a": 1}', "contains the key 'b' twice"),
        # As many keys as a line may have: to compare each with all others would take minutes.
        (f"{{{','.join(map(MANY.format, range(90_000)))},{MANY.format(89_999)}}}".encode(), "contains the key '89999'"),
        (b'{"twist": 1}', "'twist' is 1; expected an object of numbers by name"),
        (b'{"twist": null}', "'twist' is null; expected an object of numbers by name"),
        (b'{"position": [1, 2]}', "'position' is a list of 2; expected an object of numbers by name"),
        (b'{"position": {"a": "1"}}', "'position.a' is '1'; expected a number"),
        (b'{"position": {"a": true}}', "'position.a' is true; expected a number"),
        (b'{"position": {"a": null}}', "'position.a' is null; expected a number"),
        (b'{"position": {"a": {}}}', "'position.a' is an object; expected a number"),
        (b'{"wrenches": {"link": "a"}}', "'wrenches' is an object; expected a list of objects"),
        (b'{"wrenches": ["a"]}', "'wrenches.0' is 'a'; expected an object with 'link' and 'force' or 'torque'"),
        (b'{"wrenches": [{"force": [0, 0, 1]}]}', "'wrenches.0' has no 'link'"),
        (b'{"wrenches": [{"link": "a"}, {"link": "b", "forces": 1}]}', "'wrenches.1' contains the unknown key 'forces"),
        (b'{"wrenches": [{"link": 1}]}', "'wrenches.0.link' is 1; expected a name"),
        (b'{"wrenches": [{"link": "a", "frame": null}]}', "'wrenches.0.frame' is null; expected a name"),
        (b'{"wrenches": [{"link": "a", "force": 9.81}]}', "'wrenches.0.force' is 9.81; expected a list of 3 numbers"),
        (b'{"wrenches": [{"link": "a", "torque": [1, 2]}]}', "'wrenches.0.torque' is a list of 2; expected a list of"),
        (b'{"wrenches": [{"link": "a", "point": [1, "2", 3]}]}', "'wrenches.0.point.1' is '2'; expected a number"),
        (b'{"twist": {"linear": NaN}}', "contains NaN, which is neither JSON nor a valid target"),
        (b'{"twist": {"linear": -Infinity}}', "contains -Infinity, which is neither JSON nor"),
        (b'{"twist": {"linear": 1e999}}', "'twist.linear' is too large"),
        (b'{"twist": {"linear": 1' + b"0" * 400 + b"}}", "'twist.linear' is too large"),
        (b'{"twist": {"linear": 1' + b"0" * 5000 + b"}}", "cannot be read: "),
    ],
)
def test_why_an_answer_is_none(line: bytes, why: str) -> None:
    with pytest.raises(AnswerError) as raised:
        parse_answer(line)
    assert why in str(raised.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.sampled_from(["twist", "linear", "effort"]), inner),
)


speeds = st.dictionaries(st.sampled_from(["linear", "lateral", "angular"]), st.floats() | st.integers())
targets = st.dictionaries(st.text(), st.floats() | st.integers())
answers = st.fixed_dictionaries(
    {}, optional={"twist": speeds, "position": targets, "velocity": targets, "effort": targets}
)


@examples(40)
@given((answers | answers | answers | json_values).map(lambda value: json.dumps(value).encode()) | st.binary())
@example(b'{"twist": {"linear": 1e308}}')
def test_whatever_is_answered_is_a_command_or_an_error(line: bytes) -> None:
    try:
        answer = parse_answer(line)
    except AnswerError:
        return
    assert all(is_finite(command) for command in commands_of(answer))


numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(numbers, numbers, numbers)
def test_twists_come_through_as_they_are(linear: float, angular: float, lateral: float) -> None:
    speeds: dict[str, Any] = {"linear": linear, "angular": angular, "lateral": lateral}
    command = parse_answer(json.dumps({"twist": speeds}).encode())
    assert command == Twist.planar(linear, angular, lateral=lateral)
    assert isinstance(command, Twist)
    assert math.copysign(1, command.linear_xyz[0]) == math.copysign(1, linear)
