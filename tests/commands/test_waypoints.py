from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sim_action.commands import ClosedLoop
from sim_action.commands.waypoints import (
    Leg,
    PathFollower,
    Point,
    Waypoint,
    WaypointCommands,
    braking_speed,
    curvature_to,
    in_robot_frame,
    turn_angles,
)
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.robot.model.kinematics import Mobility
from tests.scenarios import load, told
from tests.traces import HERE, START, scene

SCENARIO = """\
name: waypoints
robot: {{model: turtlebot3_burger}}
commands:
  waypoints: {waypoints}
  {figures}
expect: [upright]
time_limit: 1 s
"""


def spec(*points: tuple[float, float], **figures: Any) -> WaypointCommands:
    return WaypointCommands.model_validate({"waypoints": tuple({"x": x, "y": y} for x, y in points), **figures})


def first(commands: WaypointCommands, mobility: Mobility) -> Twist:
    controller = commands.open(dataclasses.replace(scene(), mobility=mobility))
    assert isinstance(controller, ClosedLoop)
    twist = controller.command(START)
    assert isinstance(twist, Twist)
    return twist


def test_figures_may_have_units_and_may_be_left_out(tmp_path: Path) -> None:
    text = SCENARIO.format(waypoints="[{x: 1, y: 0}, {x: 100 cm, y: 1}]", figures="lookahead: 25 cm")
    (source,) = load(tmp_path, text).scenario.commands
    assert source == spec((1.0, 0.0), (1.0, 1.0), lookahead=0.25)
    assert source.rate == 20.0


@pytest.mark.parametrize(
    ("waypoints", "figures", "message"),
    [
        ("[]", "", "4:3: commands.waypoints: must not be empty"),
        ("[{x: 1}]", "", "4:15: commands.waypoints.0.y: the key 'y' is missing"),
        ("[{x: 1, y: 2, z: 3}]", "", "waypoints.0.z: unknown key"),
        ("[{x: 1, y: .inf}]", "", "expected a finite length such as '1 m'"),
        ("[{x: 1, y: 1e7}]", "", "waypoints.0.y: must be at most 1,000,000 m"),
        ("[[1, 2]]", "", "waypoints.0: expected a map of keys"),
        ("[{x: 1, y: 2}, {x: 3, y: 2}, {x: 300 cm, y: 2}]", "", "waypoints.2: this is the same point as the one befor"),
        ("[{x: 1, y: 2}]", "lookahead: 0 m", "lookahead: must be greater than 0"),
        ("[{x: 1, y: 2}]", "lookahead: 4 cm", "lookahead: must not be less than tolerance (0.05 m)"),
        ("[{x: 1, y: 2}]", "tolerance: 0", "tolerance: must be greater than 0"),
        ("[{x: 1, y: 2}]", "speed: -1 m/s", "speed: must be greater than 0"),
        ("[{x: 1, y: 2}]", "speed: .nan", "expected a finite speed"),
        ("[{x: 1, y: 2}]", "max_turn_rate: 0", "max_turn_rate: must be greater than 0"),
        (
            "[{x: 1, y: 2}]",
            "speed: 2 m/s",
            (
                "speed: between two ticks the robot would drive 0.1 m, which is more than the tolerance of 0.05 m; "
                "set a rate"
            ),
        ),
        ("[{x: 1, y: 2}]", "speed: 1e300", "more than the tolerance of 0.05 m; set a larger tolerance"),
        ("[{x: 1, y: 2}]", "tolerance: 1e-320", "more than the tolerance of 1e-320 m; set a larger tolerance"),
    ],
)
def test_a_path_to_nowhere_is_told_at_its_place(waypoints: str, figures: str, message: str, tmp_path: Path) -> None:
    (problem,) = told(tmp_path, SCENARIO.format(waypoints=waypoints, figures=figures))
    assert message in problem


def test_a_path_may_come_back_to_where_it_was() -> None:
    assert list(spec((1.0, 0.0), (0.0, 1.0), (1.0, 0.0)).problems(HERE)) == []


