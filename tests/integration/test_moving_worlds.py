"""What moves in a world, on every engine and against theory: bodies on paths or that appear, and disturbances."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.errors import RunError
from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.simulation.loop import SimulationRun
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, at, inertia, on_every_engine, running, scene_of, travelled
from tests.simulated import simulated

RATE = 240

# A robot that is nothing but a block of 2 kg, 0.2 m wide and 0.1 m high; its frame is not at its centre of mass.
BLOCK = """
<robot name="block">
  <link name="block">
    <inertial><origin xyz="0.05 0 0"/><mass value="2"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.05 0 0"/><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
  </link>
  <gazebo reference="block"><mu1>{friction}</mu1><mu2>{friction}</mu2></gazebo>
</robot>
"""
INERTIA = (0.02, 0.03, 0.04)
MASS = 2.0


def world(**parts: Any) -> World:
    return World.model_validate(parts)


def block(folder: Path, surroundings: World, *, friction: float = 0.8, **pose: float) -> Scene:
    return scene_of(folder, BLOCK.format(friction=friction), at(**pose), surroundings)


def run(engine: str, scene: Scene, seconds: float) -> Trace:
    return travelled(engine, scene, round(seconds * RATE))


@on_every_engine
@pytest.mark.parametrize(("axis", "start"), [(0, 0.0), (2, 0.05)], ids=["along", "up"])
def test_a_platform_takes_along_what_stands_on_it(engine: str, axis: int, start: float, tmp_path: Path) -> None:
    path = ({"at": 0.5, "xyz"[axis]: start}, {"at": 2.5, "xyz"[axis]: start + 1.0})
    lift = {"name": "lift", "box": (0.6, 0.6, 0.1), "path": path, "friction": 1.0}
    trace = run(engine, block(tmp_path, world(objects=(lift,)), z=0.151), 3.5)
    middle = (trace.time > 1.0) & (trace.time < 2.4)
    assert trace.base_linear_xyz[middle, axis] == pytest.approx(0.5, abs=0.005 if axis == 0 else 0.01)
    end = np.array((0.0, 0.0, 0.15)) + np.eye(3)[axis]
    assert trace.base_position_xyz[-1] == pytest.approx(end, abs=0.02)
    assert trace.base_position_xyz[-1, 2] == pytest.approx(end[2], abs=0.003)
    assert abs(trace.base_position_xyz[:, 1]).max() < 0.002


@on_every_engine
def test_a_turntable_turns_what_stands_on_it(engine: str, tmp_path: Path) -> None:
    path = ({"at": 0.0}, {"at": 4.0, "yaw": math.tau})
    table = {"name": "table", "cylinder": {"radius": 0.5, "height": 0.1}, "path": path, "loop": True, "friction": 1.0}
    trace = run(engine, block(tmp_path, world(objects=(table,)), x=0.2, z=0.151), 6.0)
    turning = math.tau / 4
    late = trace.time > 1.0
    assert trace.base_angular_xyz[late, 2] == pytest.approx(turning, abs=0.02)
    # It goes round on a circle, but for what a tangent is off in a step: half a square of the turn, 1 mm in a second.
    radius = np.hypot(trace.base_position_xyz[late, 0], trace.base_position_xyz[late, 1])
    assert radius == pytest.approx(radius[0], abs=0.01)
    assert trace.speed[late] == pytest.approx(turning * radius, rel=0.02)


@on_every_engine
def test_nothing_stops_a_body_on_a_path(engine: str, tmp_path: Path) -> None:
    ball = {"name": "ball", "sphere": {"radius": 0.1}, "mass": 100.0, "pose": {"x": 0.6}}
    path = ({"at": 0.0, "x": -0.5}, {"at": 2.0, "x": 0.5})
    pusher = {"name": "pusher", "box": (0.1, 0.4, 0.1), "path": path}
    scene = block(tmp_path, world(objects=(pusher, ball)), friction=1.0)
    with running(engine, scene) as backend:
        for step in range(0, 2 * RATE, 60):
            advance(backend, step, 60)
            expected = (-0.5 + 0.5 * (step + 60) / RATE, 0.0, 0.05)
            assert backend.body_pose("pusher").position_xyz == pytest.approx(expected, abs=1e-9)


@on_every_engine
def test_a_body_waits_where_its_path_begins_while_the_robot_settles(engine: str, tmp_path: Path) -> None:
    path = ({"at": 0.0, "x": 1.0, "yaw": 1.0}, {"at": 1.0, "x": 2.0})
    gate = {"name": "gate", "box": (0.1, 0.4, 0.3), "pose": {"x": 9.0, "y": 3.0}, "path": path}
    with running(engine, block(tmp_path, world(objects=(gate,)))) as backend:
        assert backend.body_pose("gate").position_xyz == pytest.approx((1.0, 3.0, 0.15))
        advance(backend, -100, 50)
        assert backend.body_pose("gate").position_xyz == pytest.approx((1.0, 3.0, 0.15))
        assert backend.body_pose("gate").yaw == pytest.approx(1.0)
        advance(backend, 0, 120)
        assert backend.body_pose("gate").position_xyz == pytest.approx((1.5, 3.0, 0.15))


@on_every_engine
def test_a_body_that_appears_is_not_there_before_and_falls_from_then(engine: str, tmp_path: Path) -> None:
    box = {"name": "box", "box": (0.1, 0.1, 0.1), "mass": 1.0, "pose": {"x": 0.05, "z": 1.0}, "appears": 1.0}
    wall = {"name": "wall", "box": (0.1, 1.0, 0.5), "pose": {"x": 0.05}, "appears": 2.3}
    scene = block(tmp_path, world(objects=(box, wall)))
    with running(engine, scene, contacts=True) as backend:
        assert not backend.overlaps() or {overlap.body for overlap in backend.overlaps()} == {"ground"}
        before = advance(backend, 0, RATE)
        assert before.contacts == ()
        falling = round(0.3 * RATE)
        advance(backend, RATE, falling)
        fallen = 1.0 - backend.body_pose("box").position_xyz[2]
        # Engines take the velocity at the end of a step for all of it.
        assert fallen == pytest.approx(GRAVITY * 0.3**2 / 2, rel=2 / falling)
        after = advance(backend, RATE + falling, RATE)
        assert {contact.body for contact in after.contacts} == {"box"}
        meets = 1.0 + math.sqrt(2 * (1.0 - 0.15) / GRAVITY)
        assert after.contacts[0].time == pytest.approx(meets, abs=0.02)
        assert backend.body_pose("wall").position_xyz == pytest.approx((0.05, 0.0, 0.25))


@on_every_engine
@pytest.mark.parametrize(
    ("force", "seconds"), [((10.0, 0.0, 0.0), 0.103), ((-3.0, 4.0, 0.0), 0.001), ((-3.0, 4.0, 0.0), 0.5)]
)
def test_a_force_for_a_time_is_a_momentum(
    engine: str, force: tuple[float, float, float], seconds: float, tmp_path: Path
) -> None:
    disturbance = {"at": 0.2015, "for": seconds, "link": "block", "force": force}
    scene = block(tmp_path, world(ground={"friction": 0.0}, disturbances=(disturbance,)), yaw=0.7)
    trace = run(engine, scene, 1.0)
    assert trace.base_linear_xyz[trace.time < 0.2, :2] == pytest.approx(0.0, abs=1e-5)
    momentum = MASS * trace.base_linear_xyz[-1, :2]
    expected = np.array(force[:2]) * seconds
    assert momentum == pytest.approx(expected, abs=0.01 * float(np.linalg.norm(expected)))
    assert trace.base_angular_xyz[-1, 2] == pytest.approx(0.0, abs=1e-3)


@on_every_engine
@pytest.mark.parametrize(
    ("axis", "turned", "own_axis"),
    # In the air, turned so that the axis of the torque in the world stays a principal one of the block.
    [(0, {"roll": 0.3}, 0), (1, {"pitch": 0.3}, 1), (2, {"yaw": 0.3}, 2), (0, {"yaw": math.pi / 2}, 1)],
)
def test_a_torque_for_a_time_is_an_angular_momentum(
    engine: str, axis: int, turned: dict[str, float], own_axis: int, tmp_path: Path
) -> None:
    direction = np.eye(3)[axis]
    disturbance = {"at": 0.1, "for": 0.05, "torque": tuple(0.1 * direction)}
    trace = run(engine, block(tmp_path, world(disturbances=(disturbance,)), z=5.0, **turned), 0.25)
    expected = 0.1 * 0.05 / INERTIA[own_axis] * direction
    assert trace.base_angular_xyz[-1] == pytest.approx(expected, rel=0.01, abs=1e-5)


@on_every_engine
def test_a_force_at_a_point_turns_as_well(engine: str, tmp_path: Path) -> None:
    # 0.1 m to the left of the centre of mass, as the block is turned.
    disturbance = {"at": 0.0, "for": 0.05, "force": (0.0, 4.0, 0.0), "point": (0.05, 0.1, 0.0)}
    scene = block(tmp_path, world(disturbances=(disturbance,)), z=5.0, yaw=math.pi / 2)
    trace = run(engine, scene, 0.06)
    assert trace.base_angular_xyz[-1, 2] == pytest.approx(-0.1 * 4.0 * 0.05 / INERTIA[2], rel=0.01)


@on_every_engine
def test_a_push_changes_a_velocity_at_once(engine: str, tmp_path: Path) -> None:
    push = {"at": 0.5, "velocity": (0.0, 0.3, 0.1)}
    trace = run(engine, block(tmp_path, world(ground={"friction": 0.0}, disturbances=(push,)), z=5.0), 1.0)
    before, after = (int(np.searchsorted(trace.time, 0.5 + offset)) for offset in (-1e-6, 1 / RATE - 1e-6))
    change = trace.base_linear_xyz[after] - trace.base_linear_xyz[before]
    assert change == pytest.approx((0.0, 0.3, 0.1 - GRAVITY / RATE), abs=1e-9)
    assert trace.base_angular_xyz[-1] == pytest.approx(0.0, abs=1e-9)


@on_every_engine
def test_a_body_is_disturbed_as_a_robot_is(engine: str, tmp_path: Path) -> None:
    puck = {"name": "puck", "cylinder": {"radius": 0.2, "height": 0.1}, "mass": 3.0, "friction": 0.0}
    puck["pose"] = {"y": 2.0}
    disturbances = (
        {"at": 0.5, "for": 0.1, "body": "puck", "force": (6.0, 0.0, 0.0)},
        {"at": 1.0, "body": "puck", "velocity": (-0.2, 0.1, 0.0)},
    )
    with running(engine, block(tmp_path, world(objects=(puck,), disturbances=disturbances))) as backend:
        advance(backend, 0, round(0.6 * RATE))
        start = backend.body_pose("puck").position_xyz
        advance(backend, round(0.6 * RATE), round(0.4 * RATE))
        middle = backend.body_pose("puck").position_xyz
        advance(backend, RATE, RATE)
        end = backend.body_pose("puck").position_xyz
    assert middle[0] - start[0] == pytest.approx(0.2 * 0.4, rel=0.01)
    assert (end[0] - middle[0], end[1] - middle[1]) == pytest.approx((0.0, 0.1), abs=0.002)


@on_every_engine
def test_a_moving_world_repeats_bit_by_bit(engine: str, tmp_path: Path) -> None:
    path = ({"at": 0.0, "x": -0.5}, {"at": 2.0, "x": 0.5})
    objects = (
        {"name": "pusher", "box": (0.1, 0.4, 0.1), "path": path},
        {"name": "box", "box": (0.1, 0.1, 0.1), "mass": 1.0, "pose": {"x": 0.05, "z": 0.5}, "appears": 0.5},
    )
    disturbances = ({"at": 0.3, "for": 0.1, "force": (0.0, 5.0, 0.0)}, {"at": 1.0, "velocity": (0.0, 0.1, 0.0)})
    scene = block(tmp_path, world(objects=objects, disturbances=disturbances))
    one, other = run(engine, scene, 2.0), run(engine, scene, 2.0)
    assert one.state.tobytes() == other.state.tobytes()
    with running(engine, scene) as backend:
        pieces = [advance(backend, step, 48).state for step in range(0, 480, 48)]
    assert np.concatenate(pieces).tobytes() == one.state.tobytes()


ARM = f"""
<robot name="arm">
  <link name="base"><inertial><mass value="1"/>{inertia(0.01)}</inertial></link>
  <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint>
