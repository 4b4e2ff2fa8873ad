"""The audit of claims after a run: what never held, never moved, never began."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.assertions.upright import Upright
from sim_action.commands.twist import TwistCommands
from sim_action.commands.wrench import WrenchCommands
from sim_action.core.geometry import Twist
from sim_action.engines import installed
from sim_action.simulation.run_audit import CommandLog, unreached_events
from sim_action.state.command import JointTargets, LinkWrench
from sim_action.world import World
from tests.simulated import simulated as run
from tests.traces import expectation, scenario

STANDING = """\
name: a
robot: {model: turtlebot3_burger}
expect: [upright]
duration: 0.2 s
time_limit: 1 s
"""


SIGN = "world: {objects: [{name: sign, box: [0.1, 0.1, 0.1], pose: {x: 5}}]}\n"


def rules(folder: Path, text: str) -> list[tuple[str, str]]:
    """The rule and the dotted keys of each finding."""
    return [(finding.rule, ".".join(map(str, finding.path))) for finding in run(folder, text).findings]


def test_robots_that_stand_turn_or_move_their_wheels_have_no_finding(tmp_path: Path) -> None:
    assert rules(tmp_path, STANDING) == []
    assert rules(tmp_path, STANDING + "commands: {twist: [{angular: 0.5}]}\n") == []
    fixed = STANDING.replace("burger}", "burger, base: fixed, pose: {z: 1}}") + "allow: [fixed-base]\n"
    assert rules(tmp_path, fixed + "commands: {twist: [{linear: 0.1}]}\n") == []


@pytest.mark.parametrize("engine", installed())
def test_a_robot_that_never_moves_although_it_is_commanded(engine: str, tmp_path: Path) -> None:
    drives = f"{STANDING}backend: {engine}\ncommands: {{twist: [{{linear: 0.1}}]}}\n"
    assert rules(tmp_path, drives) == []
    # Without friction, the wheels turn and the base stays.
    ice = "world: {ground: {friction: 0.0}}\n"
    assert rules(tmp_path, drives + ice) == [("never-moved", "commands")]
    assert rules(tmp_path, f"{drives}{ice}allow: [never-moved]\n") == []
    (finding,) = run(tmp_path, drives + ice).findings
    assert finding.message == "the run ended at 0.20 s, before the robot could move; run for longer"
    (finding,) = run(tmp_path, (drives + ice).replace("duration: 0.2 s", "duration: 0.6 s")).findings
    assert finding.message.endswith("its base never moved by 1 mm or 0.1 deg; check wheels, friction and limits")
    assert rules(tmp_path, drives.replace("0.1}", "0}") + ice) == []


ARM = """\
<robot name="arm">
  <link name="base"><inertial>MASS</inertial></link>
  <link name="hand"><inertial>MASS</inertial></link>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="50" velocity="SPEED"/></joint>
</robot>
""".replace("MASS", '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>')
HOLDS = """\
from sim_action import JointTargets

def control(seen):
    return JointTargets(position={"elbow": AT})