def test_a_robot_without_wheels_cannot_follow_it(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(
        '<robot name="box"><link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>'
    )
    text = SCENARIO.format(waypoints="[{x: 1, y: 0}]", figures="").replace("turtlebot3_burger", "box.urdf")
    (problem,) = told(tmp_path, text)
    assert "it is not plain from 'box' which joints are wheels" in problem


def test_it_drives_as_the_figures_say() -> None:
    ahead = spec((2.0, 0.0), speed=0.4)
    assert first(ahead, Mobility()) == Twist.planar(0.4)
    assert first(spec((-2.0, 0.1), max_turn_rate=0.7), Mobility()) == Twist.planar(0.0, 0.7)
    assert first(spec((-2.0, 0.1)), Mobility(tightest=1.0)) == Twist.planar(0.2, 0.2 * 0.99)
    to_the_left = first(spec((0.0, 2.0)), Mobility(heading=math.pi / 2))
    assert to_the_left.linear_xyz[0] == 0.2
    assert to_the_left.angular_xyz[2] == pytest.approx(0.0)
    assert WaypointCommands.needs_drive
    assert not WaypointCommands.runs_user_code


EAST = Leg((1.0, 2.0), (5.0, 2.0))
lengths = st.floats(-10, 10)
points = st.tuples(lengths, lengths)
legs = st.builds(Leg, points, points)
lookaheads = st.floats(0.05, 5)


@pytest.mark.parametrize(
    ("point", "closest"),
    [((3.0, 4.0), (3.0, 2.0)), ((0.0, 2.5), (1.0, 2.0)), ((9.0, 9.0), (5.0, 2.0)), ((2.0, 2.0), (2.0, 2.0))],
    ids=["beside it", "before its start", "beyond its end", "on it"],
)
def test_the_closest_point(point: Point, closest: Point) -> None:
    assert EAST.closest(point) == pytest.approx(closest)


@given(legs, points, st.floats(0, 1))
def test_no_point_of_the_leg_is_closer(leg: Leg, point: Point, share: float) -> None:
    (x, y), (end_x, end_y) = leg.start, leg.end
    other = (x + share * (end_x - x), y + share * (end_y - y))
    assert math.dist(point, leg.closest(point)) <= math.dist(point, other) + 1e-9


@pytest.mark.parametrize(
    ("point", "lookahead", "target"),
    [
        # 3, 4, 5
        ((2.0, 2.3), 0.5, (2.4, 2.0)),
        ((2.0, 1.7), 0.5, (2.4, 2.0)),
        ((2.0, 2.0), 0.5, (2.5, 2.0)),
        ((1.0 - 0.4, 2.0), 0.5, (1.1, 2.0)),
        ((2.0, 3.0), 0.5, (2.0, 2.0)),
        ((0.0, 2.0), 0.5, (1.0, 2.0)),
        ((4.8, 2.0), 0.5, (5.0, 2.0)),
        ((6.0, 2.0), 5.0, (5.0, 2.0)),
    ],
    ids=["left", "right", "on it", "before it", "far beside it", "far before it", "near its end", "beyond its end"],
)
def test_the_lookahead_point(point: Point, lookahead: float, target: Point) -> None:
    assert EAST.lookahead_point(point, lookahead) == pytest.approx(target)


@given(legs, points, lookaheads)
def test_the_lookahead_point_is_on_the_leg_from_the_closest_one_on(leg: Leg, point: Point, lookahead: float) -> None:
    target, closest = leg.lookahead_point(point, lookahead), leg.closest(point)
    assert math.dist(leg.closest(target), target) < 1e-7
    assert math.dist(leg.start, target) >= math.dist(leg.start, closest) - 1e-9
    away = math.dist(point, target)
    # Where it is not one lookahead away, the whole leg is nearer, or all of it further.
    if away < lookahead - 1e-6:
        assert target == leg.end
    elif away > lookahead + 1e-6:
        assert target == closest


@given(points, points, lookaheads)
def test_a_leg_of_no_length_is_a_point(end: Point, point: Point, lookahead: float) -> None:
    leg = Leg(end, end)
    assert leg.closest(point) == leg.lookahead_point(point, lookahead) == end


def test_points_turns_and_braking() -> None:
    assert in_robot_frame((1.0, 1.0), math.pi / 2, (0.0, 4.0)) == pytest.approx((3.0, 1.0))
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, -1.0), (0.0, 0.0), (0.5, 0.5)]
    path = [Leg(*ends) for ends in pairwise(corners)]
    assert [math.degrees(turn) for turn in turn_angles(path)] == pytest.approx([90.0, 135.0, 90.0])
    back = [Leg((0.0, 0.0), (-1.0, 0.1)), Leg((-1.0, 0.1), (-2.0, 0.0))]
    assert turn_angles(back) == pytest.approx([2 * math.atan(0.1)])
    # 1 m/s^2 for 2 s: 2 m.
    assert braking_speed(2.0, 1.0) == 2.0
    assert braking_speed(0.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("ahead", "left", "before_axle", "curvature"),
    [
        (1.0, 0.0, 0.0, 0.0),
        # A quarter of a circle of 2 m.
        (2.0, 2.0, 0.0, 0.5),
        (2.0, -2.0, 0.0, -0.5),
        # Half a circle of 2 m.
        (0.0, 4.0, 0.0, 0.5),
        # Its centre is 4 m to the left of an axle that is 3 m behind: 5 m away, as it is from (2, 4).
        (2.0, 4.0, 3.0, 0.25),
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_the_curvature_of_the_arc_to_a_point(ahead: float, left: float, before_axle: float, curvature: float) -> None:
    assert curvature_to(ahead, left, before_axle) == pytest.approx(curvature)


@given(st.floats(0.01, 5), lengths, st.floats(0, 1))
def test_both_ends_of_an_arc_are_as_far_from_its_centre(ahead: float, left: float, before_axle: float) -> None:
    curvature = curvature_to(ahead, left, before_axle)
    assert math.copysign(1, curvature) == math.copysign(1, left)
    assume(abs(curvature) > 1e-3)
    centre = (-before_axle, 1 / curvature)
    assert math.dist(centre, (0.0, 0.0)) == pytest.approx(math.dist(centre, (ahead, left)))


PURSUIT = WaypointCommands.model_construct(waypoints=(), speed=0.5, lookahead=0.3, tolerance=0.05, max_turn_rate=2.0)
SPOT = Mobility(acceleration=1.0, turn_acceleration=5.0)
CAR = Mobility(tightest=2.0, acceleration=1.0)
TICK, SUBSTEPS = 0.05, 5


@dataclass
class Robot:
    """A unicycle whose axle is at (x, y): speed and turning rate ramp to what is asked for; a car keeps its curve."""

    mobility: Mobility
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    speed: float = 0.0
    turn: float = 0.0

    @property
    def origin(self) -> Point:
        towards = self.yaw + self.mobility.heading
        return (self.x + self.mobility.ahead * math.cos(towards), self.y + self.mobility.ahead * math.sin(towards))

    @property
    def pose(self) -> Pose:
        return Pose((*self.origin, 0.1), quaternion_from_rpy(0.0, 0.0, self.yaw))

    def drive(self, twist: Twist) -> None:
        speed, turn = twist.linear_xyz[0], twist.angular_xyz[2]
        assert twist == Twist.planar(speed, turn)
        step = TICK / SUBSTEPS
        for _ in range(SUBSTEPS):
            self.speed = ramped(self.speed, speed, self.mobility.acceleration * step)
            if self.mobility.turns_in_place:
                self.turn = ramped(self.turn, turn, self.mobility.turn_acceleration * step)
            elif speed:
                assert abs(turn / speed) <= self.mobility.tightest
                self.turn = self.speed * turn / speed
            else:
                self.turn = 0.0
            towards = self.yaw + self.mobility.heading + self.turn * step / 2
            self.x += self.speed * step * math.cos(towards)
            self.y += self.speed * step * math.sin(towards)
            self.yaw += self.turn * step


def ramped(now: float, wanted: float, most: float) -> float:
    return now + max(-most, min(most, wanted - now))


def through(points: Sequence[Point], pursuit: WaypointCommands) -> WaypointCommands:
    return pursuit.model_copy(update={"waypoints": tuple(Waypoint(x=x, y=y) for x, y in points)})


def driven(
    robot: Robot, waypoints: Sequence[Point], pursuit: WaypointCommands, seconds: float
) -> Iterator[tuple[Point, Twist]]:
    """Where the robot is at each tick, and what it is told, until it is told to stand still and does."""
    follower = PathFollower(through(waypoints, pursuit), robot.mobility)
    for tick in range(round(seconds / TICK)):
        twist = follower.command(dataclasses.replace(START, time=tick * TICK, pose=robot.pose))
        yield robot.origin, twist
        robot.drive(twist)
        if twist == Twist() and robot.speed == robot.turn == 0:
            yield robot.origin, twist
            return


def length(start: Point, waypoints: Sequence[Point]) -> float:
    return sum(math.dist(*ends) for ends in zip((start, *waypoints), waypoints, strict=False))


def passed_in_order(places: Sequence[Point], waypoints: Sequence[Point], within: float) -> bool:
    waiting = list(waypoints)
    for place in places:
        while waiting and math.dist(place, waiting[0]) <= within:
            del waiting[0]
    return not waiting


coordinates = st.floats(-3, 3)
anywhere = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=5)
angles = st.floats(-math.pi, math.pi)
mobilities = st.builds(
    Mobility,
    heading=st.sampled_from([0.0, math.pi / 2]),
    acceleration=st.floats(0.5, 3),
    turn_acceleration=st.floats(2, 10),
)


@settings(deadline=None)
@given(anywhere, angles, mobilities)
def test_who_turns_in_place_passes_any_waypoints(waypoints: list[Point], yaw: float, mobility: Mobility) -> None:
    robot = Robot(mobility, yaw=yaw)
    seconds = 3 * length(robot.origin, waypoints) / PURSUIT.speed + 10 * (len(waypoints) + 1)
    places = [place for place, _ in driven(robot, waypoints, PURSUIT, seconds)]
    assert passed_in_order(places, waypoints, PURSUIT.tolerance)
    assert math.dist(places[-1], waypoints[-1]) <= PURSUIT.tolerance
    assert robot.speed == robot.turn == 0


@settings(deadline=None)
@given(anywhere, angles, st.floats(-0.15, 0.3))
def test_it_comes_to_an_end_wherever_its_axle_is(waypoints: list[Point], yaw: float, ahead: float) -> None:
    """To a point between its origin and its axle, no way leads that it could drive."""
    robot = Robot(dataclasses.replace(SPOT, ahead=ahead), yaw=yaw)
    seconds = 3 * length(robot.origin, waypoints) / PURSUIT.speed + 20 * (len(waypoints) + 1)
    *_, (place, twist) = driven(robot, waypoints, PURSUIT, seconds)
    assert twist == Twist()
    assert math.dist(place, waypoints[-1]) <= PURSUIT.tolerance + 2 * abs(ahead)


@st.composite
def roads(draw: st.DrawFn) -> list[Point]:
    """Waypoints 2 m apart or more, between which a road turns by 90 deg or less; it begins along x."""
    x = y = towards = 0.0
    points = []
    for turn, far in draw(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(2, 4)), min_size=1, max_size=5)):
        towards += turn
        x, y = x + far * math.cos(towards), y + far * math.sin(towards)
        points.append((x, y))
    return points


