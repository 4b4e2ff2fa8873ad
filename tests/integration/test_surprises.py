"""Cases of docs/engines/surprises.md in which an engine alone, or another reader, does what few people expect."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.engines import ENGINES
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import Channels
from sim_action.world import World
from tests.integration.engines import advance, at, inertia, on_every_engine, one_link, running, scene_of, travelled
from tests.worlds import with_files

RATE = 240
LINK = '<link name="{name}"><inertial>{origin}<mass value="1"/>{inertia}</inertial></link>'


def link(name: str, origin: str = "") -> str:
    return LINK.format(name=name, origin=origin and f'<origin xyz="{origin}"/>', inertia=inertia(0.01))


def joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.5"/>{more}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="it">{"".join(parts)}</robot>'


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
    text = robot(link("base"), link("child", "0.3 0.2 0.1"), joint("j", kind, "base", "child"))
    scene = scene_of(tmp_path, text, at(z=3.0), World(gravity=(0.0, 0.0, 0.0)))
    with running(engine, scene) as backend:
        child = backend.observe(0, contacts=False).links["child"].pose
        base = backend.observe(0, contacts=False).pose
        advance(backend, 0, 1)
    moved = np.subtract(child.position_xyz, base.position_xyz)
    assert moved == pytest.approx((0.1, 0.2, 0.5), abs=1e-5)


@on_every_engine
def test_a_plate_turns_with_the_inertia_of_its_file(engine: str, tmp_path: Path) -> None:
    # 0.1 + 0.7 is a little less than 0.8 in binary: Bullet alone takes 0.
    plate = (
        '<link name="plate"><inertial><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.7" izz="0.8" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    turning = joint("j", "continuous", "world", "plate", '<axis xyz="0 0 1"/><limit effort="9" velocity="9"/>')
    scene = scene_of(tmp_path, robot('<link name="world"/>', plate, turning), at())
    trace = travelled(engine, scene, RATE, JointTargets(effort={"j": 0.4}))
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.4 / 0.8, rel=0.01)


@on_every_engine
def test_a_joint_that_mimics_a_mimicking_joint_moves(engine: str, tmp_path: Path) -> None:
    limit = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/>'
    text = robot(
        '<link name="world"/>', link("a"), link("b"), link("c"),
        joint("first", "revolute", "world", "a", limit),
        joint("second", "revolute", "world", "b", f'{limit}<mimic joint="first" multiplier="0.5"/>'),
        joint("third", "revolute", "world", "c", f'{limit}<mimic joint="second" multiplier="-2"/>'),
    )  # fmt: skip
    trace = travelled(engine, scene_of(tmp_path, text, at()), 2 * RATE, JointTargets(position={"first": 0.8}))
    positions = dict(zip(trace.joint_names, trace.joint_position[-1], strict=True))
    assert positions["first"] == pytest.approx(0.8, abs=0.01)
    assert positions["second"] == pytest.approx(0.4, abs=0.01)
    assert positions["third"] == pytest.approx(-0.8, abs=0.02)


CUBE = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
         (1, 5, 7), (1, 7, 3)]  # fmt: skip


def stl(*, turned: bool, left_out: int = 0) -> bytes:
    faces = [face[::-1] if turned else face for face in FACES[left_out:]]
    rows = [struct.pack("<12fH", 0, 0, 0, *(value for corner in face for value in CUBE[corner]), 0) for face in faces]
    return bytes(80) + struct.pack("<I", len(faces)) + b"".join(rows)


@on_every_engine
def test_a_mesh_weighs_and_turns_as_its_hull_whichever_way_its_faces_look(engine: str, tmp_path: Path) -> None:
    motions = []
    for turned, left_out in ((False, 0), (True, 0), (False, 1)):
        (tmp_path / "cube.stl").write_bytes(stl(turned=turned, left_out=left_out))
        cube = {"name": "cube", "mesh": {"file": "cube.stl"}, "mass": 2.0, "pose": {"x": 1.0, "z": 0.3, "roll": 0.3}}
        world = World.model_validate({"objects": (cube,)})
        scene = with_files(scene_of(tmp_path, one_link('<sphere radius="0.1"/>'), at(z=0.1), world))
        backend = ENGINES[engine].load()(scene, Channels(objects=frozenset({"cube"})))
        try:
            motions.append(advance(backend, 0, RATE).objects["cube"])
        finally:
            backend.close()
    for other in motions[1:]:
        assert other.position_xyz == pytest.approx(motions[0].position_xyz, abs=1e-6)
        assert other.orientation_xyzw == pytest.approx(motions[0].orientation_xyzw, abs=1e-6)


@on_every_engine
def test_rays_meet_the_ground_wherever_it_carries(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, one_link('<sphere radius="0.1"/>'), at(z=0.1))) as backend:
        for x in (0.0, 30.0, 3000.0):
            assert backend.cast_rays((x, 1.0, 1.0), np.array([(x, 1.0, -1.0)])) == pytest.approx([0.5], abs=1e-3)
