"""From YAML to a scenario: what each key becomes, and that all problems are told at once, each at its place."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.assertions.distance import Travel
from sim_action.assertions.joint import JointReading
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.upright import Upright
from sim_action.commands.twist import TwistCommands
from sim_action.core.errors import InvalidScenario, Location
from sim_action.core.permissions import Permissions
from sim_action.drives.diff import DiffDrive
from sim_action.scenario.files import read_only_scenario
from sim_action.scenario.loading import build_scene, load_all, load_scenario
from sim_action.scenario.model import LoadedScenario
from tests.scenarios import COMMANDS, FULL, LEAST, expecting, load, told
from tests.worlds import write_map


def test_the_least_scenario_is_filled_with_defaults(tmp_path: Path) -> None:
    loaded = load(tmp_path, LEAST)
    scenario = loaded.scenario
    assert (scenario.name, scenario.time_limit) == ("burger drives straight", 30.0)
    assert scenario.robot.model == "turtlebot3_burger"
    (commands,) = scenario.commands
    assert isinstance(commands, TwistCommands)
    assert commands.rate == 10.0
    (expected,) = scenario.expect
    assert expected.assertion == Travel(at_least=1.5)
    assert expected.name == "travel at least 1.5 m"
    assert expected.location == Location(str(tmp_path / "s.sim.yml"), 9, 5)
    assert (expected.after, expected.before, expected.severity) == (0.0, math.inf, "error")
    assert scenario.physics.rate == 240.0
    assert load(tmp_path, LEAST.replace(COMMANDS, "")).scenario.commands == ()


def test_everything_spelled_out_is_read(tmp_path: Path) -> None:
    scenario = load(tmp_path, FULL).scenario
    assert scenario.robot.drive == DiffDrive(left=("wheel_left_joint",), right=("wheel_right_joint",))
    assert [body.name for body in scenario.world.objects] == ["wall", "ball"]
    assert scenario.world.objects[1].mass == 0.1
    assert [type(expected.assertion) for expected in scenario.expect] == [Travel, NoCollision, Upright, JointReading]
    travel, collision, upright, _ = scenario.expect
    assert travel.before == 10.0
    assert collision.location.line == 23
    assert (upright.name, upright.after, upright.severity) == ("stays up", 1.0, "warning")
    assert (scenario.duration, scenario.wall_seconds, scenario.trace_rate) == (5.0, 60.0, 20.0)


def test_a_suite_reads_a_model_once_and_hands_it_to_its_runs(tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}.sim.yml" for number in range(3)]
    for path in paths:
        path.write_text(FULL)
    found = load_all([read_only_scenario(path, Permissions()) for path in paths], Permissions())
    loaded = [scenario for scenario in found if isinstance(scenario, LoadedScenario)]
    first, *others = (scenario.model for scenario in loaded)
    assert first is not None
    assert len(others) == 2
    assert all(model is first for model in others)
    assert build_scene(loaded[0]).model is first


def test_the_file_is_named_as_the_user_named_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load(tmp_path, LEAST)
    monkeypatch.chdir(tmp_path)
    loaded = load_scenario(Path("s.sim.yml"))
    assert loaded.file == "s.sim.yml"
    assert loaded.scenario.expect[0].location.file == "s.sim.yml"
    assert loaded.workspace.directory == tmp_path


@pytest.mark.parametrize("end", ["\r\n", "\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_file_from_another_editor_is_the_same_scenario(end: str, mark: str, tmp_path: Path) -> None:
    assert load(tmp_path, mark + FULL.replace("\n", end)) == load(tmp_path, FULL)


@pytest.mark.parametrize(
    "entry", ["no_collision", "no_collision:", "no_collision: {}", "{no_collision: }", "no_collision: {allow: []}"]
)
def test_an_assertion_without_keys_may_be_written_in_any_way(entry: str, tmp_path: Path) -> None:
    assert load(tmp_path, expecting(entry)).scenario.expect[0].assertion == NoCollision()


@pytest.mark.parametrize(
    ("stated", "names"),
    [
        (["a", "b"], ["a", "b"]),
        (["a", "a", "a"], ["a", "a (2)", "a (3)"]),
        (["a", "a (2)", "a"], ["a", "a (2)", "a (3)"]),
        (["a", "a", "a (2)"], ["a", "a (3)", "a (2)"]),
        (["a (2)", "a (2)", "a", "a"], ["a (2)", "a (2) (2)", "a", "a (3)"]),
        (["", ""], ["upright within 20 deg", "upright within 20 deg (2)"]),
    ],
)
def test_no_two_expectations_share_a_name(stated: list[str], names: list[str], tmp_path: Path) -> None:
    entries = [f"{{upright: {{}}, name: {name}}}" if name else "upright" for name in stated]
    assert [expected.name for expected in load(tmp_path, expecting(*entries)).scenario.expect] == names


def test_all_problems_are_told_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = LEAST.replace("1.0}", "fast}").replace("1.5 m", "1.5 s").replace("30 s", "-30 s").replace("10 Hz", "10 m")
    assert [problem.split(": ")[:2] for problem in told(tmp_path, text)] == [
        ["5:3", "commands.rate"],
        ["7:8", "commands.twist.0.linear"],
        ["9:14", "expect.0.travel.at_least"],
        ["10:1", "time_limit"],
    ]


def test_a_part_that_is_refused_does_not_shift_the_places_of_those_after_it(tmp_path: Path) -> None:
    late = "travel: {at_least: 1 m}\n    before: 50 s"
    text = expecting("travl: {at_least: 1.5 m}", "upright", late, "no_collision: {allow: [wal]}")
    text = text.replace(COMMANDS, "commands:\n  - twists: []\n  - twist: [{}]\n    rate: 7 kHz\n")
    assert [problem.split(": ")[:2] for problem in told(tmp_path, text)] == [
        ["5:5", "commands.0.twists"],
        ["7:5", "commands.1.rate"],
        ["9:5", "expect.0.travl"],
        ["12:5", "expect.2.before"],
        ["13:28", "expect.3.no_collision.allow.0"],
    ]


def test_one_source_and_a_list_of_sources_have_their_places(tmp_path: Path) -> None:
    listed = LEAST.replace(COMMANDS, "commands:\n  - {twist: [{}], rate: 7000}\n")
    assert told(tmp_path, LEAST.replace("10 Hz", "7000"))[0].startswith("5:3: commands.rate: 7000 Hz does not divide")
    assert told(tmp_path, listed)[0].startswith("5:19: commands.0.rate: 7000 Hz does not divide")


@pytest.mark.parametrize(
    ("physics", "rate", "near"),
    [
        ("240", "7", "6 Hz and 8 Hz; or set physics: {rate: 245 Hz}"),
        ("240", "239", "120 Hz and 240 Hz; or set physics: {rate: 478 Hz}"),
        ("240", "1000", "240 Hz; or set physics: {rate: 1000 Hz}"),
        ("240", "0.7", "1 Hz; or set physics: {rate: 240.1 Hz}"),
        ("240", "1e-323", "1 Hz"),
        ("1 kHz", "30", "25 Hz and 40 Hz; or set physics: {rate: 1020 Hz}"),
        ("240.5", "100", "80.1667 Hz and 120.25 Hz; or set physics: {rate: 300 Hz}"),
    ],
)
def test_the_nearest_rates_that_divide_are_named(physics: str, rate: str, near: str, tmp_path: Path) -> None:
    text = LEAST.replace("10 Hz", rate) + f"physics: {{rate: {physics}}}\n"
    (problem,) = told(tmp_path, text)
    assert problem.endswith(f"nearest: {near}")


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("before: 40 s", "10:5: expect.0.before: 40 s is later than time_limit (30 s)"),
        ("after: 30 s", "10:5: expect.0.after: 30 s is not earlier than time_limit (30 s)"),
        ("before: 1 ms", "10:5: expect.0.before: too early: the first physics step in the window is at 0.004167 s"),
        ("after: 4\n    before: 3", "11:5: expect.0.before: must be later than 'after' (4 s)"),
        ("after: 1.001\n    before: 1.002", "11:5: expect.0.before: too early: the first physics step in the window"),
    ],
)
def test_windows_that_no_step_can_fall_into_are_refused(options: str, problem: str, tmp_path: Path) -> None:
    (line,) = told(tmp_path, expecting(f"travel: {{at_least: 1.5 m}}\n    {options}"))
    assert line.startswith(problem)


@pytest.mark.parametrize(
    ("entry", "time"),
    [
        ("stl: always[20 s, 31 s] (speed < 1)", "31 s, and time_limit is 30 s; raise time_limit"),
        ("stl: always[31 s, end] (speed < 1)", "31 s, and time_limit is 30 s"),
        ("stl: eventually always[0 s, 31 s] (speed < 1)", "31 s, and time_limit is 30 s"),
        ("stl: always[0 s, 2 s] (eventually[0 s, 1 s] (speed < 1))\n    after: 28 s", "3 s from 'after' (28 s) on"),
        ("stl: always[0 s, 2 s] (speed < 1)\n    before: 1.5 s", "2 s, and before is 1.5 s; raise before"),
        ("settled: {for: 31 s}", "31 s, and time_limit is 30 s"),
        ("settled:\n    after: 29.5 s", "1 s from 'after' (29.5 s) on, and time_limit is 30 s"),
        ("stops_before: {body: wall, gap: [1 m, 2 m], for: 31 s}", "31 s, and time_limit is 30 s"),
        ("contact: {with: wall, at_least: 1 N, for: 31 s}", "31 s, and time_limit is 30 s"),
        ("travel: {at_least: 1 m}\n    for: 31 s", "31 s, and time_limit is 30 s"),
        ("any_of: [{travel: {at_least: 1 m}}, {not: {settled: {for: 31 s}}}]", "31 s"),
    ],
)
def test_a_time_beyond_the_end_of_the_run_is_refused(entry: str, time: str, tmp_path: Path) -> None:
    wall = "world: {objects: [{name: wall, box: [1, 1, 1], pose: {x: 9}}]}\n"
    key = "for" if "\n    for:" in entry else entry.partition(":")[0]
    (line,) = told(tmp_path, expecting(entry) + wall)
    assert f": expect.0.{key}: must see {time}" in line


@pytest.mark.parametrize(
    "entry",
    [
        "stl: always[20 s, 30 s] (speed < 1)",
        "stl: always[30 s, end] (speed < 1)",
        "stl: eventually (always[0 s, 2 s] (speed < 1))\n    after: 28 s",
        "settled: {for: 30 s}",
        "settled:\n    after: 1.1 s\n    before: 2.1 s",
    ],
)
def test_a_time_that_ends_with_the_run_is_not_refused(entry: str, tmp_path: Path) -> None:
    (expected,) = load(tmp_path, expecting(entry)).scenario.expect
    assert expected.assertion.horizon > 0


def test_a_duration_is_within_the_time_limit_which_has_a_step(tmp_path: Path) -> None:
    assert told(tmp_path, LEAST + "duration: 31 s\n") == ["11:1: duration: must not be longer than time_limit (30 s)"]
    assert told(tmp_path, LEAST.replace("30 s", "1 us")) == [
        "10:1: time_limit: must not be shorter than a physics step (1 / 240 s)"
    ]


def test_twists_for_a_robot_whose_wheels_are_not_plain_need_a_drive(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
        'iyz="0" izz="1"/></inertial></link><link name="b"/><joint name="elbow" type="revolute"><parent link="a"/>'
        '<child link="b"/><limit lower="-1" upper="1"/></joint></robot>'
    )
    (problem,) = told(tmp_path, LEAST.replace("turtlebot3_burger", "arm.urdf"))
    assert problem == (
        "2:1: robot: it is not plain from 'arm' which joints are wheels; name them, such as "
        "drive: {diff: {left: [...], right: [...]}}; its moving joints: elbow; "
        "the most likely reason: diff: the model has no collision shapes, so nothing stands on the ground"
    )
    # For an arm that is fixed, they lead to its joints.
    problem, *_ = told(tmp_path, LEAST.replace("turtlebot3_burger", "ur5e_gripper"))
    assert problem == (
        "2:1: robot: 'ur5e_gripper' is fixed to the world and has no wheels, so no twist can drive it; command its "
        "joints, such as commands: {joints: [{at: 1 s, position: {shoulder_pan_joint: 0.5}}]}"
    )


def test_a_broken_model_is_told_with_its_own_line(tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<robot>\n<link/>\n</robot>")
    (tmp_path / "a.sim.yml").write_text(LEAST.replace("turtlebot3_burger", "bad.urdf"))
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(tmp_path / "a.sim.yml")
    assert str(refused.value) == f"{tmp_path}/bad.urdf:2: <link> has no attribute 'name' [missing-part]"


BOX = "{name: a, box: [1, 1, 1]}"


@pytest.mark.parametrize(
    ("world", "problem"),
    [
        (
            "patches: [{size: [1, 1], friction: 0}, {x: 0.9, size: [1, 1], friction: 0}]",
            "11:48: world.patches.1: lies on world.patches[0]",
        ),
        ("objects: [{name: a, map: {file: none.yaml}}]", "11:35: world.objects.0.map.file: 'none.yaml' does not exist"),
        (
            "objects: [{name: a, heightfield: {image: /etc/passwd, height: 1, size: [1, 1]}}]",
            "11:43: world.objects.0.heightfield.image: '/etc/passwd' is outside the workspace",
        ),
        (f"objects: [{BOX}, {BOX}]", "world.objects.1.name: a second body named 'a'"),
        ("objects: [{name: ground, sphere: {radius: 1}}]", "world.objects.0.name: a second body named 'ground'"),
        ("objects: [{name: a}]", "world.objects.0: an object needs exactly one shape of 'box', 'cylinder', 'sphere'"),
        ("gravity: -9.81", "11:9: world.gravity: a single number points downwards"),
    ],
)
def test_what_is_wrong_with_a_world_is_told_on_its_line(world: str, problem: str, tmp_path: Path) -> None:
    (line,) = told(tmp_path, f"{LEAST}world: {{{world}}}\n")
    assert problem in line


def test_patches_that_touch_do_not_lie_on_each_other_and_files_are_read_once(tmp_path: Path) -> None:
    file = write_map(tmp_path, [[0, 254], [0, 254]], resolution=1)
    patches = "[{size: [1, 1], friction: 0}, {x: 1, size: [1, 1], friction: 0}]"
    world = f"world: {{patches: {patches}, objects: [{{name: a, map: {{file: {file}}}}}]}}\n"
    loaded = load(tmp_path, LEAST + world)
    (tmp_path / file).unlink()
    assert len(build_scene(loaded).parts["a"]) == 1


@pytest.mark.parametrize(
    ("rate", "physics"), [("50 Hz", 250), ("10 Hz", 240), ("70 Hz", 280), ("1 kHz", 1000), ("62.5 Hz", 250)]
)
def test_the_rate_of_the_physics_follows_from_that_of_a_controller(rate: str, physics: float, tmp_path: Path) -> None:
    assert load(tmp_path, LEAST.replace("10 Hz", rate)).scenario.physics.rate == physics


def test_a_rate_that_follows_changes_the_rates_that_follow_it(tmp_path: Path) -> None:
    arm = "robot: {model: ur5e_gripper}\nallow: [fixed-base]\n"
    joints = "{joints: [{at: 1 s, position: {elbow_joint: 1.6}}], rate: 48 Hz}"
    text = f"name: n\n{arm}commands:\n  - {joints}\nsensors: [{{imu: {{}}, rate: 50 Hz}}]\n"
    text += "expect: [{max_speed: {linear: 1}}]\ntime_limit: 1 s\n"
    scenario = load(tmp_path, text).scenario
    assert (scenario.physics.rate, scenario.commands[0].rate) == (250, 50)
