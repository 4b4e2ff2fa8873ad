"""Mistakes in scenario files, one at a time, and the place and the words in which an editor should report them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SCENARIO: Final = """\
version: 1
name: burger delivers a parcel
tags: [nightly]
robot:
  model: turtlebot3_burger
  base: free
  pose: {x: 0, y: 1 m, yaw: 90 deg}
  joints: {wheel_left_joint: 10 deg}
  drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint], acceleration: 1.0}}
world:
  gravity: 9.81
  ground: {friction: 0.8}
  objects:
    - {name: wall, box: [0.1, 2.0, 50 cm], pose: {x: 3.0}}
    - {name: ball, sphere: {radius: 5 cm}, mass: 200 g}
  disturbances:
    - {at: 2 s, for: 100 ms, body: ball, force: [1 N, 0, 0]}
physics: {rate: 240 Hz}
commands:
  rate: 10 Hz
  twist:
    - {linear: 0.5, for: 4 s}
    - {linear: 0.2 m/s, angular: 30 deg/s}
sensors:
  - lidar: {rays: 360, range: 3.5 m}
    name: scan
    rate: 5 Hz
  - imu
expect:
  - travel: {at_least: 1.5 m}
    before: 10 s
    severity: warning
  - no_collision
  - upright: {max_tilt: 10 deg}
    name: it stays upright
  - stops_before: {body: wall, gap: [5 cm, 50 cm]}
  - any_of:
      - reach: {x: 1, y: 1, tolerance: 10 cm}
      - not: {max_speed: {linear: 1 m/s}}
  - stl: always (speed < 1 m/s)
