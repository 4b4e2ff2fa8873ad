"""Cases of docs/engines/surprises.md in which an engine alone, or another reader, does what few people expect."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world import World
from tests.integration.engines import BALL, advance, at, on_every_engine, one_link, running, scene_of, travelled
from tests.mesh_files import TRIANGLES, stl
from tests.physics.robots import inertial, joint, link, robot
from tests.worlds import with_files

RATE = 240
AT = (0.1, 0.2, 0.5)  # m, of a joint
Z = (0.0, 0.0, 1.0)
MOMENTS = (0.01,) * 3
WORLD = '<link name="world"/>'


@on_every_engine
def test_a_box_on_a_slope_that_friction_holds_creeps_by_less_than_a_millimetre(engine: str, tmp_path: Path) -> None:
    slope = math.radians(30)
    ramp = {"name": "ramp", "box": (4.0, 4.0, 0.2), "friction": 1.0, "pose": {"z": 2.0, "pitch": slope}}
    across = 0.1 + 0.05
    spec = Robot(
        model="robot.urdf", pose=Placement(x=across * math.sin(slope), z=2 + across * math.cos(slope), pitch=slope)
    )
    box = one_link('<box size="0.2 0.2 0.1"/>', "", mass=2).replace(
        '<link name="it">', '<link name="it"><contact><lateral_friction value="1"/></contact>'
    )
    trace = travelled(engine, scene_of(tmp_path, box, spec, World.model_validate({"objects": (ramp,)})), 5 * RATE)
    first, last = trace.base_position_xyz[RATE], trace.base_position_xyz[-1]
    assert math.dist(first, last) < 1e-3


@on_every_engine
@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_child_begins_where_the_joint_is_wherever_its_mass_is(engine: str, kind: str, tmp_path: Path) -> None:
    aside = link("child", inertial(1.0, MOMENTS, (0.3, 0.2, 0.1)))
    text = robot(link("base", inertial(1.0, MOMENTS)), aside, joint("j", kind, "base", "child", AT, axis=Z))
    scene = scene_of(tmp_path, text, at(z=3.0), World(gravity=(0.0, 0.0, 0.0)))
    with running(engine, scene) as backend:
        child = backend.observe(0, contacts=False).links["child"].pose
        base = backend.observe(0, contacts=False).pose
        advance(backend, 0, 1)
    moved = np.subtract(child.position_xyz, base.position_xyz)
    assert moved == pytest.approx(AT, abs=1e-5)


@on_every_engine
def test_a_plate_turns_with_the_inertia_of_its_file(engine: str, tmp_path: Path) -> None:
    # 0.1 + 0.7 is a little less than 0.8 in binary: Bullet alone takes 0.
    plate = link("plate", inertial(1.0, (0.1, 0.7, 0.8)))
    turning = joint("j", "continuous", "world", "plate", AT, axis=Z, limit='effort="9" velocity="9"')
    scene = scene_of(tmp_path, robot(WORLD, plate, turning), at())
    trace = travelled(engine, scene, RATE, JointTargets(effort={"j": 0.4}))
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.4 / 0.8, rel=0.01)


@on_every_engine
def test_a_joint_that_mimics_a_mimicking_joint_moves(engine: str, tmp_path: Path) -> None:
    limit = 'lower="-3" upper="3" effort="9" velocity="9"'
    mimics = {"a": "", "b": 'joint="a" multiplier="0.5"', "c": 'joint="b" multiplier="-2"'}
    links = [link(f"of {name}", inertial(1.0, MOMENTS)) for name in mimics]
    joints = [
        joint(name, "revolute", "world", f"of {name}", AT, axis=Z, limit=limit, mimic=mimic)
        for name, mimic in mimics.items()
    ]
    text = robot(WORLD, *links, *joints)
    trace = travelled(engine, scene_of(tmp_path, text, at()), 2 * RATE, JointTargets(position={"a": 0.8}))
    positions = dict(zip(trace.joint_names, trace.joint_position[-1], strict=True))
    assert positions["a"] == pytest.approx(0.8, abs=0.01)
    assert positions["b"] == pytest.approx(0.4, abs=0.01)
    assert positions["c"] == pytest.approx(-0.8, abs=0.02)


@on_every_engine
def test_a_mesh_weighs_and_turns_as_its_hull_whichever_way_its_faces_look(engine: str, tmp_path: Path) -> None:
    motions = []
    for faces in (TRIANGLES, [face[::-1] for face in TRIANGLES], TRIANGLES[1:]):
        (tmp_path / "box.stl").write_bytes(stl(faces=faces))
        body = {"name": "box", "mesh": {"file": "box.stl"}, "mass": 2.0, "pose": {"x": 2.0, "z": 0.6, "roll": 0.3}}
        scene = with_files(scene_of(tmp_path, BALL, at(z=0.1), World.model_validate({"objects": (body,)})))
        with running(engine, scene, objects=["box"]) as backend:
            motions.append(advance(backend, 0, RATE).objects["box"])
    for other in motions[1:]:
        assert other.position_xyz == pytest.approx(motions[0].position_xyz, abs=1e-6)
        assert other.orientation_xyzw == pytest.approx(motions[0].orientation_xyzw, abs=1e-6)


@on_every_engine
def test_rays_meet_the_ground_wherever_it_carries(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, BALL, at(z=0.1))) as backend:
        for x in (0.0, 30.0, 3000.0):
            assert backend.cast_rays((x, 1.0, 1.0), np.array([(x, 1.0, -1.0)])) == pytest.approx([0.5], abs=1e-3)


def test_half_a_step_shows_that_a_flat_landing_on_the_plane_of_bullet_tips(tmp_path: Path) -> None:
    box = one_link('<box size="0.15 0.15 0.16"/>', "", mass=1.5)
    tilts = [
        np.degrees(travelled("pybullet", scene_of(tmp_path, box, at(z=0.3), rate=rate), 2 * round(rate)).tilt.max())
        for rate in (240.0, 480.0)
    ]
    assert tilts[0] > 3
    assert abs(tilts[0] - tilts[1]) > 1
