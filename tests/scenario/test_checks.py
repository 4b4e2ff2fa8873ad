"""What a whole scenario must satisfy: its robot, and its claims, which can fail; test_loading.py has the times."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import ClassVar, Final

import pytest
from typing_extensions import override

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor
from sim_action.core.errors import Problem
from sim_action.scenario.checks import audit_robot, audit_scenario
from sim_action.scenario.loading import build_scene
from sim_action.state.observation import Observation
from sim_action.world.claims import RULES, Ceiling
from sim_action.world.scene import Scene
from tests.scenarios import LEAST, expecting, load, problems, told
from tests.traces import expectation

EXAMPLES: Final = Path(__file__).parents[2] / "examples"
INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
INERTIAL = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
ARM = """\
<robot name="arm">
  <link name="base">{inertial}</link>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="hand"/><limit {limits}/></joint>
  <link name="hand"/>{more}
</robot>
"""
LIMITS = 'lower="-1" upper="1.5707963"'


def arm(folder: Path, robot: str = "", inertial: str = INERTIAL, limits: str = LIMITS, more: str = "") -> str:
    """A scenario with an arm in it, and with keys of `robot`."""
    (folder / "arm.urdf").write_text(ARM.format(inertial=inertial, limits=limits, more=more))
    return f"name: arm\nrobot: {{model: arm.urdf{robot}}}\nexpect: [upright]\ntime_limit: 1 s\nallow: [fixed-base]\n"


def test_a_free_base_without_mass_would_stand_still(tmp_path: Path) -> None:
    massless = f'<inertial><mass value="0"/>{INERTIA}</inertial>'
    allowed = ", allow: [zero-mass, massless-model]"
    (line,) = told(tmp_path, arm(tmp_path, allowed, massless))
    assert line == (
        "2:9: robot.model: the base link 'base' has no mass, so the engine would hold it still; "
        "say base: fixed, or give it a mass"
    )
    assert load(tmp_path, arm(tmp_path, f"{allowed}, base: fixed", massless))
    assert load(tmp_path, arm(tmp_path))


def test_a_free_robot_has_a_mass(tmp_path: Path) -> None:
    (line,) = told(tmp_path, arm(tmp_path, inertial=""))
    assert "no link of the model has a mass, so it cannot move freely; say base: fixed" in line
    assert load(tmp_path, arm(tmp_path, ", base: fixed", inertial=""))
    assert load(tmp_path, arm(tmp_path, ", allow: [massless-model]", inertial=""))


@pytest.mark.parametrize(
    ("position", "limits", "degrees", "bounds"),
    [
        ("2", LIMITS, "114.6", "-57.3 deg to 90 deg"),
        ("-58 deg", LIMITS, "-58", "-57.3 deg to 90 deg"),
        ("90.001 deg", LIMITS, "90.001", "-57.3 deg to 90 deg"),
        ("0.2", 'lower="0.5" upper="1e16"', "11.46", "28.65 deg or more"),
        ("0.2", 'lower="-1e16" upper="-0.5"', "11.46", "-28.65 deg or less"),
    ],
)
def test_a_joint_begins_within_its_limits(
    position: str, limits: str, degrees: str, bounds: str, tmp_path: Path
) -> None:
    (line,) = told(tmp_path, arm(tmp_path, f", joints: {{elbow: {position}}}", limits=limits))
    assert line == f"2:35: robot.joints.elbow: {degrees} deg is outside the limits of the joint, {bounds}"


@pytest.mark.parametrize(
    ("position", "limits"), [("90 deg", LIMITS), ("9", 'effort="1"'), ("9", 'lower="0" upper="-1"')]
)
def test_a_joint_may_begin_at_its_limit_and_anywhere_without_one(position: str, limits: str, tmp_path: Path) -> None:
    allowed = "allow: [missing-limits, reversed-limits]"
    assert load(tmp_path, arm(tmp_path, f", {allowed}, joints: {{elbow: {position}}}", limits=limits))


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("missing-limit", "'missing-limit' is not a rule that can be allowed; did you mean 'missing-limits'?"),
        ("two-parents", "'two-parents' is not a rule that can be allowed; no engine accepts such a model"),
    ],
)
def test_only_rules_that_can_be_let_go_are_allowed(name: str, problem: str, tmp_path: Path) -> None:
    (line,) = told(tmp_path, arm(tmp_path, f", allow: [{name}]"))
    assert problem in line
    # One whose findings are notes may be.
    assert load(tmp_path, arm(tmp_path, ", allow: [missing-visual, zero-inertia]"))


def test_a_typo_in_a_drive_is_one_problem_whatever_the_model(tmp_path: Path) -> None:
    text = arm(tmp_path, ", drive: {diff: {left: [elbow], right: [elbow], radios: 1}}")
    commands = "commands: {twist: [{linear: 1.0}], rate: 10 Hz}\n"
    (line,) = told(tmp_path, text + commands)
    assert "robot.drive.diff.radios: unknown key" in line


FOLLOWER = """
  <joint name="tip" type="revolute"><parent link="hand"/><child link="finger"/>
    <limit lower="-0.2" upper="0.2"/><mimic joint="elbow" offset="{offset}"/></joint>
  <link name="finger"/>"""
FOLLOWS = "joint 'tip', which follows 'elbow', would begin beyond its own limits: "


@pytest.mark.parametrize(
    ("offset", "joints", "problem"),
    [
        (0, ", joints: {elbow: 0.8}", f"2:35: robot.joints.elbow: {FOLLOWS}45.84 deg is outside"),
        (0, ", joints: {elbow: -0.2001}", f"2:35: robot.joints.elbow: {FOLLOWS}-11.465 deg is outside"),
        (0.5, "", f"2:1: robot: {FOLLOWS}28.65 deg is outside"),
        (0, ", joints: {elbow: 0.2}", ""),
        (0.5, ", joints: {elbow: -0.4}", ""),
        (0, ", joints: {elbow: 1 m}", "2:35: robot.joints.elbow: "),
    ],
)
def test_a_follower_begins_within_its_own_limits(offset: float, joints: str, problem: str, tmp_path: Path) -> None:
    text = arm(tmp_path, joints, more=FOLLOWER.format(offset=offset))
    if not problem:
        assert load(tmp_path, text)
        return
    (line,) = told(tmp_path, text)
    assert line.startswith(problem)


@pytest.mark.parametrize(
    ("joints", "positions"),
    [("{'*': 0.1}", {"elbow": 0.1, "tip": 0.1}), ("{'e*': 6 deg, elbow: 0.2}", {"elbow": 0.2, "tip": 0.2})],
)
def test_a_pattern_sets_joints_with_motors_and_a_name_wins(
    joints: str, positions: dict[str, float], tmp_path: Path
) -> None:
    text = arm(tmp_path, f", joints: {joints}", more=FOLLOWER.format(offset=0))
    assert build_scene(load(tmp_path, text)).joint_positions == positions


@pytest.mark.parametrize(
    ("joints", "problems"),
    [
        ("{'*_hip': 1}", ["2:35: robot.joints.*_hip: no moving joint matches '*_hip' (allowed: elbow)"]),
        ("{'elb*': 2}", ["2:35: robot.joints.elb*: joint 'elbow': 114.6 deg is outside"]),
        (
            "{'e*': 0,\n '*w': 1}",
            ["2:35: robot.joints.e*: 'e*' sets joint 'elbow' to 0, '*w' to 1", "3:2: robot.joints.*w: 'e*' sets"],
        ),
    ],
)
def test_a_pattern_that_cannot_be_is_told_where_it_stands(joints: str, problems: list[str], tmp_path: Path) -> None:
    found = told(tmp_path, arm(tmp_path, f", joints: {joints}"))
    assert len(found) == len(problems)
    assert all(line.startswith(problem) for line, problem in zip(found, problems, strict=True))


def test_variables_are_for_code_only(tmp_path: Path) -> None:
    variables = "environment: {OPENSSL_CONF: ./ssl.cnf}\n"
    (line,) = told(tmp_path, arm(tmp_path) + variables)
    assert line == (
        "6:1: environment: nothing in this scenario runs code that could read variables (script, process, assertion, "
        "xacro or ROS nodes); remove it"
    )
    (tmp_path / "hold.py").write_text("def control(observation): ...\n")
    assert load(tmp_path, arm(tmp_path) + variables + "commands: {rate: 10 Hz, script: hold.py}\n")
    (line,) = told(tmp_path, arm(tmp_path) + variables + "commands: {rate: 10 Hz, script: missing.py}\n")
    assert "environment" not in line


def test_recorded_links_are_those_of_the_robot(tmp_path: Path) -> None:
    text = arm(tmp_path, ", base: fixed")
    assert load(tmp_path, f"{text}trace: {{links: [hand]}}\n").scenario.trace.links == ("hand",)
    (line,) = told(tmp_path, f"{text}trace: {{links: [hand, hnd]}}\n")
    assert line.startswith("6:23: trace.links.1: the robot has no link 'hnd'; did you mean 'hand'?")


BEYOND = "unreachable-limit"
WALL = "world: {objects: [{name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}]}\n"
REEL = """
  <link name="disc"/>
  <joint name="reel" type="continuous"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/></joint>"""


def scenario(expect: str, more: str = "") -> str:
    return expecting(expect) + more


def judging(folder: Path, expect: str) -> str:
    """A scenario with an arm whose base is fixed."""
    arm(folder, limits='lower="-2" upper="2" effort="5" velocity="5"', more=REEL)
    return f"name: a\nrobot: {{model: arm.urdf, base: fixed}}\nexpect:\n  - {expect}\ntime_limit: 5 s\n"


def errors(folder: Path, text: str) -> list[tuple[str, str]]:
    """The keys and the rule of each problem."""
    lines = [line.split(" ", 1)[1] for line in told(folder, text)]
    return [(line.split(": ")[0], line.rpartition("[")[2].rstrip("]")) for line in lines]


def warnings(folder: Path, text: str) -> list[tuple[int | None, str]]:
    """The line and the rule of each warning."""
    return [(warning.location.line, warning.rule) for warning in load(folder, text).warnings]


@pytest.mark.parametrize(
    ("expect", "key", "rule"),
    [
        ("upright: {max_tilt: 20}", "upright.max_tilt", "bare-angle"),
        ("upright: {max_tilt: 20 rad}", "upright.max_tilt", BEYOND),
        ("upright: {max_tilt: 180 deg}", "upright.max_tilt", BEYOND),
        ("max_speed: {linear: 100 m/s}", "max_speed.linear", BEYOND),
        ("max_speed: {linear: 1, angular: 1000 rad/s}", "max_speed.angular", BEYOND),
        ("travel: {at_most: 10 km}", "travel.at_most", BEYOND),
        ("path_length: {at_most: 3 km}", "path_length.at_most", BEYOND),
        ("reach: {x: 1, y: 0, yaw: 90}", "reach.yaw", "bare-angle"),
        ("reach: {x: 1, y: 0, yaw: '-90.0'}", "reach.yaw", "bare-angle"),
        ("reach: {x: 1, y: 0, yaw: 0, yaw_tolerance: 180 deg}", "reach.yaw_tolerance", BEYOND),
        ("final_pose: {yaw: 0, yaw_tolerance: 3.2}", "final_pose.yaw_tolerance", BEYOND),
        ("stl: always (tilt < 20)", "stl", "bare-angle"),
        ("stl: always (-30 < pitch)", "stl", "bare-angle"),
        ("stl: always (tilt < 180 deg)", "stl", BEYOND),
        ("stl: always (speed >= 0 m/s)", "stl", BEYOND),
        ("stl: always (not (abs(yaw) > 4 rad))", "stl", BEYOND),
        ("any_of: [no_collision, {upright: {max_tilt: 30}}]", "any_of.1.upright.max_tilt", "bare-angle"),
        ("not: {max_speed: {linear: 200}}", "not.max_speed.linear", BEYOND),
        ("object: {name: wall, upright: {max_tilt: 180 deg}}", "object.upright.max_tilt", BEYOND),
        ("object: {name: wall, reach: {x: 1, y: 0, yaw: 0, yaw_tolerance: 4}}", "object.reach.yaw_tolerance", BEYOND),
    ],
)
def test_a_claim_that_cannot_fail_in_any_world_is_refused_unless_allowed(
    expect: str, key: str, rule: str, tmp_path: Path
) -> None:
    text = scenario(expect, WALL.replace("pose", "mass: 1, pose"))
    assert errors(tmp_path, text) == [(f"expect.0.{key}", rule)]
    # An angle that is no mistake may still be a limit that cannot be exceeded.
    assert load(tmp_path, f"{text}allow: [{rule}, unreachable-limit]\n")


@pytest.mark.parametrize(
    "expect",
    [
        "upright: {max_tilt: 179 deg}",
        "max_speed: {linear: 99 m/s, angular: 999 rad/s}",
        "path_length: {at_most: 2.99 km}",
        "reach: {x: 1, y: 0, yaw: 90 deg}",
        "reach: {x: 1, y: 0, yaw: 6.2832}",
        "reach: {x: 1, y: 0, yaw: 720 deg}",
        "reach: {x: 1, y: 0, yaw: 20 rad}",
        "stl: always (tilt < 20 deg)",
        "stl: always (speed < 1 and time < 40 s and x > -20)",
        "stl: always (turn_rate * 0.1 m < 20 m/s)",
    ],
)
def test_a_claim_that_can_fail_is_accepted(expect: str, tmp_path: Path) -> None:
    assert load(tmp_path, scenario(expect, WALL)).warnings == ()


def test_the_watchdog_of_the_scenario_decides_which_speed_cannot_be_exceeded(tmp_path: Path) -> None:
    slow = "physics: {max_speed: 2 m/s}\n"
    assert errors(tmp_path, scenario("max_speed: {linear: 3}", slow)) == [("expect.0.max_speed.linear", BEYOND)]
    assert load(tmp_path, scenario("max_speed: {linear: 1.9}", slow))


def test_every_angle_of_a_file_needs_a_unit_beyond_a_turn(tmp_path: Path) -> None:
    text = LEAST.replace("turtlebot3_burger\n", "turtlebot3_burger\n  pose: {yaw: 90}\n")
    world = "world: {objects: [{name: a, box: [1, 1, 1], pose: {x: 5, roll: -45}}]}\n"
    refused = errors(tmp_path, text + world + "sensors: [{lidar: {rays: 3}, pose: {yaw: 30}}]\n")
    places = ("robot.pose.yaw", "world.objects.0.pose.roll", "sensors.0.pose.yaw")
    assert refused == [(place, "bare-angle") for place in places]
    (line, *_) = told(tmp_path, text)
    assert line.endswith(
        "robot.pose.yaw: 90 without a unit is in rad, and more than one turn; "
        "write '90 deg' if degrees are meant, else '90 rad' [bare-angle]"
    )


@pytest.mark.parametrize(
    ("expect", "key"),
    [
        ("joint: {name: elbow, at_most: 90}", "joint.at_most"),
        ("joint: {name: elbow, near: 45, tolerance: 5 deg}", "joint.near"),
        ("joint_within: {position: {elbow: [-90, 1]}}", "joint_within.position.elbow.0"),
        ("stl: always (position(elbow) < 90)", "stl"),
    ],
)
def test_a_joint_that_cannot_make_a_turn_needs_a_unit_beyond_one(expect: str, key: str, tmp_path: Path) -> None:
    assert errors(tmp_path, judging(tmp_path, expect)) == [(f"expect.0.{key}", "bare-angle")]
    many_turns = expect.replace("elbow", "reel")
    assert load(tmp_path, judging(tmp_path, many_turns))
    assert load(tmp_path, judging(tmp_path, expect) + "allow: [bare-angle]\n")
    velocity = expect.replace("at_most", "reading: velocity, at_most").replace("position", "velocity")
    assert "near" in velocity or load(tmp_path, judging(tmp_path, velocity))


def test_warnings_alone_are_refused(tmp_path: Path) -> None:
    soft = "travel: {at_least: 1 m}\n    severity: warning\n  - no_collision\n    severity: warning"
    text = scenario(soft.replace("no_collision\n   ", "upright: {}\n   "))
    (line,) = told(tmp_path, text)
    assert line == (
        "10:5: expect.0.severity: every expectation has severity: warning, so this scenario cannot fail; "
        "remove it from one of them [warnings-only]"
    )
    assert load(tmp_path, text + "allow: [warnings-only]\n")
    # The engines may disagree.
    assert load(tmp_path, text + "agreement: {position: 3 cm}\n")
    assert load(tmp_path, text.replace("expect:\n", "expect:\n  - max_speed: {linear: 1}\n"))


def test_nothing_to_touch(tmp_path: Path) -> None:
    assert warnings(tmp_path, scenario("no_collision")) == [(9, "nothing-to-touch")]
    assert warnings(tmp_path, scenario("no_collision", WALL)) == []
    assert warnings(tmp_path, scenario("no_collision: {allow: [wall]}", WALL)) == [(9, "nothing-to-touch")]
    assert warnings(tmp_path, scenario("all_of: [no_collision, upright]")) == [(9, "nothing-to-touch")]
    assert warnings(tmp_path, scenario("no_collision", "allow: [nothing-to-touch]\n")) == []


@pytest.mark.parametrize(
    ("before", "appears", "late"), [("", "2 s", False), ("before: 2 s", "2 s", True), ("before: 2 s", "1.9 s", False)]
)
def test_an_object_that_appears_too_late_to_be_touched(before: str, appears: str, late: bool, tmp_path: Path) -> None:
    ball = f"{{name: ball, sphere: {{radius: 1}}, mass: 1, pose: {{x: 9, z: 3}}, appears: {appears}}}"
    text = scenario(f"no_collision: {{}}\n    {before}", f"world: {{objects: [{ball}]}}\n")
    assert warnings(tmp_path, text) == [(9, "nothing-to-touch")] * late


@pytest.mark.parametrize(
    ("keys", "found"),
    [
        ("which: min, at_least: 0.8", [9]),
        ("which: mean, at_least: 31 cm", [9]),
        ("which: min, at_least: 0.3", []),
        ("which: max, at_least: 0.8", []),
        ("which: min, at_least: 0.8, once: true", []),
        ("which: min, at_most: 0.8", []),
    ],
)
def test_a_distance_beyond_the_range_of_its_sensor(keys: str, found: list[int], tmp_path: Path) -> None:
    lidar = "sensors: [{lidar: {rays: 3, range: 0.3}, name: scan}]\n"
    text = scenario(f"sensor: {{name: scan, reading: ranges, {keys}}}", lidar)
    assert warnings(tmp_path, text) == [(line, "limit-beyond-range") for line in found]
    if "0.8" in keys and found:
        (warning,) = load(tmp_path, text).warnings
        message = "scan sees 0.3 m far, so nothing between 0.3 m and 0.8 m is noticed; raise its 'range'"
        assert warning.message == message
    camera = "sensors: [{camera: {far: 0.3}, name: scan, link: base_scan}]\n"
    assert warnings(tmp_path, text.replace(lidar, camera).replace("ranges", "depth")) == warnings(tmp_path, text)


@pytest.mark.parametrize(
    ("segments", "lines"),
    [
        ("{linear: 1, for: 2000}, {linear: 0}", [6]),
        ("{linear: 1, for: 31 s}", [6]),
        ("{linear: 1, for: 30 s}", []),
        ("{linear: 1, for: 30 s}, {linear: 0}", [6]),
        ("{linear: 1, for: 20 s}, {linear: 0, for: 20 s}, {linear: 2}", [6]),
        ("{linear: 1, for: 20 s}, {linear: 0, for: 20 s}", []),
    ],
)
def test_a_segment_beyond_the_run(segments: str, lines: list[int], tmp_path: Path) -> None:
    text = LEAST.replace("  twist:\n    - {linear: 1.0}\n", f"  twist: [{segments}]\n")
    assert warnings(tmp_path, text) == [(line, "segment-beyond-run") for line in lines]


def test_a_segment_in_milliseconds_and_a_joint_point_beyond_the_run(tmp_path: Path) -> None:
    text = LEAST.replace("{linear: 1.0}", "{linear: 1.0, for: 2000}")
    (warning,) = load(tmp_path, text).warnings
    assert warning.message == "this segment lasts 2000 s, but the run ends at 30 s (time_limit); '2000 ms' meant?"
    assert (warning.location.line, warning.location.column) == (7, 21)
    points = "commands: {joints: [{at: 1 s, position: {elbow: 1}}, {at: 1500, position: {elbow: 0}}]}\n"
    assert [rule for _, rule in warnings(tmp_path, judging(tmp_path, "settled") + points)] == ["segment-beyond-run"]


@pytest.mark.parametrize(
    ("waypoints", "end", "told"),
    [
        ("{z: 0.3, at: 2 s}, {z: 0.25, at: 4 s}", "", "this point is at 4 s, but the run ends at 3 s (time_limit); "),
        ("{z: 0.3, at: 2 s}, {z: 0.25, at: 3 s}", "", None),
        ("{z: 0.3, at: 2 s}, {z: 0.25, at: 3 s}", "duration: 2.5 s", "at 3 s, but the run ends at 2.5 s (duration); "),
        ("{z: 0.3, at: 2 s}, {z: 0.25, at: 3 s}", "duration: 3 s", None),
        ("{hold: 100 s}, {z: 0.3}, {z: 0.25}", "", "' ms' meant?"),
        ("{z: 0.3, at: 2 s, hold: 0.5 s}, {z: 0.25, speed: 0.01}", "", "but the run ends at 3 s (time_limit)"),
        ("{z: 0.3, at: 2 s, hold: 0.5 s}, {z: 0.25, speed: 1}", "", None),
    ],
)
def test_a_waypoint_of_a_link_beyond_the_run(waypoints: str, end: str, told: str | None, tmp_path: Path) -> None:
    text = (
        "name: late\nrobot: {model: ur5e_gripper, joints: {elbow_joint: 90 deg}}\n"
        f"commands: {{pose: {{link: tool0, orientation: free, waypoints: [{waypoints}]}}}}\n"
        f"expect: [{{joint_within: {{position: {{elbow_joint: [0 deg, 170 deg]}}}}}}]\ntime_limit: 3 s\n{end}\n"
    )
    found = load(tmp_path, text).warnings
    assert [warning.rule for warning in found] == ["segment-beyond-run"] * (told is not None)
    assert all(told is not None and told.replace("' ms'", " ms'") in warning.message for warning in found)


@pytest.mark.parametrize(
    ("expect", "end", "found"),
    [
        ("settled", "duration: 1 s", False),
        ("{joint_within: {position: {elbow: [-1, 2]}}}", "duration: 1 s", True),
        ("{joint_within: {position: {elbow: [-1, 2]}}, before: 4 s}", "duration: 1 s", False),
        ("{joint_within: {position: {elbow: [-1, 2]}}, after: 4 s}", "duration: 1 s", False),
        ("{joint_within: {position: {elbow: [-1, 2]}}}", "", False),
        ("{stl: 'always[0 s, 3.5 s] (position(elbow) < 2)'}", "duration: 1 s", False),
    ],
)
def test_a_run_without_goals_ends_at_its_duration(expect: str, end: str, found: bool, tmp_path: Path) -> None:
    points = f"commands: {{joints: [{{at: 3 s, position: {{elbow: 1}}}}]}}\n{end}\n"
    text = judging(tmp_path, expect) + points
    assert [rule for _, rule in warnings(tmp_path, text)] == ["segment-beyond-run"] * found


@pytest.mark.parametrize(
    ("wrench", "found"),
    [("force: [0, 0, 0]", True), ("force: [0, 0, 0], torque: [0, 0, 0]", True), ("torque: [0, 0, 1]", False)],
)
def test_a_wrench_of_zero(wrench: str, found: bool, tmp_path: Path) -> None:
    text = LEAST.replace("  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n", f"  wrench: {{{wrench}}}\n")
    assert [rule for _, rule in warnings(tmp_path, text)] == ["silent-controller"] * found


def test_a_golden_file_of_one_row(tmp_path: Path) -> None:
    text = scenario("matches: {trace: golden.csv, position: 2 cm}")
    head = "# sim-action golden trajectory 1: turtlebot3_burger\ntime_s,x_m,y_m,z_m,yaw_rad\n"
    (tmp_path / "golden.csv").write_text(f"{head}0.004,0.0,0.0,0.0,0.0\n")
    assert errors(tmp_path, text) == [("expect.0.matches.trace", "single-row-golden")]
    assert load(tmp_path, text + "allow: [single-row-golden]\n")
    (tmp_path / "golden.csv").write_text(f"{head}0.004,0.0,0.0,0.0,0.0\n0.1,0.0,0.0,0.0,0.0\n")
    assert load(tmp_path, text)


def test_allow_names_rules(tmp_path: Path) -> None:
    (line,) = told(tmp_path, LEAST + "allow: [never-move]\n")
    assert "allow.0: 'never-move' is not a rule; did you mean 'never-moved'? (allowed: bare-angle, " in line
    assert load(tmp_path, f"{LEAST}allow: [{', '.join(RULES)}]\n").scenario.allow == tuple(RULES)
    for allow in ("bare-angle", "{bare-angle: true}", "[1, bare-angle]"):
        assert any(": allow" in line for line in told(tmp_path, f"{LEAST}allow: {allow}\n"))


SHAPE = '<geometry><box size="0.2 0.2 0.2"/></geometry>'
COLLISION = f"<collision>{SHAPE}</collision>"
VISUAL = f"<visual>{SHAPE}</visual>"


def robot(folder: Path, base: str = "", decor: str = "", arm: str = "", hand: str = "") -> None:
    """Write a base with a fixed decoration, and an arm with a fixed hand."""

    def link(name: str, shapes: str) -> str:
        return f'<link name="{name}">{INERTIAL}{shapes}</link>\n'

    def joint(child: str, parent: str, kind: str) -> str:
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        limit = '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="5" velocity="5"/>' if kind != "fixed" else ""
        return f'<joint name="{child}_joint" type="{kind}">{ends}{limit}</joint>\n'

    links = link("base", base) + link("decor", decor) + link("arm", arm) + link("hand", hand)
    joints = joint("decor", "base", "fixed") + joint("arm", "base", "revolute") + joint("hand", "arm", "fixed")
    (folder / "robot.urdf").write_text(f'<robot name="r">\n{links}{joints}</robot>\n')


def near_wall(expect: str, more: str = "", base: str = "free") -> str:
    head = f"name: a\nrobot: {{model: robot.urdf, base: {base}, pose: {{z: 1}}}}\n{WALL}expect:\n  - {expect}\n"
    return f"{head}time_limit: 5 s\n{more}"


def fixed_base(folder: Path, text: str) -> list[Problem]:
    return [problem for problem in problems(folder, text) if problem.message.endswith("[fixed-base]")]


def warned(folder: Path, text: str) -> list[str]:
    return [str(warning) for warning in load(folder, text).warnings]


@pytest.mark.parametrize(
    "expect",
    [
        "no_collision",
        "clearance: {at_least: 1 m}",
        "contact: {with: wall}",
        "stops_before: {body: wall, gap: [0.1, 0.5]}",
        "not: no_collision",
    ],
)
def test_a_robot_without_collision_shapes_touches_nothing(expect: str, tmp_path: Path) -> None:
    robot(tmp_path, arm=VISUAL)
    (problem,) = problems(tmp_path, near_wall(expect))
    assert problem.message.endswith(
        " checks nothing: no link of the robot has a collision shape; add <collision> to 'arm' [no-collision-shape]"
    )
    assert load(tmp_path, near_wall(expect, "allow: [no-collision-shape]\n")).warnings == ()
    assert load(tmp_path, near_wall("upright")).warnings == ()
    robot(tmp_path, base=COLLISION)
    assert load(tmp_path, near_wall(expect)).warnings == ()


def test_moving_links_that_are_only_visual_are_named(tmp_path: Path) -> None:
    expect = "all_of: [no_collision, {clearance: {at_least: 1 m}}]"
    robot(tmp_path, base=COLLISION, decor=VISUAL, arm=VISUAL, hand=VISUAL)
    (warning,) = warned(tmp_path, near_wall(expect))
    assert warning == (
        "contacts of 'arm', 'hand' are not seen: the links have a visual shape, but no collision shape; "
        "add <collision> [shapeless-links]"
    )
    assert warned(tmp_path, near_wall(expect, "allow: [shapeless-links]\n")) == []
    assert warned(tmp_path, near_wall("clearance: {at_least: 1 m, links: [base]}")) == []
    assert warned(tmp_path, near_wall("upright")) == []
    # All links may touch.
    robot(tmp_path, base=COLLISION, hand=COLLISION)
    assert warned(tmp_path, near_wall("no_collision: {allow: [base]}")) == []
    assert warned(tmp_path, near_wall("no_collision: {allow: [base, hand]}")) == [
        "allow names every link with a collision shape, so no touch counts; remove links from allow [nothing-to-touch]"
    ]


def test_parts_of_a_body_with_a_shape_and_a_base_that_cannot_move_need_none(tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION, decor=VISUAL, arm=VISUAL, hand=COLLISION)
    assert warned(tmp_path, near_wall("no_collision")) == []
    robot(tmp_path, base=VISUAL, decor=VISUAL, hand=COLLISION)
    assert warned(tmp_path, near_wall("no_collision", base="fixed")) == []
    assert len(warned(tmp_path, near_wall("no_collision"))) == 1


@pytest.mark.parametrize(
    ("expect", "key"),
    [
        ("travel: {at_least: 1 m}", "travel"),
        ("path_length: {at_most: 1 m}", "path_length"),
        ("reach: {x: 0, y: 0}", "reach"),
        ("stay_within: {x: [-1, 1]}", "stay_within"),
        ("upright", "upright"),
        ("max_speed: {linear: 1}", "max_speed"),
        ("final_pose: {x: 0}", "final_pose"),
        ("follow_path: {path: [{x: 0, y: 0}, {x: 1, y: 0}], max_error: 0.1}", "follow_path"),
        ("settled: {joints: false}", "settled.joints"),
        ("not: {upright: {}}", "not.upright"),
    ],
)
def test_a_fixed_base_cannot_move(expect: str, key: str, tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    (problem,) = fixed_base(tmp_path, near_wall(expect, base="fixed"))
    assert f"expect.0.{key}: " in problem.message
    assert load(tmp_path, near_wall(expect, "allow: [fixed-base]\n", base="fixed"))
    assert load(tmp_path, near_wall(expect))


def test_joints_of_a_robot_with_a_fixed_base_can_be_judged(tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    golden = "# sim-action golden trajectory 1: r\ntime_s,x_m,y_m,z_m,yaw_rad,arm_joint_rad\n"
    (tmp_path / "golden.csv").write_text(f"{golden}0.0,0.0,0.0,1.0,0.0,0.0\n0.1,0.0,0.0,1.0,0.0,0.0\n")
    matches = "matches: {trace: golden.csv, joints: {'*': 0.1}}"
    for expect in ("settled", "joint: {name: arm_joint, at_most: 1}", matches):
        assert load(tmp_path, near_wall(expect, base="fixed"))
    (tmp_path / "golden.csv").unlink()
    (problem,) = fixed_base(tmp_path, near_wall("matches: {trace: golden.csv, position: 1 cm}", base="fixed"))
    assert "add tolerances in 'joints' [fixed-base]" in problem.message


@pytest.mark.parametrize(
    ("limit", "key"),
    [
        ("at_most: 5", "at_most"),
        ("at_most: 5.001 N m", "at_most"),
        ("at_most: 4, rms_at_most: 6", "rms_at_most"),
        ("at_most: 4.9", None),
        ("rms_at_most: 4.9", None),
    ],
)
def test_motors_that_cannot_exceed_a_limit(limit: str, key: str | None, tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    text = near_wall(f"effort: {{{limit}}}", base="fixed")
    if key is None:
        assert load(tmp_path, text).warnings == ()
        return
    (problem,) = problems(tmp_path, text)
    assert f"expect.0.effort.{key}: this limit cannot be exceeded: the motors give at most 5 N m ('arm_joint')" in (
        problem.message
    )
    assert problem.message.endswith("[unreachable-limit]")
    assert load(tmp_path, text + "allow: [unreachable-limit]\n")
    file = tmp_path / "robot.urdf"
    file.write_text(file.read_text().replace('effort="5"', 'effort="0"'))
    assert load(tmp_path, text)


@pytest.mark.parametrize("key", ["effort: {at_most: 1 N, joints: [JOINT]}", "energy: {at_most: 1, joints: [JOINT]}"])
def test_a_joint_that_mimics_another_has_no_motor(key: str, tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "commands/arm.urdf", tmp_path / "robot.urdf")
    (problem,) = problems(tmp_path, near_wall(key.replace("JOINT", "right_finger_joint"), base="fixed"))
    assert problem.message.endswith(
        "joints.0: joint 'right_finger_joint' mimics 'left_finger_joint' and has no motor of its own; "
        "name 'left_finger_joint'"
    )
    assert load(tmp_path, near_wall(key.replace("JOINT", '"*_finger_joint"'), base="fixed"))


class Sway(Assertion):
    """An assertion as an installed package may have it."""

    key: ClassVar[str] = "sway"
    ceilings: ClassVar[tuple[Ceiling, ...]] = (Ceiling("at_most", "rad", "nothing sways by more than 180 deg"),)
    sees_shapes: ClassVar[bool] = True

    at_most: float

    @property
    @override
    def title(self) -> str:
        return "sway"

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        raise NotImplementedError


def test_an_assertion_of_a_package_gets_the_same_audits(tmp_path: Path) -> None:
    robot(tmp_path, arm=VISUAL)
    loaded = load(tmp_path, near_wall("upright"))
    audited = loaded.scenario.model_copy(update={"expect": (expectation(Sway(at_most=4.0)),)})
    (limit,) = audit_scenario(audited, [("expect", 0)], [])
    assert (limit.rule, limit.path) == (BEYOND, ("expect", 0, "sway", "at_most"))
    assert "because nothing sways by more than 180 deg" in limit.message
    (shape,) = audit_robot(build_scene(loaded), audited, [("expect", 0)], [])
    assert (shape.rule, shape.path) == ("no-collision-shape", ("expect", 0, "sway"))


@pytest.mark.parametrize(
    ("expect", "rule"),
    [
        ("any_of: [upright, {not: {upright: {}}}]", BEYOND),
        ("any_of: [{travel: {at_most: 1 m}}, {travel: {at_least: 50 cm}}]", BEYOND),
        ("any_of: [{clearance: {at_least: 20 cm}}, {clearance: {at_most: 30 cm}}]", BEYOND),
        ("stl: always (time >= 0)", BEYOND),
        ("max_speed: {angular: 45}", "bare-angle"),
    ],
)
def test_a_check_that_cannot_fail_is_refused_unless_the_expectation_allows_it(
    expect: str, rule: str, tmp_path: Path
) -> None:
    assert [refused for _, refused in errors(tmp_path, scenario(expect, WALL))] == [rule]
    assert load(tmp_path, scenario(f"{expect}\n    allow: [{rule}]", WALL))


@pytest.mark.parametrize(
    "expect",
    [
        "not: {travel: {at_least: 20 km}}",
        "not: {path_length: {at_most: 1 mm, link: wheel_left_link, frame: base}}",
        "not: {stl: eventually (speed > 500 m/s)}",
        "any_of: [upright, {not: {travel: {at_least: 20 km}}}]",
        "not: {all_of: [{travel: {at_least: 20 km}}, upright]}",
        "all_of: [{travel: {at_least: 20 km}}, upright]",
        "not: {sensor: {name: imu, reading: orientation_xyzw, which: norm, at_least: 5}}",
        "any_of: [{not: {joint: {name: wheel_left_joint, reading: velocity, at_least: 9000}}}, upright]",
    ],
)
def test_a_combination_is_refused_once_if_a_part_alone_decides_every_run(expect: str, tmp_path: Path) -> None:
    ((_, rule),) = errors(tmp_path, scenario(expect, "sensors: [{imu: {}, name: imu, rate: 20 Hz}]\n"))
    assert rule == BEYOND
    within = expect.replace("20 km", "2 m").replace("500", "0.5").replace("at_least: 5}", "at_least: 0.5}")
    if within != expect and "norm" not in expect:
        assert load(tmp_path, scenario(within))