</robot>
"""


@on_every_engine
@pytest.mark.parametrize(
    ("acts", "moment"),
    [
        ({"force": (0.0, 4.0, 0.0)}, 4.0 * 0.5),
        ({"force": (0.0, 4.0, 0.0), "point": (1.0, 0.0, 0.0)}, 4.0 * 1.0),
        ({"torque": (0.0, 0.0, 3.0)}, 3.0),
    ],
)
def test_a_link_is_disturbed_where_it_is(engine: str, acts: dict[str, Any], moment: float, tmp_path: Path) -> None:
    disturbance = {"at": 0.0, "for": 0.025, "link": "rod", **acts}
    robot = Robot(model="robot.urdf", pose=Placement(z=1.0), base="fixed")
    trace = run(engine, scene_of(tmp_path, ARM, robot, world(disturbances=(disturbance,))), 0.05)
    about_hinge = 0.1 + 2.0 * 0.5**2
    assert trace.joint_velocity[-1, 0] == pytest.approx(moment * 0.025 / about_hinge, rel=0.01)


@on_every_engine
def test_rays_meet_bodies_where_they_are_now(engine: str, tmp_path: Path) -> None:
    path = ({"at": 0.0, "x": 2.0}, {"at": 2.0, "x": 4.0})
    objects = (
        {"name": "gate", "box": (0.2, 1.0, 0.5), "path": path},
        {"name": "wall", "box": (0.2, 1.0, 0.5), "pose": {"x": 1.0}, "appears": 1.0},
        {"name": "ball", "sphere": {"radius": 0.2}, "mass": 1.0, "pose": {"x": 0.6, "z": 0.3}, "appears": 1.5},
    )
    with running(engine, block(tmp_path, world(objects=objects))) as backend:

        def reach() -> float:
            return float(10.0 * backend.cast_rays((0.0, 0.0, 0.3), np.array([[10.0, 0.0, 0.3]]))[0])

        assert reach() == pytest.approx(1.9, abs=1e-3)
        advance(backend, 0, RATE - 1)
        assert reach() == pytest.approx(1.9 + (RATE - 1) / RATE, abs=1e-3)
        advance(backend, RATE - 1, 1)
        assert reach() == pytest.approx(0.9, abs=1e-3)
        advance(backend, RATE, RATE // 2)
        assert reach() == pytest.approx(0.4, abs=2e-3)


@on_every_engine
def test_a_body_is_carried_and_pushed_as_a_robot_is(engine: str, tmp_path: Path) -> None:
    crate = {"box": (0.2, 0.2, 0.2), "mass": 1.0, "friction": 0.8}
    lift = {"name": "lift", "box": (0.6, 0.6, 0.1), "friction": 1.0, "pose": {"y": 2.0}}
    pusher = {"name": "pusher", "box": (0.1, 0.4, 0.2), "friction": 0.1, "pose": {"y": 4.0}}
    objects = (
        {**lift, "path": ({"at": 0.5, "x": 0.0}, {"at": 2.5, "x": 1.0})},
        {**crate, "name": "carried", "pose": {"y": 2.0, "z": 0.2}},
        {**pusher, "path": ({"at": 0.0, "x": -0.2}, {"at": 10.0, "x": 1.8})},
        {**crate, "name": "pushed", "pose": {"y": 4.0}},
    )
    with running(engine, block(tmp_path, world(objects=objects))) as backend:
        advance(backend, 0, round(1.5 * RATE))
        early = [backend.body_pose(name).position_xyz[0] for name in ("carried", "pushed")]
        advance(backend, round(1.5 * RATE), round(0.9 * RATE))
        late = [backend.body_pose(name).position_xyz[0] for name in ("carried", "pushed")]
    speeds = np.subtract(late, early) / 0.9
    assert speeds == pytest.approx((0.5, 0.2), rel=0.01)
    assert late[1] == pytest.approx(-0.2 + 0.2 * 2.4 + 0.15, abs=0.003)


def driven(folder: Path, engine: str, **keys: Any) -> SimulationRun:
    scenario = {"name": "s", "backend": engine, "robot": {"model": "turtlebot3_burger"}, "time_limit": 10}
    return simulated(folder, {**scenario, "commands": {"twist": [{"linear": 0.2}]}, **keys})


@on_every_engine
def test_a_run_that_was_over_too_early_says_so(engine: str, tmp_path: Path) -> None:
    pushes = [{"at": 0.5, "velocity": [0, 0, 0.1]}, {"at": 3, "velocity": [0, 0.1, 0]}]
    ran = driven(tmp_path, engine, expect=[{"travel": {"at_least": 0.2}}], world={"disturbances": pushes})
    assert [finding.message for finding in ran.findings] == [
        f"world.disturbances[1] never began: it is due at 3 s, but the run ended at {ran.sim_time:.4g} s"
    ]


@on_every_engine
def test_a_body_that_appears_inside_of_something_leaves_the_run_without_a_verdict(engine: str, tmp_path: Path) -> None:
    rock = {"name": "rock", "sphere": {"radius": 0.1}}

    def meets(time: float) -> SimulationRun:
        world = {"objects": [{**rock, "pose": {"x": 0.5}, "appears": time}]}
        return driven(tmp_path, engine, expect=[{"travel": {"at_least": 1}}], world=world)

    with pytest.raises(RunError, match=r"body 'rock' appears at 2.5 s, .* inside the robot's link 'base"):
        meets(2.5)
    # It has passed by then.
    assert meets(4.5).verdicts[0].passed

    def above_a_crate(z: float, **mass: float) -> SimulationRun:
        crate = {"name": "crate", "box": [1, 1, 1], "mass": 1, "pose": {"x": 5}}
        world = {"objects": [crate, {**rock, **mass, "pose": {"x": 5, "z": z}, "appears": 1}]}
        stands = {"commands": {"twist": [{"linear": 0}]}, "expect": ["upright"], "time_limit": 3}
        return driven(tmp_path, engine, world=world, **stands)

    for mass in ({}, {"mass": 1.0}):
        with pytest.raises(RunError, match=r"body 'rock' appears at 1 s, .* inside 'crate'"):
            above_a_crate(0.98, **mass)
    assert above_a_crate(1.2, mass=1.0).verdicts[0].passed


@on_every_engine
def test_a_body_of_many_pieces_moves_as_one(engine: str, tmp_path: Path) -> None:
    stairs = {"name": "stairs", "stairs": {"steps": 20, "rise": 0.005, "run": 0.05, "width": 1.0}, "friction": 1.0}
    path = ({"at": 0.5, "x": 0.0, "yaw": 0.0}, {"at": 2.5, "x": 1.0}, {"at": 4.5, "yaw": 1.0})
    scene = block(tmp_path, world(objects=({**stairs, "path": path},)), x=-0.05, z=0.2)
    with running(engine, scene) as backend:
        advance(backend, 0, RATE)
        trace = advance(backend, RATE, RATE)
        assert trace.base_linear_xyz[:, 0] == pytest.approx(0.5, abs=0.02)
        assert trace.base_linear_xyz[:, 0].mean() == pytest.approx(0.5, abs=0.003)
        advance(backend, 2 * RATE, round(0.8 * RATE))
        trace = advance(backend, round(2.8 * RATE), RATE)
        assert trace.base_angular_xyz[:, 2].mean() == pytest.approx(0.5, rel=0.02)


@on_every_engine
def test_a_force_at_a_point_turns_a_body(engine: str, tmp_path: Path) -> None:
    ball = {"name": "ball", "sphere": {"radius": 0.1}, "mass": 1.0, "pose": {"y": 2.0, "z": 5.0}}
    disturbance = {"at": 0.0, "for": 0.05, "body": "ball", "force": (0.0, 4.0, 0.0), "point": (0.1, 0.0, 0.0)}
    with running(engine, block(tmp_path, world(objects=(ball,), disturbances=(disturbance,)))) as backend:
        advance(backend, 0, 24)
        before = backend.body_pose("ball").yaw
        advance(backend, 24, 48)
        turned = backend.body_pose("ball").yaw - before
    inertia = 2 / 5 * 1.0 * 0.1**2
    # It turns by a tenth of a right angle while the force acts, which has a shorter arm then.
    assert turned == pytest.approx(0.1 * 4.0 * 0.05 / inertia * 48 / RATE, rel=0.02)


@on_every_engine
@pytest.mark.parametrize(("yaw", "rate"), [(0.0, 240), (90.0, 1000)])
def test_a_belt_carries_at_its_speed_from_the_beginning(engine: str, yaw: float, rate: int, tmp_path: Path) -> None:
    """Friction accelerates the block to the speed of the belt; until then it lags by v^2 / (2 mu g)."""
    speed, friction = 0.5, 0.8
    belt = {"name": "belt", "box": (6, 6, 0.1), "friction": 1.0, "pose": {"yaw": math.radians(yaw)}}
    surroundings = world(objects=({**belt, "surface_velocity": {"linear": (speed, 0, 0)}},))
    scene = scene_of(tmp_path, BLOCK.format(friction=friction), at(z=0.151), surroundings, rate=rate)
    with running(engine, scene) as backend:
        before = advance(backend, -rate, rate)
        trace = advance(backend, 0, 2 * rate)
        assert any("push like moving walls" in note for note in backend.notes) == (engine == "pybullet")
    assert np.abs(before.base_position_xyz[-1, :2]).max() < 1e-3
    way = 2 * speed - speed**2 / (2 * friction * GRAVITY)
    along = (way, 0) if yaw == 0 else (0, way)
    assert trace.base_position_xyz[-1, :2] == pytest.approx(along, abs=0.01 * way)
    assert trace.base_position_xyz[-1, 2] == pytest.approx(0.15, abs=1e-3)


@on_every_engine
@pytest.mark.parametrize(
    "shape", [{"box": (4, 4, 0.1)}, {"cylinder": {"radius": 2, "height": 0.1}}], ids=["box", "cylinder"]
)
def test_a_turntable_takes_a_block_around(engine: str, shape: dict[str, Any], tmp_path: Path) -> None:
    table = {"name": "table", **shape, "friction": 1.0, "surface_velocity": {"angular": 0.5}}
    trace = run(engine, block(tmp_path, world(objects=(table,)), x=1.0, z=0.151), 4)
    place, velocity = trace.base_position_xyz[-1, :2], trace.base_linear_xyz[-1, :2]
    assert math.hypot(*place) == pytest.approx(1.0, abs=0.01)
    assert math.atan2(place[1], place[0]) == pytest.approx(0.5 * 4, abs=0.06)
    assert velocity == pytest.approx((-0.5 * place[1], 0.5 * place[0]), abs=0.02)
    assert trace.base_angular_xyz[-1, 2] == pytest.approx(0.5, abs=0.01)


CUP = f"""<robot name="gripper"><link name="world"/>
  <link name="cup"><inertial><mass value="1"/>{inertia(1)}</inertial>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="lift" type="prismatic"><parent link="world"/><child link="cup"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1000" velocity="5"/></joint></robot>"""