@settings(deadline=None)
@given(roads(), st.floats(-0.2, 0.4))
def test_a_car_cuts_corners_and_rests_at_the_end(waypoints: list[Point], ahead: float) -> None:
    robot = Robot(dataclasses.replace(CAR, ahead=ahead))
    seconds = 2 * length(robot.origin, waypoints) / PURSUIT.speed + 20
    places = [place for place, _ in driven(robot, waypoints, PURSUIT, seconds)]
    assert passed_in_order(places, waypoints[:-1], CAR.turning_radius)
    # The origin of a car that trails its axle is still off the last straight line when the axle is on it.
    assert math.dist(places[-1], waypoints[-1]) <= PURSUIT.tolerance + max(0.0, -ahead)
    assert robot.speed == 0


@settings(deadline=None)
@given(anywhere, angles)
def test_a_car_never_circles_for_ever(waypoints: list[Point], yaw: float) -> None:
    robot = Robot(CAR, yaw=yaw)
    around = math.tau * CAR.turning_radius
    seconds = 10 + (3 * length(robot.origin, waypoints) + 3 * around * len(waypoints)) / 0.4
    *_, (place, twist) = driven(robot, waypoints, PURSUIT, seconds)
    assert twist == Twist()
    to_stand_still = PURSUIT.speed * TICK + PURSUIT.speed**2 / (2 * CAR.acceleration)
    assert math.dist(place, waypoints[-1]) <= CAR.turning_radius + to_stand_still