"""


@pytest.mark.parametrize(
    ("at", "speed", "found"),
    [
        (0.0, "5", [("silent-controller", "commands")]),
        (0.5, "5", []),
        (0.0, "0.001", [("silent-controller", "commands")]),
        (0.5, "0.001", [("never-moved", "commands")]),
    ],
)
def test_a_joint_moves_unless_it_is_there(at: float, speed: str, found: list[tuple[str, str]], tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.replace("SPEED", speed))
    (tmp_path / "hold.py").write_text(HOLDS.replace("AT", str(at)))
    arm = STANDING.replace("turtlebot3_burger}", "arm.urdf, base: fixed}") + "allow: [fixed-base]\n"
    assert rules(tmp_path, arm + "commands: {script: hold.py}\n") == found


WALL = "world: {objects: [{name: wall, box: [0.1, 9, 1], pose: {x: 1}}]}\n"
SCANS = STANDING.replace("0.2 s", "0.5 s") + "sensors: [{lidar: {rays: 3}, name: scan, link: base_scan, rate: RATE}]\n"
CLEAR = "sensor: {name: scan, reading: ranges, which: min, at_least: 0.01}"


@pytest.mark.parametrize(
    ("expect", "rate", "found"),
    [
        (CLEAR, "1 Hz", "expect.0.sensor"),
        (CLEAR, "10 Hz", None),
        (f"{CLEAR}, severity: warning}}, {{upright: {{}}", "1 Hz", None),
        (CLEAR.replace("}", ", once: true}"), "1 Hz", None),
        ("upright: {}, after: 0.5 s", "1 Hz", "expect.0.upright"),
        ("upright: {}, after: 0.4 s", "1 Hz", None),
        ("final_pose: {x: 0, y: 0}, after: 0.5 s", "1 Hz", None),
        ("effort: {rms_at_most: 1}, after: 0.5 s", "1 Hz", None),
    ],
)
def test_an_invariant_that_was_judged_once(expect: str, rate: str, found: str | None, tmp_path: Path) -> None:
    text = WALL + SCANS.replace("RATE", rate).replace("[upright]", f"[{{{expect}}}]")
    assert rules(tmp_path, text) == [("judged-once", found)] * (found is not None)
    if found == "expect.0.sensor":
        (finding,) = run(tmp_path, text).findings
        assert finding.message == "was judged at one moment only, at 0.00 s; raise the sensor's rate, or run for longer"
        # A run of one step has no other moment.
        assert rules(tmp_path, text.replace("duration: 0.5 s", "duration: 1 ms")) == []


@pytest.mark.parametrize(
    ("answer", "is_silent"),
    [
        ("None", True),
        ("Twist()", True),
        ("JointTargets(effort={'wheel_left_joint': 0.0})", True),
        ("JointTargets(effort={'wheel_left_joint': 0.1})", False),
        ("Twist.planar(0.1, 0.0) if seen.time > 0.04 else None", False),
    ],
)
def test_a_controller_that_commands_nothing(answer: str, is_silent: bool, tmp_path: Path) -> None:
    source = f"from sim_action import JointTargets, Twist\n\ndef control(seen):\n    return {answer}\n"
    (tmp_path / "drive.py").write_text(source)
    text = STANDING + "commands: {script: drive.py, rate: 20 Hz}\n"
    assert rules(tmp_path, text) == [("silent-controller", "commands")] * is_silent
    if is_silent:
        (finding,) = run(tmp_path, text).findings
        assert finding.message.startswith("the controller gave no command other than zero in the whole run")
        assert rules(tmp_path, text + "allow: [silent-controller]\n") == []


def test_goals_that_are_met_before_the_robot_moves(tmp_path: Path) -> None:
    goal = "settled: {speed: 9 m/s, turn_rate: 9 rad/s, for: 4 ms}"
    text = STANDING.replace("upright", f"{{{goal}}}").replace("duration: 0.2 s\n", "")
    ice = "world: {ground: {friction: 0.0}}\n"
    (finding,) = run(tmp_path, text + ice + "commands: {twist: [{linear: 0.1}]}\n").findings
    assert finding.rule == "never-moved"
    assert "before the robot could move: its goals were met at once; run for longer" in finding.message


@pytest.mark.parametrize(
    ("which", "wall", "found"), [("min", "", True), ("mean", "", True), ("max", "", False), ("min", WALL, False)]
)
def test_a_sensor_that_sees_nothing_in_range(which: str, wall: str, found: bool, tmp_path: Path) -> None:
    text = SCANS.replace("RATE", "10 Hz").replace("[upright]", f"[{{{CLEAR.replace('min', which)}}}]")
    assert rules(tmp_path, text + wall) == [("nothing-in-range", "expect.0.sensor")] * found


@pytest.mark.parametrize(
    ("contact", "commands", "found"),
    [
        ("at_most: 50 N", "", True),
        ("impulse: {at_most: 5 N s}, link: base_footprint", "", True),
        ("at_most: 50 N", "commands: {twist: [{linear: 0.2}]}\n", False),
        ("at_most: 50 N, at_least: 1 N", "", False),
    ],
)
def test_a_limit_of_a_contact_that_never_was(contact: str, commands: str, found: bool, tmp_path: Path) -> None:
    near = WALL.replace("x: 1}", "x: 0.1}").replace("0.1, 9", "0.1, 1")
    text = (
        STANDING.replace("upright", f"contact: {{with: wall, {contact}}}").replace("0.2 s", "0.8 s") + near + commands
    )
    assert rules(tmp_path, text) == [("never-touched", "expect.0.contact")] * found
    assert rules(tmp_path, text + "allow: [never-touched]\n") == []


@pytest.mark.parametrize(
    ("formula", "commands", "found"),
    [
        ("always (force(wall) < 50 N)", "", True),
        ("always (force(base_footprint, wall) < 50 N)", "", True),
        ("always (force(wall) < 5000 N)", "commands: {twist: [{linear: 0.2}]}\n", False),
        ("always (force(base_scan, wall) < 5000 N)", "commands: {twist: [{linear: 0.2}]}\n", True),
        ("always (clearance(wall) > -1 m)", "commands: {twist: [{linear: 0.2}]}\n", False),
    ],
)
def test_a_force_that_never_was(formula: str, commands: str, found: bool, tmp_path: Path) -> None:
    near = WALL.replace("x: 1}", "x: 0.1}").replace("0.1, 9", "0.1, 1")
    text = STANDING.replace("upright", f"stl: '{formula}'").replace("[stl", "[{stl").replace("']", "'}]")
    text = text.replace("0.2 s", "0.8 s") + near + commands
    assert rules(tmp_path, text) == [("never-touched", "expect.0.stl")] * found
    implied = text.replace("always (force(wall)", "always (force(wall) > 1 N implies force(wall)")
    if not commands and implied != text:
        assert rules(tmp_path, implied) == [("premise-never-held", "expect.0.stl")]


@pytest.mark.parametrize(
    ("expect", "more", "found"),
    [
        ("upright: {}", "", True),
        ("stay_within: {x: [0, 2]}", "", True),
        ("moved: {at_most: 1 cm}", "", False),
        ("upright: {}", "commands: {twist: [{linear: 0.2}]}\n", False),
        ("stay_within: {frame: base, x: [-1, 2]}", "commands: {twist: [{linear: -0.2}]}\n", False),
        ("upright: {}", "allow: [object-never-moved]\n", False),
    ],
)
def test_an_object_that_never_moved(expect: str, more: str, found: bool, tmp_path: Path) -> None:
    cube = "world: {objects: [{name: cube, box: [0.2, 0.2, 0.2], mass: 0.1, pose: {x: 0.2}}]}\n"
    text = STANDING.replace("[upright]", f"[{{object: {{name: cube, {expect}}}}}]").replace("0.2 s", "0.8 s")
    assert rules(tmp_path, text + cube + more) == [("object-never-moved", "expect.0.object")] * found


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("latency: 0.5 s", "the first one was due at 0.5 s, but the run ended at 0.2 s; lower 'latency'"),
        ("dropouts: 99.999 %", "all were lost; lower 'dropouts', or run for longer"),
        ("latency: 0.15 s", None),
    ],
)
def test_commands_that_never_arrive(keys: str, told: str | None, tmp_path: Path) -> None:
    (tmp_path / "drive.py").write_text(
        "from sim_action import Twist\n\ndef control(seen):\n    return Twist.planar(0.2, 0)\n"
    )
    text = STANDING + f"commands: {{script: drive.py, rate: 10 Hz, {keys}}}\n"
    found = [finding for finding in run(tmp_path, text).findings if finding.rule != "never-moved"]
    assert [(finding.rule, finding.path) for finding in found] == [("command-never-arrived", ("commands", 0))] * (
        told is not None
    )
    assert all(f"no command of commands[0] took effect: {told}" in finding.message for finding in found)
    drive = "drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint]}}"
    pressed = STANDING.replace("burger}", f"burger, {drive}}}")
    wrench = (
        pressed + f"commands: {{wrench: {{force: [0, 9, 0]}}, rate: 40 Hz, {keys}}}\nallow: [drive-never-commanded]\n"
    )
    assert rules(tmp_path, wrench) == [("command-never-arrived", "commands.0")] * (told is not None)


@pytest.mark.parametrize(("most", "found"), [(1, 1), (0, 0)])
def test_feet_that_are_never_on_the_ground(most: int, found: int, tmp_path: Path) -> None:
    feet = f"{{feet_on_ground: {{links: ['wheel_*'], at_most: {most}, 'on': [sign]}}}}"
    text = STANDING.replace("[upright]", f"[{feet}]") + SIGN
    assert rules(tmp_path, text) == [("never-touched", "expect.0.feet_on_ground")] * found


def test_a_drive_that_is_never_commanded(tmp_path: Path) -> None:
    drive = "drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint]}}"
    stated = STANDING.replace("burger}", f"burger, {drive}}}")
    assert rules(tmp_path, stated) == [("drive-never-commanded", "robot.drive")]
    assert rules(tmp_path, stated + "sensors: [odometry]\n") == []
    assert rules(tmp_path, stated + "commands: {twist: [{linear: 0}]}\n") == []
    assert rules(tmp_path, stated + "commands: {twist: [{linear: 0.1}]}\n") == []
    turns = "commands: {joints: [{at: 0.1 s, velocity: {wheel_left_joint: 3, wheel_right_joint: 3}}]}\n"
    assert rules(tmp_path, stated + turns) == []


@pytest.mark.parametrize(
    ("formula", "premises"),
    [
        ("always (tilt > 30 deg implies eventually[0 s, 0.1 s] (tilt < 5 deg))", ["tilt > 30 deg"]),
        ("always (tilt < 30 deg implies speed < 1 m/s)", []),
        ("always[0.1 s, 0.2 s] (time < 0.05 s implies speed < 1 m/s)", ["time < 0.05 s"]),
        ("always (time > 0.15 s implies speed < 1 m/s)", []),
        # It is judged at the first step only.
        ("time > 0.15 s implies speed < 1 m/s", ["time > 0.15 s"]),
        ("not (tilt > 30 deg implies speed < 1 m/s) or speed < 1 m/s", []),
    ],
)
def test_a_premise_that_never_held(formula: str, premises: list[str], tmp_path: Path) -> None:
    for expect in (f"{{stl: '{formula}'}}", f"{{all_of: [upright, {{stl: '{formula}'}}]}}"):
        findings = run(tmp_path, STANDING.replace("[upright]", f"[{expect}]")).findings
        unheld = [finding for finding in findings if finding.rule == "premise-never-held"]
        assert [finding.message.split("'")[1] for finding in unheld] == premises
        # Without a temporal operator, a formula is judged at one step.
        others = {finding.rule for finding in findings if finding not in unheld}
        assert others <= (set() if formula.startswith("always") else {"judged-once"})


def test_a_run_that_a_broken_expectation_ended_has_notes_alone(tmp_path: Path) -> None:
    late = "world: {disturbances: [{at: 0.5 s, velocity: [1, 0, 0]}]}\n"
    ran = run(tmp_path, STANDING + late)
    assert [(finding.rule, finding.path) for finding in ran.findings] == [
        ("event-never-began", ("world", "disturbances", 0))
    ]
    assert not any("never began" in note for note in ran.notes)
    for text in (
        STANDING.replace("[upright]", "[stl: 'always (time < 0.1 s)']") + late,
        STANDING + late + "allow: [event-never-began]\n",
    ):
        ran = run(tmp_path, text)
        assert ran.findings == ()
        assert any("never began" in note for note in ran.notes)


def test_a_log_of_commands() -> None:
    log = CommandLog({"elbow": 1.0}, frozenset({"wheel"}))
    log.add(JointTargets(position={"elbow": 1.0005}, velocity={"elbow": 0.0}))
    assert (log.drives, log.moves_base, log.moves_joints) == (False, False, False)
    log.add(Twist())
    assert (log.drives, log.moves_base) == (True, False)
    log.add(Twist.planar(0.0, -0.1))
    log.add(Twist())
    log.add(JointTargets(position={"elbow": 1.01}))
    log.add(JointTargets())
    assert (log.drives, log.moves_base, log.moves_joints) == (True, True, True)
    efforts = CommandLog({}, frozenset())
    efforts.add(JointTargets(effort={"elbow": 0.0}))
    assert efforts.are_zero
    efforts.add(JointTargets(effort={"elbow": -0.1}))
    assert not efforts.are_zero
    pressed = CommandLog({}, frozenset())
    pressed.add(JointTargets(wrenches=(LinkWrench("base"),)))
    assert pressed.are_zero
    pressed.add(JointTargets(wrenches=(LinkWrench("base", torque_xyz=(0.0, 0.0, -0.1)),)))
    assert not pressed.are_zero
    other = CommandLog({}, frozenset({"wheel"}))
    other.add(JointTargets(velocity={"wheel": -1.0}))
    assert (other.drives, other.moves_base, other.moves_joints) == (True, False, True)


WORLD = World.model_validate(
    {
        "objects": (
            {"name": "gate", "box": (1, 1, 1), "path": ({"at": 2}, {"at": 4, "x": 1})},
            {"name": "ball", "sphere": {"radius": 1}, "mass": 1, "appears": 3},
            {"name": "wall", "box": (1, 1, 1)},
        ),
        "disturbances": ({"at": 0.5, "velocity": (1, 0, 0)}, {"at": 5, "for": 1, "force": (1, 0, 0)}),
    }
)


STILL = scenario(expectation(Upright()))
PRESSED = STILL.model_copy(
    update={
        "world": WORLD,
        "commands": (
            TwistCommands.model_validate({"twist": ({"linear": 1},)}),
            WrenchCommands.model_validate({"wrench": {"force": (0, 0, 1), "at": 4}}),
        ),
    }
)


def test_what_never_came_is_told_each_once() -> None:
    assert list(unreached_events(PRESSED, 5.1)) == []
    assert list(unreached_events(STILL, 0.1)) == []
    assert list(unreached_events(PRESSED, 3.0)) == [
        (("world", "objects", 1, "appears"), "body 'ball' never appeared: it is due at 3 s, but the run ended at 3 s"),
        (("world", "disturbances", 1), "world.disturbances[1] never began: it is due at 5 s, but the run ended at 3 s"),
        (("commands", 1), "the wrench of commands.1 never began: it is due at 4 s, but the run ended at 3 s"),
    ]
    assert len(list(unreached_events(PRESSED, 0.5))) == 5


@pytest.mark.parametrize(
    ("expected", "more", "found"),
    [
        ("stay_within: {link: hand, x: [-1, 1]}", "", True),
        (
            "max_speed: {link: hand, frame: base, linear: 1}",
            "commands: {joints: [{at: 0, position: {elbow: 0}}]}",
            True,
        ),
        ("any_of: [{upright: {link: hand}}, {stay_within: {z: [9, 10]}}]", "", True),
        ("stay_within: {link: hand, x: [-1, 1]}", "allow: [link-never-moved, unreachable-limit]", False),
        ("stay_within: {link: hand, x: [-1, 1]}", "commands: {joints: [{at: 0, velocity: {elbow: 0.5}}]}", False),
        (
            "stay_within: {link: hand, x: [-1, 1]}",
            "world: {disturbances: [{at: 0.1, for: 0.05, link: hand, force: [1e-6, 0, 0]}]}",
            False,
        ),
    ],
)
def test_a_link_that_never_moved_was_at_one_place(expected: str, more: str, found: bool, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.replace("SPEED", "5"))
    allow = "" if "allow" in more else "allow: [fixed-base, unreachable-limit, unreachable-target]"
    robot = "name: a\nrobot: {model: arm.urdf, base: fixed, pose: {z: 1}}"
    text = f"{robot}\nexpect:\n  - {expected}\nduration: 0.2 s\ntime_limit: 1 s\n{more}\n{allow}\n"
    unmoved = [path for rule, path in rules(tmp_path, text) if rule == "link-never-moved"]
    assert unmoved == ([f"expect.0.{expected.partition(':')[0]}"] if found else [])