def held(
    engine: str, folder: Path, force: float, *, up: float = 0.0, seconds: float = 1.0, until: float = 9.0
) -> float:
    """The height by which a box of 2 kg has moved that begins below a cup, which rises with an acceleration `up`."""
    box = {"name": "box", "box": (0.2, 0.2, 0.1), "mass": 2.0, "pose": {"z": 0.9}}
    suction = {"adhesion": force, "link": "cup", "at": 0.0, "for": until}
    robot = Robot.model_validate({"model": "robot.urdf", "joints": {"lift": 0.9999}})
    surroundings = world(objects=(box,), disturbances=(suction,))
    with running(engine, scene_of(folder, CUP, robot, surroundings)) as backend:
        steps = round(seconds * RATE)
        rising = [JointTargets(velocity={"lift": up * (step + 1) / RATE}) for step in range(steps)]
        advance(backend, 0, steps, *rising)
        return backend.body_pose("box").position_xyz[2] - 0.9


@on_every_engine
def test_a_suction_cup_holds_up_to_its_force(engine: str, tmp_path: Path) -> None:
    weight = 2.0 * GRAVITY
    assert held(engine, tmp_path, 1.1 * weight) == pytest.approx(0.0, abs=2e-3)
    # Rising with 2 m/s^2, the box weighs a fifth more.
    assert held(engine, tmp_path, 1.5 * weight, up=2.0, seconds=0.5) == pytest.approx(2.0 * 0.5**2 / 2, abs=5e-3)
    assert held(engine, tmp_path, 1.1 * weight, up=2.0, seconds=0.5) < 0
    # Less than the weight: it falls onto the ground, at g less what the cup takes as long as both touch.
    assert held(engine, tmp_path, 0.9 * weight) == pytest.approx(-0.85, abs=0.01)
    # Switched off after half a second, it has fallen for as long.
    fallen = held(engine, tmp_path, 1.5 * weight, until=0.5, seconds=0.75)
    assert fallen == pytest.approx(-GRAVITY * 0.25**2 / 2, abs=0.015)


@on_every_engine
def test_a_fixed_magnet_holds_a_block_against_a_wall(engine: str, tmp_path: Path) -> None:
    """Its force presses, so that friction carries the weight and the block does not tip; a quarter is too little."""
    wall = {"name": "wall", "box": (0.1, 1, 2), "friction": 1.0, "pose": {"x": 0.2, "z": 1.0}}
    for force, least, most in ((2.0, 0.99, 1.01), (0.5, 0.0, 0.9)):
        magnet = {"adhesion": force * MASS * GRAVITY / 0.8, "body": "wall", "at": 0.0}
        surroundings = world(objects=(wall,), disturbances=(magnet,))
        trace = run(engine, block(tmp_path, surroundings, x=0.0001, z=1.0), 1)
        assert least < trace.base_position_xyz[-1, 2] < most
