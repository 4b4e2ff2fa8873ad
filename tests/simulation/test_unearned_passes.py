"""Scenarios that pass although nothing was checked, and honest scenarios that are like them, on each engine."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario
from sim_action.engines import installed
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import simulate
from tests.scenarios import load
from tests.soak import soaked

BURGER: Final = "robot: {model: turtlebot3_burger}\n"
WALL: Final = "world: {objects: [{name: wall, box: [0.1, 2, 0.5], pose: {x: 2}}]}\n"
DRIVE: Final = "commands: {twist: [{linear: 0.2}]}\n"
SENSORS: Final = (
    "sensors: [{imu: {}, name: imu, rate: 20 Hz}, "
    "{lidar: {rays: 36, range: RANGE}, name: scan, link: base_scan, rate: 10 Hz}]\n"
)
SEEN: Final = BURGER + WALL + DRIVE + SENSORS.replace("RANGE", "3.5 m")
BLIND: Final = BURGER + WALL + DRIVE + SENSORS.replace("RANGE", "1 m")
SITS: Final = BURGER + WALL
DRIVES: Final = SITS + DRIVE
ARM: Final = (
    "robot: {model: ur5e_gripper, joints: {shoulder_lift_joint: -90 deg, elbow_joint: 90 deg}}\n"
    "commands: {joints: [{at: 0.4 s, position: {shoulder_lift_joint: -85 deg}}], interpolation: minimum_jerk}\n"
)
FINGER: Final = (
    "robot: {model: ur5e_gripper}\ncommands: {joints: [{at: 0.1 s, effort: {left_finger_joint: 0.001 N}}]}\n"
)
SCRIPT: Final = """\
from sim_action import Twist


def control(seen):
    return Twist.planar(0.0 if seen.sensors["scan"].ranges.min() < 3.0 else 0.2)
"""
GUARD: Final = SEEN.replace(DRIVE, "commands: {script: guard.py}\n")
ICE: Final = (
    f"{BURGER}{DRIVE}world: {{ground: {{friction: 0.0}}, objects: [\n"
    "  {name: gate, box: [0.1, 2, 0.5], pose: {x: 3, z: 0.25}, path: [{at: 0.2 s}, {at: 1 s, x: 1.5}]}]}\n"
)
BUMPER: Final = DRIVES + "sensors: [{contact: {}, name: bump, link: base_footprint, rate: 50 Hz}]\n"
SLOW: Final = DRIVES.replace("linear: 0.2", "linear: 0.001")


def objects(*more: str) -> str:
    return f"{BURGER}{DRIVE}world: {{objects: [{', '.join(more)}]}}\n"


def world(more: str) -> str:
    return f"{BURGER}{DRIVE}world: {{{more}}}\n"


BEAM: Final = objects("{name: beam, box: [0.1, 2, 0.5], pose: {x: 0.4, z: 9 m}}")
PUSHES: Final = objects("{name: crate, box: [0.2, 0.2, 0.2], mass: 200 g, pose: {x: 0.25, z: 0.1}}")
HUSKY: Final = "robot: {model: husky_a200}\n" + DRIVE
CRATE: Final = objects("{name: crate, box: [0.2, 0.2, 0.2], mass: 1 kg, pose: {x: 2, y: 1}}")
MOVING: Final = """\
from sim_action import Verdict


class AtOnce:
    kind = "goal"

    def judge(self, trace):
        return Verdict(passed=bool(trace.base_position_xyz[-1, 0] >= -0.01))


class Later(AtOnce):
    def judge(self, trace):
        return Verdict(passed=bool(trace.base_position_xyz[-1, 0] >= 0.1))
