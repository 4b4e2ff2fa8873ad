"""Whatever is wrong with a scenario: one clear answer, at its place, that says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import OUTSIDE_REMEDY, Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import Scenario
from tests.scenarios import LEAST, told

MODEL = "model: turtlebot3_burger"
JOINTS = "(allowed: wheel_left_joint, wheel_right_joint)"
KEYS = f"(allowed: {', '.join(sorted(Scenario.model_fields))})"


def only(folder: Path, text: str | bytes) -> str:
    """The one problem of a text; its message is one printable line of a length that a report can show."""
    (problem,) = told(folder, text)
    assert problem.isprintable()
    assert len(problem) < 2500
    return problem


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "1:1: the file is empty; a scenario starts with 'name:', 'robot:', 'expect:' and 'time_limit:'"),
        ("just words\n", "1:1: the file is not a map of keys; a scenario starts with"),
        ("name: [a\nrobot: b\n", "2:6: not valid YAML: while parsing a flow sequence expected ',' or ']'"),
        (LEAST + "name: again\n", "11:1: the key 'name' is used twice"),
        (LEAST + "---\n" + LEAST, "11:1: found a second YAML document; a file holds one scenario"),
        ("a: !!python/object/apply:os.system [id]", "1:4: the tag '!!python/object/apply:os.system' is not supported"),
        (LEAST + f"x: {'[' * 20_000}", "11:44: more than 40 nested maps and lists"),
        (
            LEAST.replace("burger drives", "caf\xe9").encode("latin-1"),
            "1:10: the byte 0xe9 is not UTF-8 text; save the",
        ),
    ],
)
def test_a_file_that_is_no_strict_yaml(text: str | bytes, problem: str, tmp_path: Path) -> None:
    assert only(tmp_path, text).startswith(problem)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        # Unknown keys
        ("  rate:", "  rte:", "5:3: commands.rte: unknown key; did you mean 'rate'? (allowed: dropouts, jitter,"),
        (
            "1.0}",
            "1.0, angle: 1}",
            "7:21: commands.twist.0.angle: unknown key; did you mean 'angular'? (allowed: angular,",
        ),
        ("name:", "robots: []\nname:", "1:1: robots: unknown key; the robot under test is 'robot', and 'world.actors'"),
        ("name:", "wall_limt: 1\nname:", f"1:1: wall_limt: unknown key; did you mean 'wall_limit'? {KEYS}"),
        (
            "name:",
            "tags: [größe]\nname:",
            "1:8: tags.0: expected text that matches ^[A-Za-z0-9][A-Za-z0-9_.-]*$, found 'größe'",
        ),
        ("travel:", "travle:", "9:5: expect.0.travle: unknown assertion 'travle'; did you mean 'travel'? (allowed: "),
        ("twist:", "twists:", "6:3: commands.twists: unknown command 'twists'; did you mean 'twist'? (allowed: "),
        (MODEL, f"{MODEL}\n  drive: {{dif: {{}}}}", "4:11: robot.drive.dif: unknown drive 'dif'; did you mean 'diff'?"),
        (
            MODEL,
            f"{MODEL}\n  pose: {{yow: 1}}",
            "4:10: robot.pose.yow: unknown key; did you mean 'yaw'? (allowed: pitch, ",
        ),
        ("time_limit:", "version: 2\ntime_limit:", "10:1: version: expected 1, found 2"),
        # Wrong types
        ("burger drives straight", "12", "1:1: name: expected text, found 12; put it in quotes"),
        (MODEL, "model: [a]", "3:3: robot.model: expected text, found a list of 1"),
        (f"\n  {MODEL}", " turtlebot3_burger", "2:1: robot: expected a map of keys, found 'turtlebot3_burger'"),
        ("- travel: {at", "  travel: {at", "8:1: expect: expected a list, found a map of keys; begin each entry"),
        ("- travel: {at_least: 1.5 m}", "", "8:1: expect: expected a list, found nothing"),
        ("travel: {at_least: 1.5 m}", "travel: 1.5 m", "9:5: expect.0.travel: expected a map of keys, found '1.5 m'"),
        ("travel: {at_least: 1.5 m}", "5", "9:5: expect.0: expected a map with one assertion (travel, "),
        ("30 s", "", "10:1: time_limit: expected time such as '1 s', found nothing"),
        ("30 s", "[30 s]", "10:1: time_limit: expected time such as '1 s', found a list of 1"),
        ("30 s", "1:30", "10:1: time_limit: ':30' is not a unit of time; use one of: s, ms, us, min, h"),
        # Numbers
        ("30 s", "48 h", "10:1: time_limit: must be at most 86,400 s, found '48 h'"),
        ("30 s", ".nan", "10:1: time_limit: expected a finite time such as '1 s', found nan"),
        ("30 s", "0x" + "f" * 9000, "10:13: a number of 9002 digits; the maximum is 400"),
        ("1.5 m", ".nan", "9:14: expect.0.travel.at_least: expected a finite length such as '1 m', found nan"),
        # Units
        ("10 Hz", "10 s", "5:3: commands.rate: 's' is not a unit of frequency; use one of: Hz, kHz"),
        (
            MODEL,
            f"{MODEL}\n  joints: {{wheel_left_joint: 5 cm}}",
            "4:12: robot.joints.wheel_left_joint: 'cm' is not a unit of angle; use one of: rad, deg",
        ),
        # Joints of the model
        (
            MODEL,
            f"{MODEL}\n  joints: {{wheel_lft_joint: 1}}",
            (
                "4:12: robot.joints.wheel_lft_joint: the model has no moving joint 'wheel_lft_joint'; "
                f"did you mean 'wheel_left_joint'? {JOINTS}"
            ),
        ),
        # Rates, windows, claims
        ("10 Hz", "7 kHz", "5:3: commands.rate: 7000 Hz does not divide physics.rate, 240 Hz; nearest: 240 Hz; or set"),
        ("10 Hz", "1e-323", "5:3: commands.rate: 9.88131e-324 Hz does not divide physics.rate, 240 Hz; nearest: 1 Hz"),
        ("1.0}", "1.0, for: 1e-320}", "7:21: commands.twist.0.for: no tick falls between 0 s and 1e-320 s"),
        (
            "1.5 m}",
            "1.5 m}\n    after: 1.7e308",
            "10:5: expect.0.after: 1.7e+308 s is not earlier than time_limit (30 s)",
        ),
        ("twist:\n    - {linear: 1.0}", f"process: {'x' * 5000}", "6:3: commands.process: program 'x"),
        (f"\n  {MODEL}", f" {{model: 'package://{'x' * 5000}/a.urdf'}}", "2:"),
        ("time_limit: 30 s", "trace: {rate: 1e-300}\ntime_limit: 30 s", "10:9: trace.rate: 1e-300 Hz does not divide"),
        ("1.5 m}", "1.5 m}\n    before: 31 s", "10:5: expect.0.before: 31 s is later than time_limit (30 s)"),
        ("  - travel: {at_least: 1.5 m}", "  []", "8:1: expect: must not be empty"),
        ("travel: {at_least: 1.5 m}", "travel: {}", "9:5: expect.0.travel: give 'at_least', 'at_most' or both"),
        ("travel: {at_least: 1.5 m}", "{}", "9:5: expect.0: names no assertion; give one of travel, "),
    ],
)
def test_a_key_or_value_that_cannot_be(old: str, new: str, problem: str, tmp_path: Path) -> None:
    assert old in LEAST
    assert only(tmp_path, LEAST.replace(old, new, 1)).startswith(problem)


@pytest.mark.parametrize(
    ("model", "problem"),
    [
        ("turtlebot_burger", "3:3: robot.model: unknown robot 'turtlebot_burger'; did you mean 'turtlebot3_burger'?"),
        ("robots/a.urdf", "3:3: robot.model: 'robots/a.urdf' does not exist (looked for "),
        ("../../etc/passwd", "3:3: robot.model: '../../etc/passwd' is outside the workspace "),
        ("/etc/passwd", "3:3: robot.model: '/etc/passwd' is outside the workspace "),
        ("./", "3:3: robot.model: './' is a folder, not a file (looked for "),
        ("s.sim.yml", "1: not well-formed XML: syntax error; a model is a .urdf, .xacro or .sdf file, "),
        ('"a\\0b.urdf"', "3:3: robot.model: 'a\\x00b.urdf' is not a valid path"),
        ('"a\\n::error::b.urdf"', "3:3: robot.model: 'a\\n::error::b.urdf' does not exist"),
        ("a" * 300 + ".urdf", "3:3: robot.model: 'aaaaaaa"),
        ('"\\ud800.urdf"', "3:10: half of a surrogate pair is not a character; write the character itself"),
    ],
)
def test_a_model_that_cannot_be_read(model: str, problem: str, tmp_path: Path) -> None:
    expected = problem.replace("{file}", str(tmp_path / "s.sim.yml"))
    assert only(tmp_path, LEAST.replace("turtlebot3_burger", model)).startswith(expected)


def test_a_link_that_leads_outside_and_the_option_that_lifts_it(tmp_path: Path) -> None:
    (tmp_path / "outside.urdf").write_text(
        load_model(Robot(model="turtlebot3_burger"), Workspace(tmp_path, tmp_path)).urdf
    )
    root = tmp_path / "workspace"
    root.mkdir()
    (root / "link.urdf").symlink_to(tmp_path / "outside.urdf")
    commands = LEAST[LEAST.index("commands") : LEAST.index("expect")]
    for model in ("link.urdf", "../outside.urdf"):
        text = LEAST.replace("turtlebot3_burger", model).replace(commands, "")
        assert only(root, text) == (f"3:3: robot.model: '{model}' is outside the workspace {root}; {OUTSIDE_REMEDY}")
        assert load_scenario(root / "s.sim.yml", Permissions(outside=True)).scenario.robot.model == model


@pytest.mark.parametrize(
    ("drive", "problem"),
    [
        (
            "{diff: {left: [wheel_l], right: [wheel_right_joint]}}",
            "4:25: robot.drive.diff.left.0: the model has no moving joint 'wheel_l'; did you mean 'wheel_left_joint'?",
        ),
        (
            "{diff: {left: [wheel_left_joint], right: [scan_joint]}}",
            f"4:52: robot.drive.diff.right.0: the model has no moving joint 'scan_joint' {JOINTS}",
        ),
        ("{diff: {left: wheel_left_joint, right: []}}", "4:18: robot.drive.diff.left: expected a list, found 'wheel"),
        ("{diff: {left: [a]}}", "4:11: robot.drive.diff.right: the key 'right' is missing"),
        ("diff", "4:3: robot.drive: expected a map with one drive (diff, mecanum, skid, ackermann), found 'diff'"),
    ],
)
def test_a_drive_that_does_not_fit_the_model(drive: str, problem: str, tmp_path: Path) -> None:
    found = told(tmp_path, LEAST.replace(MODEL, f"{MODEL}\n  drive: {drive}"))
    assert found[0].startswith(problem)
    assert len(found) == (2 if "right: []" in drive else 1)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ('"a\\nb"', "'a\\nb' has a control character, a line break, or a space at its beginning or end"),
        ('"a\\r\\n::error::b"', "contains '::'"),
        ("|\n  a\n  b", "'a\\nb\\n' has a control character"),
        ("'${{ a }}'", "'${{ a }}' contains '${{'"),
        ("x" * 121, "must have at most 120 characters"),
    ],
)
def test_a_name_that_would_act_in_a_report(name: str, why: str, tmp_path: Path) -> None:
    assert why in only(tmp_path, LEAST.replace("burger drives straight", name))
    named = LEAST.replace("1.5 m}", f"1.5 m}}\n    name: {name}".replace("\n  a\n  b", "\n      a\n      b"))
    found = only(tmp_path, named)
    assert found.startswith("10:5: expect.0.name: ")
    assert why in found


def test_a_key_that_would_act_in_a_report(tmp_path: Path) -> None:
    assert only(tmp_path, LEAST + '"a\\n::error::b\\x1b": c\n') == f"11:1: a\\n::error::b\\x1b: unknown key {KEYS}"


def refusal(path: Path) -> str:
    with pytest.raises(InvalidScenario) as raised:
        load_scenario(path)
    (problem,) = raised.value.problems
    assert problem.location.file == str(path)
    return problem.message


def test_what_is_no_file(tmp_path: Path) -> None:
    assert refusal(tmp_path) == "cannot be read: it is a folder"
    assert refusal(Path("/dev/zero")) == "cannot be read: it is not a regular file"
    assert refusal(tmp_path / "absent.sim.yml") == (
        f"there is no file or folder '{tmp_path}/absent.sim.yml'; "
        "correct the path on the command line, or in the input of the action"
    )


@pytest.mark.parametrize("size", [1_000_001, 100_000_000])
def test_a_huge_file_is_refused_unread(size: int, tmp_path: Path) -> None:
    path = tmp_path / "s.sim.yml"
    with path.open("wb") as file:
        file.truncate(size)
    assert refusal(path) == "a scenario of more than 1000 kB cannot be read; check that this is the right file"


@pytest.mark.parametrize("script", ["absent.py", "broken.py", "nameless.py", "../../x.py"])
def test_a_script_that_cannot_run(script: str, tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("def control(:\n")
    (tmp_path / "nameless.py").write_text("def contrl(seen): ...\n")
    text = LEAST.replace("twist:\n    - {linear: 1.0}", f"script: {script}")
    found = only(tmp_path, text)
    assert found.startswith("6:3: commands.script: ")
    assert script in found


@pytest.mark.parametrize("linked", ["s.sim.yml", "folder"])
def test_a_scenario_is_read_from_its_workspace(linked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outside, workspace = tmp_path / "outside", tmp_path / "workspace"
    for folder in (outside, workspace):
        folder.mkdir()
    (outside / "s.sim.yml").write_text("password: hunter2\n")
    (workspace / linked).symlink_to(outside / "s.sim.yml" if linked == "s.sim.yml" else outside)
    monkeypatch.chdir(workspace)
    path = Path("s.sim.yml") if linked == "s.sim.yml" else Path("folder/s.sim.yml")
    message = refusal(path)
    assert message.startswith(f"is a link to {outside}/s.sim.yml, outside the workspace {workspace}")
    assert "hunter2" not in message
    with pytest.raises(InvalidScenario, match="password"):
        load_scenario(path, Permissions(outside=True))


def test_a_link_within_the_workspace_is_a_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "real.sim.yml").write_text(LEAST)
    (tmp_path / "link.sim.yml").symlink_to("real.sim.yml")
    monkeypatch.chdir(tmp_path)
    assert load_scenario(Path("link.sim.yml")).workspace.root == tmp_path