def test_it_turns_in_place_to_a_path_that_is_behind_it_and_then_drives() -> None:
    robot = Robot(SPOT, yaw=3.0)
    twists = [twist for _, twist in driven(robot, [(2.0, 0.0)], PURSUIT, 60)]
    turning = [twist for twist in twists if twist.linear_xyz[0] == 0 and twist.angular_xyz[2] != 0]
    assert twists[: len(turning)] == turning
    assert all(-PURSUIT.max_turn_rate <= twist.angular_xyz[2] < 0 for twist in turning)
    first = twists[len(turning)]
    assert abs(first.angular_xyz[2] / first.linear_xyz[0]) < 2 * math.sin(math.radians(3)) / PURSUIT.lookahead
    assert abs(robot.yaw) < math.radians(1)


def test_a_car_takes_the_arc_to_its_path() -> None:
    (_, twist), *_ = driven(Robot(CAR), [(-2.0, 0.5)], PURSUIT, 1)
    speed, turn = twist.linear_xyz[0], twist.angular_xyz[2]
    assert speed > 0
    assert turn / speed == pytest.approx(CAR.tightest, rel=0.02)
    # The base link is 0.5 m before the axle; the centre is on the line of that, as far from both ends of the arc.
    (_, twist), *_ = driven(Robot(dataclasses.replace(CAR, ahead=0.5), x=-0.5), [(0.2, 0.1)], PURSUIT, 1)
    centre = (-0.5, twist.linear_xyz[0] / twist.angular_xyz[2])
    assert math.dist(centre, (0.0, 0.0)) == pytest.approx(math.dist(centre, (0.2, 0.1)))


