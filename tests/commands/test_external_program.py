"""Programs as command sources: what is read of them, and what is said to and by a real one."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.commands import ClosedLoop
from sim_action.commands.external_program import ProcessCommands, find_program
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Pose, Twist
from sim_action.core.workspace import PathError, Workspace
from sim_action.state.command import JointTargets
from sim_action.state.observation import LinkState
from tests.scenarios import LEAST, load, told
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
@pytest.mark.parametrize(
    ("answer", "command"),
    [
        ("{}", None),
        ("null", None),
        ('{"twist": {"linear": 0.2}}', Twist.planar(0.2)),
        ('{"velocity": {"wheel_left_joint": 3}}', JointTargets(velocity={"wheel_left_joint": 3.0})),
        (
            '{"twist": {"angular": 1}, "velocity": {"wheel_left_joint": 3}}',
            (Twist.planar(0, 1), JointTargets(velocity={"wheel_left_joint": 3.0})),
        ),
    ],
)
def test_an_answer_is_a_command(answer: str, command: object, tmp_path: Path) -> None:
    with opened(tmp_path, answering(answer)) as controller:
        assert controller.command(START) == controller.command(START) == command


@pytest.mark.process
@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("forward", "answered 'forward': it is not JSON: Expecting value (column 1)"),
        ('{"twist": {"linear": NaN}}', ": it contains NaN, which is neither JSON nor a valid target"),
        ('{"velocity": {"wheel_lft_joint": 1}}', "no moving joint 'wheel_lft_joint'; did you mean 'wheel_left_joint'?"),
        ('{"max_effort": {"wheel_left_joint": -1}}', "a negative max_effort for joint 'wheel_left_joint'"),
    ],
)
def test_any_other_answer_is_an_error_that_quotes_it(answer: str, why: str, tmp_path: Path) -> None:
    assert why in refusal(tmp_path, answer)


@pytest.mark.process
def test_it_hears_of_its_robot_and_then_what_there_is_to_see(tmp_path: Path) -> None:
    with opened(tmp_path, ANSWERS.format("json.dumps({}) if len(heard) < 3 else json.dumps(heard)"), rate=20) as found:
        assert found.command(START) is None
        with pytest.raises(ScriptError, match=": it is a list of 3"):
            found.command(START)
    keep = "if len(heard) == 3: json.dump(heard, open('heard.json', 'w'))"
    program = ANSWERS.replace("    print", f"    {keep}\n    print").format("'null'")
    with opened(tmp_path, program, rate=20) as controller:
        controller.command(START)
        controller.command(replace(START, time=0.05))
    reset, first, second = json.loads((tmp_path / "heard.json").read_text())
    assert (reset["type"], reset["version"], reset["rate"], reset["seed"]) == ("reset", 1, 20.0, 9)
    assert reset["robot"]["joints"]["wheel_left_joint"]["moves"]
    assert (first["type"], first["time"], second["time"]) == ("step", 0.0, 0.05)
    assert first.keys() == {"type", "time", "pose", "twist", "joints", "contacts", "sensors"}


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
        *("--kp=-1.2", "--name=a b", "--slow=true", '--gains=[1, {"x": null}]', "--empty=", "--k.p-i_d=1e-09"),
    ]


@pytest.mark.process
def test_it_hears_of_the_links_that_it_asks_for(tmp_path: Path) -> None:
    program = ANSWERS.replace("    print", "    json.dump(heard, open('heard.json', 'w'))\n    print").format("'{}'")
    links = {"base_scan": LinkState(Pose((1.0, 2.0, 3.0)), Twist())}
    with opened(tmp_path, program, links=("base_scan",)) as controller:
        controller.command(replace(START, links=links))
    _, step = json.loads((tmp_path / "heard.json").read_text())
    assert step["links"]["base_scan"]["pose"]["position_xyz"] == [1.0, 2.0, 3.0]


def test_unknown_links_are_refused_with_the_nearest_name() -> None:
    source = ProcessCommands.model_validate({"process": "python3 a.py", "links": ("base_scan", "base_scn")})
    ((path, message),) = source.model_problems(scene())
    assert path == ("links", 1)
    assert message.startswith("the robot has no link 'base_scn'; did you mean 'base_scan'?")


@pytest.mark.process
def test_the_first_line_is_no_time_for_commands(tmp_path: Path) -> None:
    with (
        pytest.raises(ScriptError, match=r"answer reset with \{\}"),
        opened(tmp_path, ANSWERS.format("""'{"twist": {}}'""")),
    ):
        pass


@pytest.mark.process
def test_a_start_has_a_limit_of_its_own(tmp_path: Path) -> None:
    slow = "import time; time.sleep(600)"
    with (
        pytest.raises(ScriptError, match=r"within 0\.2 s of wall time \(start_within\)"),
        opened(tmp_path, slow, start_within=0.2),
    ):
        pass


@pytest.mark.process
def test_a_state_that_is_no_longer_finite_is_not_told(tmp_path: Path) -> None:
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


def test_a_program_that_has_gone_since_is_an_error(tmp_path: Path) -> None:
    gone = ProcessCommands(process=("./gone",))
    with pytest.raises(ScriptError, match=r"'\./gone' does not exist"):
        gone.open(replace(scene(), workspace=Workspace(tmp_path, tmp_path)))


def found(folder: Path, word: str) -> Path:
    return find_program(word, Workspace(folder, folder))


def test_a_word_is_looked_for_on_path(tmp_path: Path) -> None:
    there = shutil.which("sh")
    assert there is not None
    assert found(tmp_path, "sh") == Path(there)


def test_a_word_with_a_slash_is_a_file_of_the_workspace(tmp_path: Path) -> None:
    program = tmp_path / "bin/controller"
    program.parent.mkdir()
    program.touch(0o700)
    assert found(tmp_path, "./bin/controller") == found(tmp_path, "bin/controller") == program


def test_a_link_is_run_under_its_own_name(tmp_path: Path) -> None:
    # By which a Python knows its virtual environment, and busybox its applet.
    (tmp_path / "program").touch(0o700)
    (tmp_path / "link").symlink_to("program")
    assert found(tmp_path, "./link") == tmp_path / "link"


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("no-such-program", "program 'no-such-program' was not found on PATH"),
        (
            "controller",
            "program 'controller' was not found on PATH; for the file next to the scenario, write './controller'",
        ),
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
        (
            {"with": {"kp": "x" * 131_067}},
            "the argument --kp=xxxxxxxxxxxxxxx... has 131,072 bytes; at most 131,071 are",
        ),
        ({"with": {"kp": "\u00e9" * 70_000}}, "has 140,005 bytes"),
        (
            {"with": {f"k{number}": "x" * 100_000 for number in range(11)}},
            "the arguments have 1,100,056 bytes; at most",
        ),
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