"""


class Kind(NamedTuple):
    """The rule for a kind of lie; and lies and honest scenarios: a head and what it expects."""

    rule: str
    lies: tuple[tuple[str, str], ...]
    honest: tuple[tuple[str, str], ...]


KINDS: Final[Mapping[str, Kind]] = {
    "a bound that a sensor cannot leave": Kind(
        "unreachable-limit",
        (
            (SEEN, "sensor: {name: imu, reading: orientation_xyzw, which: norm, at_least: 0.9, at_most: 1.1}"),
            (SEEN, "sensor: {name: scan, reading: ranges, which: min, at_least: 0 m}"),
            (SEEN, "stl: always (scan.ranges.min > -1 m)"),
            (SEEN, "sensor: {name: imu, reading: orientation_xyzw, which: z, at_least: -1, at_most: 1}"),
        ),
        (
            (SEEN, "sensor: {name: imu, reading: orientation_xyzw, which: z, at_least: -0.2, at_most: 0.2}"),
            (SEEN, "sensor: {name: scan, reading: ranges, which: min, at_least: 20 cm}"),
        ),
    ),
    "a tautology": Kind(
        "unreachable-limit",
        (
            (DRIVES, "stl: always (x < 1 m or x > 0.5 m)"),
            (DRIVES, "stl: always (speed - 0.1 m/s < speed)"),
            (DRIVES, "stl: always (x*x >= 0)"),
            (DRIVES, "stl: always (abs(yaw) > 10 deg or abs(yaw) < 20 deg)"),
        ),
        (
            (DRIVES, "stl: always (x < 1 m and x > -0.5 m)"),
            (DRIVES, "stl: always (x*y < 1 and x*x*x > -1)"),
            (DRIVES, "stl: eventually (x > 0.1 m and abs(yaw) < 20 deg)"),
        ),
    ),
    "an implication without the word": Kind(
        "premise-never-held",
        (
            (DRIVES, "stl: always (clearance > 30 cm or speed < 1 cm/s)"),
            (DRIVES, "stl: always (not (x > 1 m and speed > 0.5 m/s))"),
            (DRIVES, "stl: always (tilt < 5 deg or speed < 0.3 m/s)"),
            (BUMPER, "stl: always (bump.force < 50 N)"),
        ),
        (
            (BUMPER.replace("x: 2", "x: 0.3"), "stl: always (bump.force < 500 N)"),
            (DRIVES, "stl: always (x < 0.1 m or speed > 0.1 m/s)"),
            (DRIVES, "stl: always (not (x > 0.1 m and abs(y) > 5 cm))"),
        ),
    ),
    "a joint beyond its stop": Kind(
        "unreachable-limit",
        (
            (ARM, "joint: {name: elbow_joint, at_most: 300 deg}"),
            (ARM, "joint_within: {position: {elbow_joint: [-200 deg, 300 deg]}}"),
            (ARM, "stl: always (position(elbow_joint) < 300 deg)"),
        ),
        (
            (ARM, "joint: {name: shoulder_lift_joint, at_most: -80 deg}"),
            (
                ARM,
                "joint_within: {position: {shoulder_lift_joint: [-100 deg, -70 deg], elbow_joint: [0 deg, 100 deg]}}",
            ),
        ),
    ),
    "degrees as radians": Kind(
        "bare-angle",
        (
            (DRIVES, "max_speed: {angular: 45}"),
            (DRIVES, "stl: always (turn_rate < 90)"),
            (DRIVES, "settled: {turn_rate: 5}"),
            (SEEN, "sensor: {name: imu, reading: angular_velocity_xyz, which: norm, at_most: 30}"),
        ),
        ((DRIVES, "max_speed: {angular: 1.5}"), (DRIVES, "stl: always (turn_rate < 90 deg/s)")),
    ),
    "an obstacle out of reach": Kind(
        "nothing-to-touch",
        (
            (objects("{name: wall, box: [0.1, 2, 0.5], pose: {x: 0.4, z: -2 m}}"), "no_collision"),
            (BEAM, "no_collision"),
            (BEAM, "clearance: {at_least: 20 cm}"),
            (BEAM, "all_of: [{clearance: {at_least: 20 cm, to: [beam]}}, upright]"),
        ),
        (
            (objects("{name: wall, box: [0.1, 2, 0.5], pose: {x: 0.9}}"), "no_collision"),
            (objects("{name: shelf, box: [0.5, 2, 0.05], pose: {x: 0.4, z: 0.3}}"), "no_collision"),
            (objects("{name: wall, box: [0.1, 2, 0.5], pose: {x: 0.9}}"), "clearance: {at_least: 20 cm}"),
        ),
    ),
    "a part without effect": Kind(
        "no-effect",
        (
            (world("disturbances: [{at: 0.3 s, for: 0.1 s, force: [0, 0, 0]}]"), "travel: {at_least: 10 cm}"),
            (world("patches: [{x: 5, y: 5, size: [1, 1], friction: 0.1}]"), "travel: {at_least: 10 cm}"),
            (
                world(
                    "patches: [{x: 5, y: 5, size: [1, 1], friction: 0.1}], "
                    "objects: [{name: ball, sphere: {radius: 5 cm}, mass: 100 g, pose: {x: 2, z: 0.05}}]"
                ),
                "travel: {at_least: 10 cm}",
            ),
            (DRIVES + "sensors: [{imu: {gyro_noise: 0.1}, name: imu, rate: 20 Hz}]\n", "travel: {at_least: 10 cm}"),
        ),
        (
            (world("disturbances: [{at: 0.3 s, for: 0.1 s, force: [0, 0.5, 0]}]"), "travel: {at_least: 10 cm}"),
            (world("patches: [{x: 0, y: 0, size: [1, 1], friction: 0.8}]"), "travel: {at_least: 10 cm}"),
            (
                world(
                    "patches: [{x: 5.5, y: 0, size: [1, 1], friction: 0.1}], "
                    "objects: [{name: ball, sphere: {radius: 5 cm}, mass: 100 g, pose: {x: 5.5, z: 0.05}}]"
                ),
                "travel: {at_least: 10 cm}",
            ),
        ),
    ),
    "a path that was hardly driven": Kind(
        "partly-compared",
        (
            (DRIVES, "follow_path: {path: [{x: 0, y: 0}, {x: 10, y: 0}, {x: 10, y: 10}], max_error: 5 cm}"),
            (DRIVES, "all_of: [{follow_path: {path: [{x: 0, y: 0}, {x: 1, y: 0}], max_error: 5 cm}}, upright]"),
            (DRIVES, "matches: {trace: golden.csv, position: 5 cm, duration: 60 s}"),
        ),
        (
            (DRIVES, "follow_path: {path: [{x: 0, y: 0}, {x: 0.2, y: 0}], max_error: 5 cm}"),
            (DRIVES, "matches: {trace: short.csv, position: 5 cm}"),
        ),
    ),
    "a golden file at rest": Kind(
        "golden-at-rest",
        (
            (DRIVES, "matches: {trace: rest.csv, position: 50 cm}"),
            (DRIVES, "matches: {trace: rest.csv, position: 50 cm, yaw: 5 deg}"),
            (DRIVES, "all_of: [{matches: {trace: rest.csv, position: 50 cm}}, upright]"),
        ),
        (
            (DRIVES, "matches: {trace: short.csv, position: 5 cm}"),
            (DRIVES, "matches: {trace: short.csv, position: 5 cm, yaw: 5 deg}"),
        ),
    ),
    "an effort that moves nothing": Kind(
        "link-never-moved",
        (
            (FINGER, "max_speed: {link: forearm_link, linear: 1 m/s}"),
            (FINGER, "stay_within: {link: forearm_link, z: [0, 2]}"),
            (FINGER, "all_of: [{max_speed: {link: forearm_link, linear: 1 m/s}}]"),
        ),
        (
            (ARM, "max_speed: {link: forearm_link, linear: 1 m/s}"),
            (ARM, "stay_within: {link: forearm_link, z: [0, 2]}"),
        ),
    ),
    "a hub in its own frame": Kind(
        "unreachable-limit",
        (
            (DRIVES, "max_speed: {link: wheel_left_link, frame: base, linear: 0.1 m/s}"),
            (DRIVES, "path_length: {link: wheel_left_link, frame: base, at_most: 1 m}"),
            (DRIVES, "travel: {link: wheel_right_link, frame: base, at_most: 1 m}"),
        ),
        (
            (DRIVES, "max_speed: {link: wheel_left_link, frame: base, angular: 20 rad/s}"),
            (DRIVES, "max_speed: {link: wheel_left_link, linear: 0.5 m/s}"),
        ),
    ),
    "a check or its opposite": Kind(
        "unreachable-limit",
        (
            (DRIVES, "any_of: [no_collision, {contact: {with: wall}}]"),
            (DRIVES, "any_of: [no_collision, {clearance: {at_most: 1 cm}}]"),
            (DRIVES, "any_of: [{max_speed: {linear: 0.3}}, {not: {max_speed: {linear: 0.1}}}]"),
            (DRIVES, "not: {all_of: [{travel: {at_most: 1 m}}, {travel: {at_least: 2 m}}]}"),
        ),
        (
            (DRIVES, "any_of: [{contact: {with: wall}}, {travel: {at_least: 10 cm}}]"),
            (DRIVES, "any_of: [{clearance: {at_least: 1 m}}, {clearance: {at_most: 1 cm}}]"),
            (DRIVES, "any_of: [{max_speed: {linear: 0.3}}, {travel: {at_most: 1 cm}}]"),
        ),
    ),
    "a formula that waits for a time alone": Kind(
        "unreachable-limit",
        (
            (DRIVES, "stl: eventually (time > 0.5 s)"),
            (DRIVES, "stl: always (x < 1 m) and eventually (time > 0.5 s)"),
            (DRIVES, "stl: eventually (time > 0.5 s and eventually (time > 1 s))"),
            (DRIVES, "stl: not always (time < 0.5 s)"),
        ),
        (
            (DRIVES, "stl: always (time > 0.5 s implies x > 5 cm)"),
            (DRIVES, "stl: eventually (time < 1 s and x > 10 cm)"),
            (DRIVES, "all_of: [{stl: always (time < 1 s)}, {travel: {at_least: 10 cm}}]"),
        ),
    ),
    "links that cannot meet": Kind(
        "nothing-to-touch",
        ((DRIVES, "self_collision"), (DRIVES, "all_of: [self_collision, upright]")),
        ((ARM, "self_collision"),),
    ),
    "a place that no run comes to in its time": Kind(
        "limit-beyond-range",
        (
            (DRIVES, "not: {final_pose: {x: 50}}"),
            (DRIVES, "any_of: [{reach: {x: 9, y: 0}}, {travel: {at_most: 1 m}}]"),
            (DRIVES, "final_pose: {x: 0.3, y: 0, tolerance: 9 m}"),
        ),
        (
            (DRIVES, "final_pose: {x: 0.3, y: 0, tolerance: 30 cm}"),
            (DRIVES, "not: {reach: {x: 1, y: 0}}"),
            (
                DRIVES.replace("burger", "burger, pose: {x: 90}").replace("x: 2}", "x: 92}"),
                "not: {final_pose: {x: 1, relative: true}}",
            ),
            (DRIVES, "any_of: [{reach: {x: 0.1, y: 0}}, {reach: {x: 1, y: 0}}]"),
            (GUARD, "all_of: [{not: {reach: {x: 1, y: 0}}}, {travel: {at_most: 1 cm}}]"),
        ),
    ),
    "a distance that no run drives in its time": Kind(
        "limit-beyond-range",
        (
            (DRIVES, "all_of: [{path_length: {at_most: 50 m}}, {travel: {at_least: 10 cm}}]"),
            (DRIVES, "stl: always (travel + abs(y) < 99 m)"),
            (DRIVES, "follow_path: {path: [{x: 0, y: 0}, {x: 0.001, y: 0}], max_error: 50 cm}"),
            (DRIVES, "max_speed: {linear: 50 m/s}"),
            (DRIVES, "not: {joint: {name: wheel_left_joint, at_least: 100000 deg}}"),
            (HUSKY, "travel: {at_most: 3 m}"),
        ),
        (
            (HUSKY, "travel: {at_most: 1.7 m}"),
            (DRIVES, "travel: {at_least: 10 cm, at_most: 50 m}"),
            (DRIVES, "stay_within: {x: [-100 m, 100 m], y: [-0.2, 0.2]}"),
            (DRIVES, "stl: always (x < 50 m and abs(y) < 30 cm)"),
            (world("disturbances: [{at: 0.3 s, for: 0.1 s, force: [0, 5, 0]}]"), "travel: {at_most: 50 m}"),
        ),
    ),
    "true before anything moved": Kind(
        "judged-once",
        (
            (DRIVES, "stl: eventually (x >= 0 m)"),
            (DRIVES, "stl: eventually (speed < 1 cm/s or x > 1 m)"),
            (DRIVES, "stl: (speed < 1 m/s) until (travel < 10 cm)"),
            (DRIVES, "stl: 'always[0 s, 0 s] (clearance > 10 cm)'"),
            (DRIVES, "stl: x < 10 cm"),
            (DRIVES, "not: {stl: always (x < -1 m)}"),
            (DRIVES, "any_of: [{stl: eventually (x >= -1 cm)}, {travel: {at_least: 5 m}}]"),
            (DRIVES, "assertion: moving.py:AtOnce"),
        ),
        (
            (DRIVES, "stl: eventually (x >= 10 cm)"),
            (DRIVES, "stl: eventually (x >= 0 m and speed > 10 cm/s)"),
            (DRIVES, "stl: 'eventually[0.2 s, 0.6 s] (x >= 0 m)'"),
            (DRIVES, "stl: always (x < 0.5 m)"),
            (DRIVES, "any_of: [{stl: always (x < -1 m)}, {travel: {at_least: 10 cm}}]"),
            (DRIVES, "assertion: moving.py:Later"),
        ),
    ),
    "an object that stays where it is": Kind(
        "object-never-moved",
        (
            (CRATE, "not: {object: {name: crate, reach: {x: 3, y: 1}}}"),
            (CRATE, "all_of: [{not: {object: {name: crate, reach: {x: 3, y: 1}}}}, upright]"),
            (CRATE.replace("x: 2", "x: 20"), "object: {name: crate, moved: {at_most: 1 cm}}"),
        ),
        (
            (CRATE, "object: {name: crate, moved: {at_most: 1 cm}}"),
            (CRATE, "any_of: [{object: {name: crate, reach: {x: 3, y: 1}}}, {travel: {at_least: 10 cm}}]"),
            (
                CRATE.replace("y: 1", "y: 0").replace("x: 2", "x: 0.3"),
                "not: {object: {name: crate, reach: {x: 3, y: 1}}}",
            ),
        ),
    ),
    "nothing drives the robot": Kind(
        "nothing-acts",
        (
            (SITS, "no_collision"),
            (SITS, "max_speed: {linear: 0.3}"),
            (SITS, "stl: always (speed < 0.3 m/s)"),
            (SITS, "stay_within: {x: [-1, 1]}"),
            (SITS, "stl: always (clearance > 10 cm)"),
            (SITS, "clearance: {at_least: 10 cm}"),
        ),
        (
            (SITS, "travel: {at_most: 1 cm}"),
            (SITS, "stl: always (speed < 1 cm/s)"),
            (SITS, "upright"),
            (SITS, "stl: always (tilt < 2 deg)"),
        ),
    ),
    "nothing in range within other checks": Kind(
        "nothing-in-range",
        (
            (BLIND, "all_of: [{sensor: {name: scan, reading: ranges, which: min, at_least: 50 cm}}, upright]"),
            (BLIND, "stl: always (scan.ranges.min > 50 cm)"),
            (BLIND, "all_of: [{all_of: [{sensor: {name: scan, reading: ranges, which: mean, at_least: 50 cm}}]}]"),
        ),
        (
            (SEEN, "all_of: [{sensor: {name: scan, reading: ranges, which: min, at_least: 50 cm}}, upright]"),
            (SEEN, "stl: always (scan.ranges.min > 50 cm)"),
        ),
    ),
    "nothing touched within other checks": Kind(
        "never-touched",
        (
            (DRIVES, "all_of: [{contact: {with: wall, at_most: 10 N}}, upright]"),
            (DRIVES, "stl: always (force(wall) < 10 N)"),
            (DRIVES, "all_of: [{stl: always (force(wall) < 10 N)}, upright]"),
            (BUMPER, "sensor: {name: bump, reading: force, at_most: 50 N}"),
            (DRIVES, "not: {contact: {with: wall, at_least: 5000 N}}"),
            (DRIVES, "all_of: [{not: {contact: {with: wall, impulse: {at_least: 5 N s}}}}, upright]"),
        ),
        (
            (DRIVES, "not: {contact: {with: wall}}"),
            (DRIVES, "not: {not: {not: {contact: {with: wall}}}}"),
            (DRIVES, "any_of: [{contact: {with: wall, at_least: 5 N}}, {travel: {at_least: 10 cm}}]"),
            (DRIVES.replace("x: 2", "x: 0.3"), "all_of: [{contact: {with: wall, at_most: 500 N}}, upright]"),
            (DRIVES.replace("x: 2", "x: 0.3"), "stl: always (force(wall) < 500 N)"),
            (BUMPER.replace("x: 2", "x: 0.3"), "sensor: {name: bump, reading: force, at_most: 500 N}"),
        ),
    ),
    "a robot that cannot drive": Kind(
        "never-moved",
        ((ICE, "upright"), (ICE, "clearance: {at_most: 2 m}"), (ICE, "any_of: [{travel: {at_least: 5 cm}}, upright]")),
        ((SLOW, "travel: {at_least: 0.5 mm}"), (SLOW, "all_of: [{path_length: {at_least: 0.5 mm}}, upright]")),
    ),
    "a controller that does nothing": Kind(
        "silent-controller",
        ((GUARD, "upright"), (GUARD, "max_speed: {linear: 0.3}"), (GUARD, "no_collision")),
        (
            (GUARD, "travel: {at_most: 1 cm}"),
            (GUARD, "max_speed: {linear: 1 cm/s}"),
            (GUARD, "stl: always (speed < 1 cm/s)"),
        ),
    ),
}


def in_turns(cases: Sequence[tuple[str, ...]]) -> list[Any]:
    """Return each case with an engine, in turns; with every engine under `--soak`."""
    engines = installed()
    every = [(*case, engine) for case in cases for engine in engines]
    return soaked(every, [(*case, engines[number % len(engines)]) for number, case in enumerate(cases)])


def golden(folder: Path, name: str, speed: float, end: float) -> None:
    """Write the golden file of a burger that drives straight on."""
    rows = "".join(f"{0.1 * i:.1f},{0.1 * i * speed:.3f},0.0,0.0,0.0\n" for i in range(int(end * 10) + 1))
    head = "# sim-action golden trajectory 1: turtlebot3_burger\ntime_s,x_m,y_m,z_m,yaw_rad\n"
    (folder / name).write_text(head + rows)


def rules(folder: Path, head: str, expect: str, engine: str, time_limit: float = 1.2) -> set[str]:
    """Return the rules that refuse a scenario, or that its run has findings of; "failed" if it did not pass."""
    golden(folder, "golden.csv", 0.19, 6.0)
    golden(folder, "short.csv", 0.19, 1.2)
    golden(folder, "rest.csv", 0.0, 1.2)
    (folder / "guard.py").write_text(SCRIPT)
    (folder / "moving.py").write_text(MOVING)
    text = f"name: a\nbackend: {engine}\n{head}expect:\n  - {expect}\ntime_limit: {time_limit} s\n"
    try:
        loaded = load(folder, text)
    except InvalidScenario as error:
        return {re.sub(r".*\[([a-z-]+)\]$", r"\1", problem.message) for problem in error.problems}
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    warned = {warning.rule for warning in loaded.warnings}
    return (
        warned
        | {finding.rule for finding in run.findings}
        | {"failed" for verdict in run.verdicts if not verdict.passed}
    )


@pytest.mark.parametrize(
    ("rule", "head", "expect", "engine"), in_turns([(kind.rule, *lie) for kind in KINDS.values() for lie in kind.lies])
)
def test_an_unearned_pass_has_a_finding(rule: str, head: str, expect: str, engine: str, tmp_path: Path) -> None:
    assert rule in rules(tmp_path, head, expect, engine)


@pytest.mark.parametrize(
    ("head", "expect", "engine"), in_turns([case for kind in KINDS.values() for case in kind.honest])
)
def test_an_honest_scenario_has_none(head: str, expect: str, engine: str, tmp_path: Path) -> None:
    assert rules(tmp_path, head, expect, engine) == set()


LIMITS_OF_RUNS: Final[Mapping[str, float]] = {
    "travel: {at_most: LIMIT m}": 1,
    "not: {travel: {at_least: LIMIT m}}": 1,
    "path_length: {at_most: LIMIT m}": 1,
    "stay_within: {x: [-LIMIT, LIMIT], y: [-LIMIT, LIMIT]}": 1,
    "not: {reach: {x: LIMIT m, y: 0}}": 1.02,
    "final_pose: {x: 0, y: 0, tolerance: LIMIT m}": 1,
    "follow_path: {path: [{x: 0, y: 0}, {x: 9000, y: 0}], max_error: LIMIT m, rms: LIMIT m}": 1,
    "matches: {trace: rest.csv, position: LIMIT m, duration: 9 s}": 1.1,
    "odometry_error: {position: LIMIT m}": 2,
    "stl: always (x < LIMIT m)": 1,
    "stl: always (travel < LIMIT m and abs(y) < LIMIT m)": 1,
    "object: {name: crate, moved: {at_most: LIMIT m}}": 1,
    "object: {name: crate, stay_within: {y: [-LIMIT, LIMIT]}}": 1,
    "not: {object: {name: crate, reach: {x: LIMIT m, y: 0}}}": 1.15,
    "joint: {name: wheel_left_joint, at_most: LIMIT rad}": 1 / 0.033,
    "joint_within: {position: {wheel_left_joint: [-LIMIT, LIMIT rad]}}": 1 / 0.033,
    "stl: always (position(wheel_left_joint) < LIMIT rad)": 1 / 0.033,
    "energy: {at_most: LIMIT J}": 2 * 10 * 100 / (1.5 * 3.3),
}
"""A limit -> the multiple of the distance of a robot that runs away which no run exceeds."""


@pytest.mark.parametrize(("expect", "engine"), in_turns([(expect,) for expect in LIMITS_OF_RUNS]))
@settings(
    max_examples=2,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    deadline=None,
)
@given(speed=st.floats(0.05, 0.3), time_limit=st.floats(0.3, 0.6), beyond=st.floats(1.3, 1000))
def test_a_limit_beyond_a_robot_that_runs_away_has_a_finding(
    expect: str, engine: str, tmp_path: Path, *, speed: float, time_limit: float, beyond: float
) -> None:
    far = 1.5 * 100 * 0.033 * time_limit * LIMITS_OF_RUNS[expect]
    head = PUSHES.replace("linear: 0.2", f"linear: {speed}") + "sensors: [odometry]\n"
    for share in (beyond, 0.9):
        asked = re.sub(r"LIMIT(?! )", f"{share * far}", expect).replace("LIMIT", f"{share * far}")
        findings = rules(tmp_path, head, asked, engine, time_limit)
        assert bool(findings & {"limit-beyond-range", "unreachable-limit"}) == (share > 1), (share, findings)