def test_it_keeps_its_speed_and_turns_no_faster_than_it_may() -> None:
    seen = list(driven(Robot(SPOT), [(2.0, 0.0), (3.0, 0.5), (4.0, 0.5)], PURSUIT, 60))
    amid = [(place, twist) for place, twist in seen if 0.5 < place[0] < 1.5]
    assert all(twist == Twist.planar(PURSUIT.speed) and place[1] == 0 for place, twist in amid)
    slow = PURSUIT.model_copy(update={"max_turn_rate": 0.5})
    seen = list(driven(Robot(SPOT, yaw=0.7), [(1.0, 0.0), (2.0, 0.9)], slow, 60))
    rates = [abs(twist.angular_xyz[2]) for _, twist in seen]
    assert 0.45 < max(rates) <= 0.5 + 1e-12


def test_it_slows_down_to_turn_on_the_spot_but_not_for_a_bend() -> None:
    fast = PURSUIT.model_copy(update={"speed": 1.0})

    def to_corner_and_on(waypoint: Point) -> list[tuple[Point, Twist]]:
        return list(driven(Robot(SPOT), [(2.0, 0.0), waypoint], fast, 60))

    bend, corner = to_corner_and_on((4.0, 0.5)), to_corner_and_on((2.0, 2.0))
    assert min(twist.linear_xyz[0] for place, twist in bend if 1.9 < place[0] < 2.1) > 0.5
    assert max(place[0] for place, _ in corner) < 2.0 + PURSUIT.tolerance


def test_where_it_brakes_and_stops() -> None:
    """From 1 m/s at 0.5 m/s^2: 1 m before the end."""
    fast = PURSUIT.model_copy(update={"speed": 1.0})
    seen = list(driven(Robot(SPOT), [(1.5, 0.0), (3.0, 0.0)], fast, 60))
    braking = next(place[0] for place, twist in seen if place[0] > 1 and twist.linear_xyz[0] < 1)
    assert braking == pytest.approx(2.0, abs=0.06)
    # Where it stops it is nearer than it has to be.
    slow = PURSUIT.model_copy(update={"speed": 0.1})
    places = [place for place, _ in driven(Robot(SPOT), [(1.0, 0.0), (1.0, 1.0)], slow, 60)]
    for waypoint in ((1.0, 0.0), (1.0, 1.0)):
        assert min(math.dist(place, waypoint) for place in places) <= PURSUIT.tolerance / 4
    assert math.dist(places[-1], (1.0, 1.0)) <= PURSUIT.tolerance / 4


def test_who_is_at_its_waypoint_stays_there() -> None:
    seen = list(driven(Robot(SPOT, yaw=1.0), [(0.0, 0.0)], PURSUIT, 10))
    assert [twist for _, twist in seen] == [Twist(), Twist()]
    # Also if it is pushed away.
    follower = PathFollower(through([(0.0, 0.0)], PURSUIT), SPOT)
    away = Pose((1.0, 0.0, 0.1))
    assert [follower.command(dataclasses.replace(START, pose=pose)) for pose in (Pose(), away)] == [Twist(), Twist()]