time_limit: 30 s
wall_limit: 2 min
memory_limit: 2 GB
backend: auto
seed: 7
trace: {rate: 20 Hz}
"""


@dataclass(frozen=True, slots=True)
class Typo:
    """A mistake."""

    right: str  # right, wrong: the text of the scenario that it replaces, and the replacement
    wrong: str
    message: str  # a part of the message of yaml-language-server; empty if JSON Schema cannot find the mistake
    at: str = ""  # a text on the line of the message; the default is `wrong`

    @property
    def text(self) -> str:
        """The scenario with the mistake."""
        assert SCENARIO.count(self.right) == 1, self.right
        return SCENARIO.replace(self.right, self.wrong)

    @property
    def line(self) -> int:
        """The number of the line of the message, from 1."""
        return next(
            number for number, line in enumerate(self.text.splitlines(), 1) if (self.at or self.wrong.strip()) in line
        )


def _unknown(key: str) -> str:
    return f"Property {key} is not allowed"


def _text_such_as(example: str) -> str:
    return f"number, or text such as {example}"


_NUMBER: Final = 'Incorrect type. Expected "number'

TYPOS: Final = (
    # Wrong keys.
    Typo("time_limit: 30 s", "timelimit: 30 s", _unknown("timelimit")),
    Typo("  model: turtlebot3_burger", "  modle: turtlebot3_burger", _unknown("modle")),
    Typo("at_least: 1.5 m", "at_lest: 1.5 m", _unknown("at_lest")),
    Typo("    before: 10 s", "    befor: 10 s", _unknown("befor")),
    Typo("max_tilt: 10 deg", "tilt: 10 deg", _unknown("tilt")),
    Typo("friction: 0.8", "frction: 0.8", _unknown("frction")),
    Typo("radius: 5 cm", "raduis: 5 cm", _unknown("raduis")),
    Typo("{linear: 0.5, for: 4 s}", "{liner: 0.5, for: 4 s}", _unknown("liner")),
    Typo("yaw: 90 deg", "jaw: 90 deg", _unknown("jaw")),
    Typo("rays: 360", "ray: 360", _unknown("ray")),
    Typo("acceleration: 1.0", "accelleration: 1.0", _unknown("accelleration")),
    Typo("trace: {rate: 20 Hz}", "trace: {freq: 20 Hz}", _unknown("freq")),
    Typo("sensors:\n", "sensor:\n", _unknown("sensor")),
    # Unknown names of assertions, sensors, command sources and drives.
    Typo("- travel:", "- travell:", _unknown("travell")),
    Typo("- no_collision", "- no_colision", "Valid values:"),
    Typo("      - reach:", "      - reaches:", _unknown("reaches")),
    Typo("not: {max_speed:", "not: {maxspeed:", _unknown("maxspeed")),
    Typo("  - imu", "  - gyroscope", "Valid values:"),
    Typo("- lidar:", "- laser:", _unknown("laser")),
    Typo("  twist:", "  twists:", _unknown("twists")),
    Typo("drive: {diff:", "drive: {differential:", _unknown("differential")),
    # Misplaced keys.
    Typo("{at_least: 1.5 m}\n    before: 10 s", "{at_least: 1.5 m, before: 10 s}", _unknown("before")),
    Typo("wall_limit: 2 min", "max_tilt: 9 deg", _unknown("max_tilt")),
    Typo("  base: free", "  gravity: 9.8", _unknown("gravity")),
    Typo("seed: 7\n", "rate: 20 Hz\n", _unknown("rate"), "rate: 20 Hz"),
    Typo("tolerance: 10 cm}", "tolerance: 10 cm}\n        before: 3 s", _unknown("before"), "before: 3 s"),
    # Two kinds in one map, or none.
    Typo("    before: 10 s", "    no_collision: {}", _unknown("no_collision")),
    Typo("  rate: 10 Hz", "  script: drive.py", _unknown("script")),
    Typo("    name: scan", "    imu: {}", _unknown("imu")),
    Typo("acceleration: 1.0}}", "acceleration: 1.0}, mecanum: {}}", _unknown("mecanum")),
    Typo("  - no_collision", "  - name: nothing", 'Missing property "travel"'),
    # Wrong units.
    Typo("at_least: 1.5 m", "at_least: 1.5 kg", _text_such_as("20 m")),
    Typo("time_limit: 30 s", "time_limit: 30 sec", _text_such_as("20 s")),
    Typo("max_tilt: 10 deg", "max_tilt: 10 degrees", _text_such_as("90 deg")),
    Typo("gap: [5 cm, 50 cm]", "gap: [5 cm, 50 inch]", _text_such_as("20 m")),
    Typo("mass: 200 g", "mass: 200 N", _text_such_as("20 kg")),
    Typo("memory_limit: 2 GB", "memory_limit: 2 gigabytes", _text_such_as("2 GB")),
    Typo("{wheel_left_joint: 10 deg}", "{wheel_left_joint: 10 N}", _text_such_as("90 deg")),
    # Wrong types, and text for a number.
    Typo("at_least: 1.5 m", "at_least: far", _text_such_as("20 m")),
    Typo("gravity: 9.81", "gravity: true", _NUMBER),
    Typo("before: 10 s", "before: [10 s]", _NUMBER),
    Typo("seed: 7", "seed: seven", 'Expected "integer"'),
    Typo("tags: [nightly]", "tags: nightly", 'Expected "array"'),
    Typo("rays: 360", "rays: 360.5", 'Expected "integer"'),
    Typo("name: burger delivers a parcel", "name: 5", 'Expected "string"'),
    Typo("- stl: always (speed < 1 m/s)", "- stl: [speed]", "Expected"),
    # Values out of range.
    Typo("time_limit: 30 s", "time_limit: -30", "Value is below the exclusive minimum of 0"),
    Typo("wall_limit: 2 min", "wall_limit: -2 min", _text_such_as("20 s")),
    Typo("before: 10 s", "before: 0 s", _text_such_as("20 s")),
    Typo("seed: 7", "seed: -7", "Value is below the minimum of 0"),
    # Wrong words of a fixed set.
    Typo("severity: warning", "severity: warn", 'Valid values: "error", "warning"'),
    Typo("backend: auto", "backend: bullet", 'Valid values: "auto", "pybullet", "mujoco"'),
    Typo("base: free", "base: static", 'Valid values: "free", "fixed"'),
    Typo("version: 1", "version: 2", "Value must be 1"),
    # Missing keys.
    Typo("time_limit: 30 s\n", "", 'Missing property "time_limit"', "version: 1"),
    Typo("name: burger delivers a parcel\n", "", 'Missing property "name"', "version: 1"),
    Typo("{x: 1, y: 1, tolerance: 10 cm}", "{x: 1, tolerance: 10 cm}", 'Missing property "y"'),
    # Mistakes that JSON Schema cannot find: the loader does.
    Typo("stl: always (speed < 1 m/s)", "stl: allways (speed < 1 m/s)", ""),
    Typo("body: wall", "body: wal", ""),
    Typo("{wheel_left_joint: 10 deg}", "{wheel_leftjoint: 10 deg}", ""),
    Typo("memory_limit: 2 GB", "memory_limit: 2 MB", ""),
)
