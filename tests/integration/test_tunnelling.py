"""A body never passes through another unseen: a contact is seen, or the run is an error, or it flies past."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import BadStart, MissedContact, RunError, SimulationUnstable
from sim_action.core.geometry import quaternion_from_rpy, rotate
from sim_action.core.lazy_numpy import FloatArray
from sim_action.simulation.loop import SimulationRun
from sim_action.simulation.tunnelling import Tunnelling
from sim_action.world import World
from tests.integration.engines import at, on_every_engine, running, scene_of
from tests.simulated import simulated
from tests.soak import examples

BALL = """
<robot name="ball"><link name="ball">
  <inertial><mass value="0.5"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="{radius}"/></geometry></collision>
</link></robot>
"""
HEIGHT = 2.0
FASTEST = ("max_speed", "max_turn_rate")


class Shot(NamedTuple):
    """A ball that flies along x at a wall of 1 m x 1 m at the origin, without gravity; lengths in m."""

    radius: float = 0.02
    speed: float = 60.0
    thickness: float = 0.002
    rate: float = 240.0
    start: float = -0.6
    aside: float = 0.0
    yaw: float = 0.0

    @property
    def seconds(self) -> float:
        """Long enough to fly past the wall."""
        return 1.4 / self.speed + 2 / self.rate

    def wall(self, **keys: Any) -> dict[str, Any]:
        return {"name": "wall", "box": (self.thickness, 1.0, 1.0), "pose": {"z": HEIGHT, "yaw": self.yaw}, **keys}

    def world(self, *objects: dict[str, Any], **push: Any) -> dict[str, Any]:
        """A world in which something is pushed at t = 0."""
        push = {"at": 0.0, "velocity": (self.speed, 0.0, 0.0), **push}
        return {"gravity": 0, "objects": objects, "disturbances": (push,)}

    def depths(self, places: FloatArray) -> FloatArray:
        """How deep (N,) in m balls at places (N, 3) are in the wall; negative outside."""
        back = quaternion_from_rpy(0.0, 0.0, -self.yaw)
        local = np.array([rotate(back, (x, y, z - HEIGHT)) for x, y, z in places.tolist()])
        outside = np.maximum(np.abs(local) - np.array([self.thickness, 1.0, 1.0]) / 2, 0.0)
        found: FloatArray = self.radius - np.sqrt(np.square(outside).sum(axis=1))
        return found

    def deepest_between(self, places: FloatArray) -> float:
        """How deep in m the straight ways between places (N, 3) lead into the wall."""
        shares = np.linspace(0, 1, 400)[:, None, None]
        ways = places[:-1] + (places[1:] - places[:-1]) * shares
        return float(self.depths(ways.reshape(-1, 3)).max())


def run(folder: Path, engine: str, **keys: Any) -> SimulationRun:
    scenario = {"name": "s", "backend": engine, "expect": ["no_collision"], "time_limit": 1, **keys}
    return simulated(folder, scenario)


def robot_shot(folder: Path, engine: str, shot: Shot, *, speculative: bool = False, **wall: Any) -> SimulationRun:
    (folder / "ball.urdf").write_text(BALL.format(radius=shot.radius))
    return run(
        folder,
        engine,
        robot={"model": "ball.urdf", "pose": {"x": shot.start, "y": shot.aside, "z": HEIGHT}},
        world=shot.world(shot.wall(**wall)),
        physics={"rate": shot.rate, "settle": 0, **dict.fromkeys(FASTEST, 10_000), "speculative": speculative},
        duration=round(shot.seconds * shot.rate) / shot.rate,
        trace={"rate": shot.rate},
    )


def body_shot(folder: Path, engine: str, shot: Shot, **wall: Any) -> tuple[FloatArray, RunError | None]:
    """Shoots a body of the world; its places (T + 1, 3) at each step, and the error."""
    ball = {"name": "shot", "sphere": {"radius": shot.radius}, "mass": 0.5}
    ball |= {"pose": {"x": shot.start, "y": shot.aside, "z": HEIGHT}}
    made = World.model_validate(shot.world(ball, shot.wall(**wall), body="shot"))
    scene = scene_of(folder, BALL.format(radius=0.02), at(x=-9, z=1), made, rate=shot.rate)
    with running(engine, scene) as backend:
        poses = [backend.body_pose(body.name) for body in made.objects if body.mass is not None]
        first = np.array([(*pose.position_xyz, *pose.orientation_xyzw) for pose in poses])
        start = backend.observe(0, contacts=False)
        watch = Tunnelling(scene, start, first, solid_terrain=backend.solid_terrain)
        error, places = None, [first[:1, :3]]
        for block in range(0, round(shot.seconds * shot.rate) + 1, 7):
            backend.advance(block, [None] * 7)
            trace, bodies = backend.collect(), backend.collect_bodies()
            assert bodies.shape == (7, len(poses), 7)
            _, missed = watch.watch(trace, bodies)
            places.append(bodies[:, 0, :3])
            error = error or missed
    return np.concatenate(places), error


shots = st.builds(
    Shot,
    radius=st.floats(0.005, 0.1),
    speed=st.floats(5, 300),
    thickness=st.floats(0.0005, 0.05),
    rate=st.sampled_from([60.0, 240.0, 500.0]),
    start=st.floats(-0.9, -0.3),
    aside=st.one_of(st.just(0.0), st.floats(-0.7, 0.7)),
    yaw=st.one_of(st.just(0.0), st.floats(-1.2, 1.2)),
).filter(lambda shot: shot.depths(np.array([[shot.start, shot.aside, HEIGHT]]))[0] < -0.05)


def check(shot: Shot, places: FloatArray, *, missed: RunError | None) -> None:
    """A way that leads through the wall has a pose in the wall, or is an error; an error is nothing else."""
    deepest, touches = shot.deepest_between(places), bool((shot.depths(places) > -1e-6).any())
    if missed is not None:
        assert deepest > 0
        assert touches == ("too late" in str(missed))
    elif np.abs(np.diff(places[1:, 0])).max() > 2 * shot.radius + shot.thickness:
        # Slower balls cannot miss it, but for an edge.
        assert touches or deepest < 0.05 * shot.radius


@on_every_engine
@examples(24)
@given(shot=shots)
def test_a_body_never_passes_a_wall_unseen(engine: str, shot: Shot) -> None:
    with tempfile.TemporaryDirectory() as folder:
        places, error = body_shot(Path(folder), engine, shot)
    check(shot, places, missed=error)


@on_every_engine
@pytest.mark.parametrize("offset", [-0.02, -0.01, 0.0, 0.0005, 0.005, 0.015, 0.02, 0.1])
def test_a_body_is_never_behind_a_wall_without_an_error(engine: str, offset: float, tmp_path: Path) -> None:
    # Two steps of 0.25 m end at the middle of the wall, plus the offset.
    shot = Shot(radius=0.02, speed=60, thickness=0.002, start=-0.5 + offset)
    places, error = body_shot(tmp_path, engine, shot)
    is_behind = bool((places[:, 0] > 0.1).any())
    assert is_behind == (error is not None)
    if error is not None:
        how = "with a contact that came too late" if offset < 0.021 else "without a contact"
        assert str(error).startswith(f"body 'shot' passed through body 'wall' {how}, in the step that ends at ")


@on_every_engine
@examples(12)
@given(shot=shots)
def test_a_robot_never_passes_a_wall_unseen(engine: str, shot: Shot) -> None:
    with tempfile.TemporaryDirectory() as folder:
        try:
            ran = robot_shot(Path(folder), engine, shot)
            passed, depth = ran.verdicts[0].passed, shot.deepest_between(ran.trace.base_position_xyz)
        except (MissedContact, SimulationUnstable):
            passed, depth = False, 0.0
    assert not passed or depth < 0.05 * shot.radius


def rate_in(error: MissedContact) -> float:
    found = re.search(r"set physics\.rate to ([0-9.e+]+) Hz", str(error))
    assert found is not None, str(error)
    return float(found.group(1))


# The cases of the issue that named them, and starts from which none of the steps ends in the wall.
CASES = [
    Shot(radius=0.02, speed=60, thickness=0.002, start=-0.62),
    Shot(radius=0.05, speed=90, thickness=0.002, start=-0.56),
    Shot(radius=0.02, speed=60, thickness=0.002, start=-0.62, yaw=0.5),
]


@on_every_engine
@pytest.mark.parametrize("shot", CASES)
def test_the_rate_that_the_error_names_sees_the_contact(engine: str, shot: Shot, tmp_path: Path) -> None:
    with pytest.raises(MissedContact) as raised:
        robot_shot(tmp_path, engine, shot)
    assert str(raised.value).startswith("link 'ball' passed through body 'wall' without a contact, in the step that ")
    assert f"({shot.speed:g} m/s at 240 Hz)" in str(raised.value)
    assert raised.value.keys == ("physics", "rate")
    again = shot._replace(rate=rate_in(raised.value))
    (verdict,) = robot_shot(tmp_path, engine, again).verdicts
    assert not verdict.passed
    assert "touched wall" in verdict.message
    places, error = body_shot(tmp_path, engine, shot)
    assert places[-1, 0] > 0.1
    assert error is not None
    assert str(error).startswith("body 'shot' passed through body 'wall'")
    places, error = body_shot(tmp_path, engine, again)
    assert error is None
    assert (again.depths(places) > -1e-6).any()


def ended(folder: Path, engine: str, **keys: Any) -> tuple[str, bool]:
    """The message of a missed contact, or else if `no_collision` passed."""
    (folder / "ball.urdf").write_text(BALL.format(radius=0.02))
    keys = {"physics": {"settle": 0, "max_speed": 1000}, **keys}
    try:
        return "", run(folder, engine, **keys).verdicts[0].passed
    except MissedContact as error:
        return str(error), False


def faulted(folder: Path, engine: str, **keys: Any) -> str:
    """The message of the missed contact of a run; empty without one."""
    return ended(folder, engine, **keys)[0]


def ball_at(x: float, z: float = HEIGHT, y: float = 0.0) -> dict[str, Any]:
    return {"model": "ball.urdf", "pose": {"x": x, "y": y, "z": z}}


@on_every_engine
def test_a_body_on_a_path_passes_no_robot_unseen(engine: str, tmp_path: Path) -> None:
    path = [{"at": 0, "x": -3.05}, {"at": 0.1, "x": 2.95}]
    shot = {"name": "shot", "sphere": {"radius": 0.02}, "pose": {"z": HEIGHT}, "path": path}
    keys = {"world": {"gravity": 0, "objects": [shot]}, "time_limit": 0.2}
    message = faulted(tmp_path, engine, robot=ball_at(0.07), **keys)
    assert message.startswith("link 'ball' passed through body 'shot'")
    assert "(60 m/s at 240 Hz)" in message
    # It flies past.
    assert not faulted(tmp_path, engine, robot=ball_at(0.07, HEIGHT + 0.05), **keys)


@on_every_engine
def test_a_body_passes_no_movable_plate_unseen(engine: str, tmp_path: Path) -> None:
    shot = Shot(start=-0.62)
    objects = [shot.wall(mass=1.0), {"name": "shot", "sphere": {"radius": 0.02}, "mass": 0.5}]
    objects[1]["pose"] = {"x": shot.start, "z": HEIGHT}
    message = faulted(tmp_path, engine, robot=ball_at(-9), world=shot.world(*objects, body="shot"), time_limit=0.2)
    assert "passed through body" in message
    assert "'wall'" in message
    assert "'shot'" in message


@on_every_engine
def test_a_wall_that_has_not_appeared_is_not_in_the_way(engine: str, tmp_path: Path) -> None:
    shot = Shot(start=-0.62)
    keys = {"robot": ball_at(shot.start), "time_limit": 0.3}
    assert not faulted(tmp_path, engine, world=shot.world(shot.wall(appears=0.2)), **keys)
    assert faulted(tmp_path, engine, world=shot.world(shot.wall(appears=0.004)), **keys)


ARM = """
<robot name="arm">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
    <inertia ixx="0.001" iyy="0.08" izz="0.08" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.01 0.01"/></geometry></collision></link>
  <joint name="swing" type="continuous"><parent link="base"/><child link="rod"/><origin xyz="0 0 1"/>
    <axis xyz="0 0 1"/><limit effort="1000" velocity="100"/></joint>
