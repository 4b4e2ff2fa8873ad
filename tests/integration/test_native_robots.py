"""Robots in MuJoCo's own format, simulated, with masses that <compiler> changes."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import ClearanceWatch
from sim_action.world import GRAVITY, Body, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, push, running, scene_of_file, travelled
from tests.robot.reading.mjcf.test_mjcf_reader import ARM, ROVER
from tests.simulated import simulated

mujoco: Any = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")

# One that stands on four feet, with a spring in each leg.
_LEGS = "".join(
    f"""<body pos="{x} {y} -0.05"><joint type="slide" axis="0 0 1" range="-0.2 0.2" stiffness="400" damping="20"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.03" mass="0.3"/></body>"""
    for x in (-0.2, 0.2)
    for y in (-0.1, 0.1)
)
TABLE = f"""<mujoco model="table"><worldbody><body name="top"><freejoint/>
  <geom type="box" size="0.3 0.2 0.05" mass="5"/>{_LEGS}</body></worldbody></mujoco>"""


def scene(folder: Path, text: str, world: World | None = None, **robot: Any) -> Scene:
    return scene_of_file(folder, "robot.xml", text, world, **robot)


def test_a_rover_drives_as_far_as_its_wheels_turn_and_stops_at_a_wall(tmp_path: Path) -> None:
    wall = Body(name="wall", box=(0.1, 2, 1), pose=Placement(x=3))
    rover = scene(tmp_path, ROVER, World(objects=(wall,)))
    ramp = [JointTargets(velocity=dict.fromkeys(("left", "right"), 5.0 * step / 240)) for step in range(241)]
    with running("mujoco", rover, contacts=True) as backend:
        start = backend.observe(0, contacts=False).pose.position_xyz
        trace = advance(backend, 0, 960, *ramp)
        later = advance(backend, 960, 960)
    assert start == pytest.approx((0, 0, 0.1), abs=1e-6)
    assert trace.base_position_xyz[-1, 0] == pytest.approx(0.5 * (4 - 0.5), rel=0.005)
    assert trace.contacts == ()
    assert {(contact.link, contact.body) for contact in later.contacts} == {
        (wheel, "wall") for wheel in ("left_wheel", "right_wheel", "chassis")
    }
    assert later.base_position_xyz[:, 0].max() < 2.95 - 0.2 + 0.01


def test_how_near_a_rover_comes_is_seen_also_where_nobody_knows_how_far_a_turn_takes_it(tmp_path: Path) -> None:
    wall = Body(name="wall", box=(0.1, 2, 1), pose=Placement(x=3))
    rover = scene(tmp_path, ROVER, World(objects=(wall,)))
    curve = JointTargets(velocity={"left": 5.0, "right": 4.5})
    least, always = ClearanceWatch(), ClearanceWatch(always=True)
    trace = travelled("mujoco", rover, 480, curve, clearances=[least, always])
    every = trace.clearances[always]
    assert len(every) == len(trace)
    assert every.distance[-1] < every.distance[0] - 0.5
    assert trace.clearances[least].distance[-1] == every.distance.min()


def test_what_the_ground_carries_is_the_mass_of_the_file(tmp_path: Path) -> None:
    table = scene(tmp_path, TABLE)
    with running("mujoco", table) as backend:
        trace = advance(backend, 0, 960)
        contacts = backend.observe(960, contacts=True).contacts
    assert sum(contact.force for contact in contacts) == pytest.approx(6.2 * GRAVITY, rel=0.005)
    assert trace.tilt[-1] < 1e-3
    # Its legs are held where they began, as servos of joints between limits are.
    assert trace.base_position_xyz[-1, 2] == pytest.approx(0.05 + 0.25 + 0.03, abs=1e-3)


def test_an_arm_stays_where_it_is_bolted_and_goes_where_it_is_told(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM)
    with running("mujoco", arm) as backend:
        start = backend.observe(0, contacts=False)
        trace = advance(backend, 0, 480, JointTargets(position={"shoulder": 0.5, "joint_2": 0.05}))
    assert start.pose.position_xyz == (0, 0, 0)
    assert not trace.base_linear_xyz.any()
    end = dict(zip(trace.joint_names, trace.joint_position[-1], strict=True))
    assert end["shoulder"] == pytest.approx(0.5, abs=1e-3)
    assert end["joint_2"] == pytest.approx(0.05, abs=1e-3)
    assert end["other"] == pytest.approx(0.01 + 0.02 * 0.5, abs=1e-3)


@pytest.mark.parametrize(("text", "base", "falls"), [(ROVER, "fixed", False), (ARM, "free", True)])
def test_the_scenario_says_whether_it_is_free(text: str, base: str, falls: bool, tmp_path: Path) -> None:
    robot = scene(tmp_path, text, base=base, pose=Placement(z=50))
    with running("mujoco", robot) as backend:
        trace = advance(backend, 0, 240)
        if falls:
            push(backend, (1, 0, 0))
    assert (trace.base_linear_xyz[-1, 2] < -5) == falls
    assert trace.base_position_xyz[0, 2] == pytest.approx(50, abs=0.01)


