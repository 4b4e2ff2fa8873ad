"""What is told of a world in which something moves or is disturbed, and cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenarios import load, told

HEAD = "name: s\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 10 s\nworld:\n"
OBJECTS = """\
  objects:
    - {name: ball, sphere: {radius: 5 cm}, mass: 1 kg, pose: {x: 2}}
    - {name: wall, box: [1, 1, 1], pose: {x: 3}}
    - {name: stone, sphere: {radius: 5 cm}, mass: 1 kg, pose: {x: 4}, appears: 3 s}
"""


def moving(points: str, more: str = "") -> str:
    return f"{HEAD}  objects:\n    - {{name: gate, box: [1, 1, 1], path: [{points}]{more}}}\n"


def disturbed(keys: str) -> str:
    return f"{HEAD}{OBJECTS}  disturbances:\n    - {{{keys}}}\n"


def test_what_can_be_is_let_through(tmp_path: Path) -> None:
    assert load(tmp_path, moving("{at: 0, x: 2}, {at: 1 s, x: 5}, {at: 20 s, x: 2}", ", loop: true"))
    assert load(tmp_path, moving("{at: 0}, {at: 6 ms, z: 1}"))
    for keys in (
        "at: 9.9 s, for: 0.1 s, force: [1, 0, 0]",
        "at: 1, for: 9 s, link: wheel_left_link, torque: [1, 0, 0]",
        "at: 0, velocity: [1, 0, 0], link: base_footprint",
        "at: 3 s, velocity: [1, 0, 0], body: stone",
        "at: 3 s, velocity: [200, 0, 0], body: stone",
        "at: 3 s, adhesion: 5 N, link: wheel_left_link",
        "at: 0, adhesion: 5 N, body: wall, for: 2 s",
    ):
        assert load(tmp_path, disturbed(keys)).scenario.world.disturbances


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (
            "{at: 1 s, x: 2}, {at: 1 s, x: 5}",
            (
                "world.objects.0.path.1.at: must be later than the point before it, at 1 s; "
                "a body cannot be at two places at the same time"
            ),
        ),
        (
            "{at: 0}, {at: 10 ms, x: 5}",
            (
                "world.objects.0.path.1: 5 m from 0 s on is 500 m/s, more than physics.max_speed, 100 m/s; "
                "it needs 0.05 s at least"
            ),
        ),
        (
            "{at: 0}, {at: 10 ms, yaw: 3600 deg}",
            (
                "world.objects.0.path.1: 3600 deg from 0 s on is 3.6e+05 deg/s, more than physics.max_turn_rate, "
                "5.73e+04 deg/s; it needs 0.063 s at least"
            ),
        ),
        (
            # It stands on the ground, with its middle at 0.5 m.
            "{at: 0}, {at: 10 ms, z: 2}",
            (
                "world.objects.0.path.1: 1.5 m from 0 s on is 150 m/s, more than physics.max_speed, 100 m/s; "
                "it needs 0.015 s at least"
            ),
        ),
        (
            "{at: 10 s}, {at: 11 s, x: 5}",
            "world.objects.0.path.0.at: 10 s is not earlier than time_limit (10 s): the body never moves",
        ),
        (
            "{at: 0}, {at: 10 s, x: 5}, {at: 12 s, x: 0}",
            "world.objects.0.path.2.at: the run ends before the body gets there: time_limit is 10 s",
        ),
    ],
)
def test_motions_that_cannot_be(points: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, moving(points))
    assert found.split(": ", 1)[1] == problem
    assert found.startswith("7:")


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("surface_velocity: {linear: 0.5}", "surface_velocity.linear: expected"),
        ("surface_velocity: {angular: 1 m/s}", "'m/s' is not a unit of angular speed"),
        ("surface_velocity: {speed: 1}", "surface_velocity.speed: unknown key"),
        ("surface_velocity: {angular: 1}, mass: 1", "'surface_velocity' is of an object that is fixed"),
    ],
)
def test_belts_that_cannot_be(keys: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{HEAD}  objects:\n    - {{name: belt, box: [1, 1, 1], {keys}}}\n")
    assert problem in found
    assert found.startswith("7:")


def test_a_body_appears_before_the_end(tmp_path: Path) -> None:
    text = f"{HEAD}  objects:\n    - {{name: gate, box: [1, 1, 1], appears: 10 s}}\n"
    (found,) = told(tmp_path, text)
    assert found == "7:36: world.objects.0.appears: 10 s is not earlier than time_limit (10 s)"


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("at: 10 s, velocity: [1, 0, 0]", "at: 10 s is not earlier than time_limit (10 s)"),
        ("at: 9 s, for: 2 s, force: [1, 0, 0]", "for: it acts until 11 s, but the run ends at time_limit (10 s)"),
        (
            "at: 1, for: 1, link: base_foot, force: [1, 0, 0]",
            "link: the robot has no link 'base_foot'; did you mean 'base_footprint'?",
        ),
        ("at: 1, for: 1, link: ball, force: [1, 0, 0]", "link: the robot has no link 'ball'; say body: ball"),
        ("at: 1, for: 1, body: base_scan, force: [1, 0, 0]", "body: there is no body 'base_scan'; say link: base_scan"),
        ("at: 1, for: 1, body: bal, force: [1, 0, 0]", "body: there is no body 'bal'; did you mean 'ball'?"),
        (
            "at: 1, for: 1, body: wall, force: [1, 0, 0]",
            "body: body 'wall' is fixed whatever acts on it; only one with a 'mass' can be disturbed",
        ),
        ("at: 1, for: 1, body: stone, force: [1, 0, 0]", "at: body 'stone' is not there before it appears, at 3 s"),
        (
            "at: 1, adhesion: 5 N, link: imu_link",
            "link: the robot has no link 'imu_link' with a collision shape, so nothing touches it",
        ),
        ("at: 1, adhesion: 5 kg, link: base_link", "adhesion: 'kg' is not a unit of force"),
        ("at: 1, adhesion: 5 N, body: stone", "at: body 'stone' is not there before it appears, at 3 s"),
        ("at: 1, velocity: [80, 80, 0]", "velocity: a push of 113.1 m/s is more than physics.max_speed, 100 m/s"),
        ("at: 1, velocity: [0, 0, 1e5]", "velocity.2: must be at most 10,000 m/s, found 100000.0"),
        ("at: 1, for: 1, force: [-1e11, 0, 0]", "force.0: must be at least -10,000,000,000 N, found -100000000000.0"),
        ("at: 1, for: 1, torque: [0, 1e300, 0]", "torque.1: must be at most 10,000,000,000 N m, found 1e+300"),
        (
            "at: 1, for: 1, force: [1, 0, 0], point: [0, 0, 1000 km]",
            "point.2: must be at most 100,000 m, found '1000 km'",
        ),
        (
            "at: 1, link: wheel_left_link, velocity: [1, 0, 0]",
            (
                "link: a push of 'velocity' moves the robot as a whole; name its base link 'base_footprint', or "
                "give this one a 'force' for a short time"
            ),
        ),
    ],
)
def test_disturbances_that_cannot_be(keys: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, disturbed(keys))
    assert found.split(": ", 1)[1].startswith(f"world.disturbances.0.{problem}")


def test_nothing_moves_what_is_bolted(tmp_path: Path) -> None:
    text = disturbed("at: 1, for: 1, force: [1, 0, 0]").replace("burger}", "burger, base: fixed}")
    text += "allow: [fixed-base]\n"
    (found,) = told(tmp_path, text)
    assert found.endswith("link 'base_footprint' is fixed to the world, so nothing moves it")
    wheel = text.replace("for: 1,", "for: 1, link: wheel_left_link,")
    assert load(tmp_path, wheel)
    (found,) = told(tmp_path, wheel.replace("for: 1, ", "").replace("force", "velocity"))
    assert found.endswith("moves the robot as a whole; give the link a 'force' for a short time")