</robot>
"""


@on_every_engine
def test_an_arm_swings_through_no_pole_unseen(engine: str, tmp_path: Path) -> None:
    """At 30 rad/s, the end of the rod moves 12 cm in a step; at 0.3 rad/s it touches the pole."""
    (tmp_path / "arm.urdf").write_text(ARM)
    pole = {"name": "pole", "cylinder": {"radius": 0.004, "height": 2}, "pose": {"x": 0, "y": 0.9}}
    keys: dict[str, Any] = {
        "robot": {"model": "arm.urdf", "base": "fixed", "pose": {"z": 0}},
        "world": {"gravity": 0, "objects": [pole]},
    }

    def swung(speed: float, seconds: float) -> str:
        turning = [{"at": 0, "velocity": {"swing": speed}}]
        return faulted(tmp_path, engine, **keys, commands={"rate": 240, "joints": turning}, time_limit=seconds)

    found = [swung(speed, 1.0) for speed in (29.0, 31.0, 33.0)]
    assert any(message.startswith("link 'rod' passed through body 'pole'") for message in found), found
    assert not swung(1.0, 2.0)


TERRAIN = {"heightfield": {"heights": [[0.2, 0.2, 0.2], [0.2, 0.25, 0.2], [0.2, 0.2, 0.2]], "size": [2, 2]}}


@on_every_engine
def test_a_ball_falls_through_no_terrain_unseen(engine: str, tmp_path: Path) -> None:
    """MuJoCo's terrain is solid down to 10 cm below its lowest sample: a ball in it touches it."""
    push = {"at": 0.0, "velocity": [0, 0, -60]}
    world = {"gravity": 0, "objects": [{"name": "hills", **TERRAIN, "pose": {"z": 0.5}}], "disturbances": [push]}
    ends = [
        ended(tmp_path, engine, robot=ball_at(0.3, z, 0.2), world=world, time_limit=0.05) for z in (0.83, 0.87, 0.92)
    ]
    assert not any(passed for _, passed in ends)
    missed = [message for message, _ in ends if message]
    assert all("passed through body 'hills' without" in message for message in missed)
    assert all("body 'hills' is a surface without thickness; set" in message for message in missed)
    assert bool(ends[2][0]) == (engine == "pybullet")


@on_every_engine
def test_speculative_contacts_stop_what_would_pass_through(engine: str, tmp_path: Path) -> None:
    shot = Shot(start=-0.55)
    with pytest.raises(MissedContact):
        robot_shot(tmp_path, engine, shot)
    if engine == "pybullet":
        with pytest.raises(BadStart, match="use backend: mujoco") as caught:
            robot_shot(tmp_path, engine, shot, speculative=True)
        assert [path for path, _ in caught.value.by_keys] == [("physics", "speculative")]
        return
    found = robot_shot(tmp_path, engine, shot, speculative=True)
    (verdict,) = found.verdicts
    assert not verdict.passed
    assert "wall" in verdict.message
    # It ends at the front of the wall, within a hundredth of its step.
    assert found.trace.base_position_xyz[:, 0].max() < -shot.thickness / 2 - shot.radius + 0.01 * shot.speed / shot.rate
