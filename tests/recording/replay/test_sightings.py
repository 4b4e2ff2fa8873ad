"""Which sensor saw an obstacle first: by the returns of its rays, or by touch."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.records import replace
from sim_action.recording.replay.sightings import ObstacleData, distance_to, obstacles_of
from sim_action.sensors import ReadingLog
from sim_action.sensors.lidar import Lidar
from sim_action.state.readings import LidarScan
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.world import Body, Sphere, World
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart
from sim_action.world.scene import Scene
from tests import traces
from tests.recording.replay import logs

# The robot drives along x at 1 m/s for 2 s; the wall stands across at x = 3 with its front at 2.9.
DRIVE = traces.trace([step / 30 for step in range(61)], x=[step / 30 for step in range(61)])
BUMP = replace(DRIVE, contacts=(traces.contact(1.95),))


def where(*objects: Body) -> Scene:
    return replace(traces.scene(), world=World(objects=objects or (WALL,)))


WALL = Body(name="wall", box=(0.2, 2.0, 0.5), pose=Placement(x=3.0))


def ahead(far: float) -> Callable[[float], Sequence[float]]:
    """Four rays, the first one ahead; the wall returns it from a distance of `far` on."""
    return lambda time: [2.9 - time if 2.9 - time <= far else math.inf, 0.5, math.inf, -math.inf]


def seen(film: Trace, scene: Scene, *several: ReadingLog) -> tuple[ObstacleData, ...]:
    return obstacles_of(scene, film, {log.mounted.name: log for log in several})


def test_sightings_of_touched_bodies() -> None:
    # The first return from a touched body counts.
    (found,) = seen(BUMP, where(), logs.lidar("front", 21, ahead(2.0)), logs.lidar("far", 21, ahead(2.5)))
    assert (found.body, found.touched) == (0, 1.95)
    (far, near) = found.seen
    assert (far.sensor, far.kind, far.time, far.distance, far.angle) == ("far", "lidar", 0.4, 2.5, 0.0)
    assert (near.sensor, near.time) == ("front", 0.9)
    # A bumper sees by touch.
    (found,) = seen(BUMP, where(), logs.bumper("bumper", {0.5: "ground", 0.8: "wall"}))
    assert [(one.sensor, one.kind, one.time, one.distance) for one in found.seen] == [("bumper", "contact", 0.8, None)]
    # A sighting says of how many readings one was looked at.
    (found,) = seen(BUMP, where(), logs.lidar("front", 121, ahead(2.0), rate=60.0))
    assert [(one.time, one.every) for one in found.seen] == [(0.9, 2)]
    # Returns after the end of the run do not count.
    film = replace(BUMP.rows(slice(0, 16)), contacts=BUMP.contacts)
    (found,) = seen(film, where(), logs.lidar("front", 21, ahead(2.0)))
    assert found.seen == ()


def test_obstacles_that_were_not_seen_or_touched() -> None:
    # A body that no sensor saw is said.
    (found,) = seen(BUMP, where(), logs.lidar("front", 21, ahead(0.5)))
    assert (found.touched, found.seen) == (1.95, ())
    # A body that was only near is an obstacle.
    nearest = ClearanceRecord.of(
        [Nearness(1.0, 0.8, "base_footprint", "other"), Nearness(2.0, 0.3, "base_scan", "wall")]
    )
    film = replace(DRIVE, clearances={ClearanceWatch(): nearest})
    (found,) = seen(film, where(), logs.lidar("front", 21, ahead(2.0)))
    assert (found.touched, [one.time for one in found.seen]) == (None, [0.9])
    # Without sensors that look there is nothing to say.
    assert seen(BUMP, where()) == ()
    assert seen(DRIVE, where(), logs.lidar("front", 21, ahead(2.0))) == ()


@pytest.mark.parametrize("appears", [None, 1.5])
def test_moving_bodies_are_seen_where_they_are(appears: float | None) -> None:
    ball = Body(name="wall", sphere=Sphere(radius=0.1), mass=1.0, appears=appears)
    # It flies ahead of the robot, in reach from 1 s on.
    places = np.array([[step / 30 + (1.1 if step >= 30 else 9.0), 0.0, 0.0] for step in range(61)])
    record = BodyRecord(DRIVE.time, places, np.tile([0.0, 0.0, 0.0, 1.0], (61, 1)))
    film = replace(BUMP, bodies={"wall": record})
    (found,) = seen(film, where(ball), logs.lidar("front", 21, lambda _: [1.0, math.inf]))
    assert [one.time for one in found.seen] == [appears or 1.0]


def test_returns_that_are_not_from_a_body() -> None:
    # A noisy return from behind a low body is not from it.
    low = Body(name="box", box=(0.2, 2.0, 0.1), pose=Placement(x=2.8, z=0.05))
    film = replace(DRIVE, contacts=(traces.contact(1.9, body="box"),))
    scans = [logs.scan(number / 10, [2.9 - number / 10, math.inf]) for number in range(21)]
    lidar = logs.log(Lidar(rays=2, noise=0.03), "front", scans, pose=Pose((0.0, 0.0, 0.15)))
    found = seen(film, where(low, WALL), lidar)
    assert [(one.body, one.seen) for one in found] == [(0, ())]
    # A return is not from behind the sensor.
    behind = Body(name="box", box=(0.2, 2.0, 1.0), pose=Placement(x=-0.15))
    scans = [logs.scan(number / 10, [0.1, math.inf]) for number in range(21)]
    (unseen,) = seen(standing(0.0, "box"), where(behind), logs.log(Lidar(rays=2, noise=0.05), "front", scans))
    assert unseen.seen == ()
    # The nearest part counts.
    parts = [SpherePart(0.5), SpherePart(0.5, Pose((2.0, 0.0, 0.0)))]
    assert distance_to(parts, np.array([[1.6, 0.0, 0.0], [0.0, 1.0, 0.0]])) == pytest.approx([-0.1, 0.5])
    assert len(distance_to(parts, np.empty((0, 3)))) == 0


def standing(x: float, body: str) -> Trace:
    times = [step / 30 for step in range(61)]
    return replace(traces.trace(times, x=[x] * 61), contacts=(traces.contact(1.9, body=body),))


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_lidar_on_a_surface_sees_it(noise: float) -> None:
    scans = [logs.scan(number / 10, [0.0, math.inf]) for number in range(21)]
    (found,) = seen(standing(2.9, "wall"), where(), logs.log(Lidar(rays=2, noise=noise), "front", scans))
    assert [(one.time, one.distance) for one in found.seen] == [(0.0, 0.0)]


def test_lidars_that_saw_nothing_of_a_body_are_named_with_their_share() -> None:
    blind, thinned = (
        logs.lidar(name, round(2 * rate) + 1, lambda _: [math.inf, 0.5], rate=rate)
        for name, rate in (("blind", 10.0), ("thinned", 60.0))
    )
    # What is too near to be measured may be the body.
    doubtful = logs.lidar("doubtful", 21, lambda _: [math.inf, -math.inf])
    (found,) = seen(BUMP, where(), logs.lidar("front", 21, ahead(2.0)), blind, thinned, doubtful)
    assert [one.sensor for one in found.seen] == ["front"]
    assert [(one.sensor, one.every) for one in found.blind] == [("blind", 1), ("thinned", 2)]


def test_returns_of_noisy_late_and_turning_runs() -> None:
    # Noisy returns count within their noise.
    scans = [logs.scan(number / 10, [2.0 - 0.05, math.inf]) for number in range(21)]
    for noise, expected in ((0.0, 0), (0.02, 1)):
        lidar = logs.log(Lidar(rays=2, noise=noise), "front", scans, pose=Pose())
        (found,) = seen(standing(0.9, "wall"), where(), lidar)
        assert len(found.seen) == expected
    # A body is found late in a long run.
    times = [step / 30 for step in range(301)]
    film = replace(traces.trace(times, x=[0.29 * time for time in times]), contacts=(traces.contact(9.9),))
    log = logs.lidar("front", 101, lambda time: [2.9 - 0.29 * time if time >= 7.6 else math.inf, math.inf])
    (found,) = seen(film, where(), log)
    assert [one.time for one in found.seen] == [7.6]
    # The nearest return from a body counts with its direction.
    right = Body(name="wall", box=(4.0, 0.2, 0.5), pose=Placement(y=-1.1))
    angles = (1.4 * math.pi, 1.5 * math.pi, 1.6 * math.pi)
    ranges = np.array([1.0 / abs(math.sin(angle)) for angle in angles])
    scan = LidarScan(0.1, angles[0], 0.1 * math.pi, 0.1, 5.0, ranges)
    (found,) = seen(standing(0.0, "wall"), where(right), logs.log(Lidar(rays=3), "front", [scan]))
    assert [(one.distance, one.angle) for one in found.seen] == [(1.0, round(-math.pi / 2, 4))]
    # A body whose quaternion changes sign is seen between two moments.
    long = Body(name="wall", box=(0.2, 2.0, 0.5), mass=1.0)
    rows = np.tile([2.0, 0.0, 0.0], (61, 1)), np.outer([(-1.0) ** step for step in range(61)], [0, 0, 1.0, 0])
    film = replace(standing(0.0, "wall"), bodies={"wall": BodyRecord(DRIVE.time, *rows)})
    scans = [logs.scan((step + 0.5) / 30, [1.9, math.inf]) for step in range(30, 40)]
    (found,) = seen(film, where(long), logs.log(Lidar(rays=2), "front", scans))
    assert [one.time for one in found.seen] == [pytest.approx(30.5 / 30, abs=1e-4)]


TURNED = Pose((1.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, math.pi / 2))
CORNERS = tuple((x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0))
TRIANGLE = SurfacePart(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("part", "point", "expected"),
    [
        (BoxPart((2.0, 4.0, 6.0)), (2.0, 0.0, 0.0), 1.0),
        (BoxPart((2.0, 4.0, 6.0)), (4.0, 6.0, 3.0), 5.0),
        (BoxPart((2.0, 4.0, 6.0)), (0.9, 0.0, 0.0), -0.1),
        (BoxPart((2.0, 4.0, 6.0), TURNED), (1.0, 2.0, 0.0), 1.0),
        (CylinderPart(0.5, 2.0), (0.0, 1.5, 0.0), 1.0),
        (CylinderPart(0.5, 2.0), (3.5, 0.0, 5.0), 5.0),
        (SpherePart(0.5, TURNED), (1.0, 0.0, 2.0), 1.5),
        (HullPart(CORNERS), (0.0, 2.5, 0.0), 1.5),
        (HullPart(CORNERS), (4.0, 5.0, 0.0), 5.0),
        (TRIANGLE, (0.2, 0.2, -0.7), 0.7),
        (TRIANGLE, (-3.0, 0.5, 4.0), 5.0),
        (TRIANGLE, (4.0, 0.0, 4.0), 5.0),
        (GridPart((2.0, 2.0), np.full((3, 3), 0.5)), (0.3, -0.4, 0.7), 0.2),
    ],
)
def test_distances(part: Part, point: tuple[float, float, float], expected: float) -> None:
    assert distance_to([part], np.array([point, point])) == pytest.approx([expected, expected])