def test_a_scenario_runs_it(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(ROVER, encoding="utf-8")
    robot = "name: rover\nrobot: {model: robot.xml}\ncommands: {twist: [{linear: 0.5}]}\n"
    ends = "expect: [{travel: {at_least: 1 m}}, upright]\nbackend: mujoco\ntime_limit: 10 s\n"
    run = simulated(tmp_path, robot + ends)
    assert all(verdict.passed for verdict in run.verdicts)
    # The velocity servo of the left wheel is so stiff for a step of 1 / 240 s that the wheels slip at the start.
    assert run.sim_time == pytest.approx(2.25, abs=0.03)


def test_rays_meet_no_part_of_a_robot_whether_it_touches_or_is_only_seen(tmp_path: Path) -> None:
    seen = "".join(
        f'<geom type="sphere" pos="0 0 {0.2 + 0.1 * group}" size="0.1" group="{group}" contype="0" conaffinity="0"/>'
        for group in range(6)
    )
    wall = Body(name="wall", box=(0.1, 2, 4), pose=Placement(x=1))
    table = scene(tmp_path, TABLE.replace("<freejoint/>", f"<freejoint/>{seen}"), World(objects=(wall,)))
    with running("mujoco", table) as backend:
        for height in np.linspace(0.05, 1.2, 30):
            (share,) = backend.cast_rays((-1, 0, height), np.array([[1, 0, height]]))
            assert share == pytest.approx(0.975)


ROBOT = """<mujoco model="r"><compiler {}/><worldbody><body name="base" pos="0 0 .1"><freejoint/>
  <geom type="box" size=".2 .2 .1" mass="5"/><geom type="sphere" pos=".5 0 0" size=".1" density="200" group="2"/>
  <body name="arm" pos="0 0 .3"><joint name="j" axis="0 1 0"/>
    <inertial pos="0 0 .1" mass="2" fullinertia=".2 .1 .25 .01 0 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 .1" size=".03"/></body>
  <body name="tip" pos="0 0 .6"><joint name="k" axis="0 1 0"/>
    <inertial pos="0 0 0" mass=".001" diaginertia="1 .1 .1"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    "compiler",
    [
        'balanceinertia="true"',
        'settotalmass="20" balanceinertia="true"',
        'boundmass="0.5" balanceinertia="true"',
        'boundinertia="0.5" balanceinertia="true"',
        'inertiafromgeom="true" boundmass="0.1" boundinertia="0.1" balanceinertia="true"',
        'inertiagrouprange="1 3" balanceinertia="true"',
    ],
)
def test_a_compiler_that_changes_masses_gives_one_model_to_the_reader_and_the_engine(
    compiler: str, tmp_path: Path
) -> None:
    robot = scene(tmp_path, ROBOT.format(compiler))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain = mujoco.MjModel.from_xml_string(ROBOT.format(compiler))
    assert [link.mass for link in robot.model.links] == pytest.approx(plain.body_mass[1:])
    with running("mujoco", robot) as engine:
        model = engine._compiled.model  # type: ignore[attr-defined]  # of MuJoCo alone
        assert model.body_mass[1:] == pytest.approx(plain.body_mass[1:])
        assert np.allclose(model.body_inertia[1:], plain.body_inertia[1:])
        assert np.allclose(model.body_ipos[1:], plain.body_ipos[1:])


CUBE = ((0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4))
LAST = ((1, 5, 7), (1, 7, 3))


def cube(faces: tuple[tuple[int, ...], ...], attributes: str = "") -> str:
    """Return a robot with a mesh of a cube of 0.2 m: 8 kg."""
    vertices = " ".join(f"{x} {y} {z}" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1))
    triangles = " ".join(str(corner) for face in faces for corner in face)
    return f"""<mujoco><asset><mesh name="m" vertex="{vertices}" face="{triangles}" {attributes}/></asset><worldbody>
      <body name="b"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("faces", "attributes", "is_odd"),
    [
        (CUBE + LAST, "", False),
        (CUBE + LAST[:1], "", True),
        (CUBE + LAST + tuple(face[::-1] for face in CUBE + LAST), "", True),
        (CUBE + LAST[:1], 'inertia="convex"', False),
    ],
)
def test_a_mesh_that_is_not_closed_is_named_with_the_mass_of_its_hull(
    faces: tuple[tuple[int, ...], ...], attributes: str, is_odd: bool, tmp_path: Path
) -> None:
    robot = scene(tmp_path, cube(faces, attributes))
    found = [str(finding.message) for finding in robot.model.findings if finding.rule == "open-mesh"]
    assert len(found) == is_odd
    assert not is_odd or "8 kg with its convex hull" in found[0]


def test_belts_stand_still_until_the_scenario_begins(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body name="base" pos="0 0 .1"><freejoint/>
      <geom name="belt" type="box" size=".3 .2 .1" mass="5" surfacevel="-0.5 0 0"/></body></worldbody></mujoco>"""
    robot = scene(tmp_path, text)
    assert [finding.rule for finding in robot.model.findings] == ["moving-surface"]
    with running("mujoco", robot) as engine:
        before = advance(engine, -240, 240)
        after = advance(engine, 0, 480)
    assert abs(before.base_position_xyz[-1, 0]) < 1e-3
    assert after.base_position_xyz[-1, 0] == pytest.approx(1.0, abs=0.05)
