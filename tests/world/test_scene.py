"""What follows from a scenario and its model together: what is bolted, where it begins."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.scenario.loading import build_scene
from sim_action.sensors.contact import ContactSensor
from sim_action.sensors.lidar import Lidar
from sim_action.world import Physics, World
from sim_action.world.scene import Fitting, Scene
from tests.robot.bad_models import GOOD
from tests.scenarios import LEAST, load

FOLLOWER = """
<link name="finger"/>
<joint name="bend" type="prismatic"><parent link="upper"/><child link="finger"/>
  <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="shoulder" multiplier="-2" offset="0.5"/></joint>
<link name="tip"/>
<joint name="curl" type="revolute"><parent link="finger"/><child link="tip"/>
  <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="bend"/></joint>
"""


def scene(folder: Path, text: str = GOOD, **robot: Any) -> Scene:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    spec = Robot.model_validate({"model": "robot.urdf", **robot})
    return Scene(spec, read_urdf(path), World(), Physics(), Workspace(folder, folder))


@pytest.mark.parametrize(
    ("root", "base", "bolted"),
    [
        ("base", None, False),
        ("base", "fixed", True),
        ("world", None, True),
        ("world", "fixed", True),
        ("world", "free", False),
    ],
)
def test_a_base_is_bolted_by_the_scenario_or_else_by_its_name(
    root: str, base: str | None, bolted: bool, tmp_path: Path
) -> None:
    assert scene(tmp_path, GOOD.replace('"base"', f'"{root}"'), base=base).bolted is bolted


def test_links_fixed_to_a_base_that_cannot_move_cannot_either(tmp_path: Path) -> None:
    root = '<robot name="r"><link name="base">{}</link><link name="plate"/><link name="arm"/>'
    weld = '<joint name="weld" type="fixed"><parent link="base"/><child link="plate"/></joint>'
    turn = '<joint name="turn" type="continuous"><parent link="plate"/><child link="arm"/></joint></robot>'
    inertial = '<inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    urdf = root.format(inertial.format(2)) + weld + turn
    assert scene(tmp_path, urdf).bolted_links == frozenset()
    assert scene(tmp_path, urdf, base="fixed").bolted_links == {"base", "plate"}
    made = scene(tmp_path, urdf)
    base, *others = made.model.links
    # Engines fix a base without a mass.
    weightless = replace(made.model, links=(replace(base, mass=0.0), *others))
    assert replace(made, model=weightless).bolted_links == {"base", "plate"}
    # Nothing bears a load at a link without a mass.
    links = (base, *(replace(link, mass=1.0) for link in others), replace(base, name="tool", mass=None))
    assert [
        replace(scene(tmp_path, urdf, base=kind), model=replace(made.model, links=several)).load_link
        for kind in ("free", "fixed")
        for several in (links, made.model.links)
    ] == ["base", "base", "arm", "base"]


@pytest.mark.parametrize(("fingers", "loaded"), [(0, "palm"), (1, "finger0"), (2, "palm")])
def test_a_payload_loads_the_link_that_carries_the_fingers(fingers: int, loaded: str, tmp_path: Path) -> None:
    inertia = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    names = ["base", "arm", "palm", *(f"finger{number}" for number in range(fingers)), "camera"]
    links = "".join(f'<link name="{name}"><inertial>{inertia}</inertial></link>' for name in names)
    parents = {"arm": ("base", "continuous"), "palm": ("arm", "continuous"), "camera": ("arm", "fixed")}
    joint = '<joint name="to_{0}" type="{2}"><parent link="{1}"/><child link="{0}"/></joint>'
    joints = "".join(joint.format(name, *parents.get(name, ("palm", "continuous"))) for name in names[1:])
    assert scene(tmp_path, f'<robot name="r">{links}{joints}</robot>', base="fixed").load_link == loaded


def test_links_that_no_force_can_move_say_why(tmp_path: Path) -> None:
    moving = scene(tmp_path)
    assert moving.why_not_moved("upper") is moving.why_not_moved(moving.model.root) is None
    assert moving.why_not_moved("uppr") == (
        "the robot has no link 'uppr'; did you mean 'upper'? (allowed: base, upper)"
    )
    fixed = scene(tmp_path, base="fixed")
    assert fixed.why_not_moved("upper") is None
    assert fixed.why_not_moved("base") == "link 'base' is fixed to the world, so nothing moves it"
    ball = scene(tmp_path, GOOD.replace('"revolute"', '"spherical"', 1))
    part = ball.model.joints[0].name
    assert ball.why_not_moved(part) == f"'{part}' is a part of joint '{part[:-2]}', not a link of the model"


def test_the_world_is_where_the_world_is(tmp_path: Path) -> None:
    world = GOOD.replace('"base"', '"world"')
    assert scene(tmp_path, world, pose={"x": 1}).placement == Placement(x=1, z=0)
    assert scene(tmp_path, world, pose={"z": 2}).placement == Placement(z=2)
    assert scene(tmp_path, world, base="free").placement == Placement()
    assert scene(tmp_path, base="fixed").placement == Placement()


@pytest.mark.parametrize(
    ("limits", "home"),
    [
        ('lower="-1" upper="2"', 0),
        ('lower="0" upper="2"', 0),
        ('lower="-2.7" upper="-0.9"', -1.8),
        ('lower="0.5" upper="1.5"', 1.0),
        ('lower="0.5" upper="0.5"', 0.5),
        ('lower="0.5" upper="1e16"', 0.5),
        ('lower="-1e16" upper="-0.5"', -0.5),
        ('lower="-1e16" upper="0.5"', 0),
        ('lower="-1e16" upper="1e16"', 0),
        ('upper="1.5"', 0),
        ('lower="-1.5"', 0),
    ],
)
def test_a_joint_that_cannot_be_at_zero_begins_amid_its_limits(limits: str, home: float, tmp_path: Path) -> None:
    text = GOOD.replace('lower="-1" upper="2"', limits)
    assert scene(tmp_path, text).joint_positions == {"shoulder": pytest.approx(home)}
    assert scene(tmp_path, text, joints={"shoulder": 0.5}).joint_positions == {"shoulder": 0.5}


def test_limits_that_are_the_wrong_way_round_move_nothing(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(GOOD.replace('lower="-1" upper="2"', 'lower="2" upper="1"'))
    assert read_urdf(path, allow=["reversed-limits"]).joints[0].home == 0


def test_followers_begin_where_their_leader_wants_them(tmp_path: Path) -> None:
    there = scene(tmp_path, GOOD.replace("</robot>", f"{FOLLOWER}</robot>"), joints={"shoulder": 1.0})
    assert there.joint_positions == {"shoulder": 1.0, "bend": -1.5, "curl": -1.5}


def test_what_is_drawn_at_random_depends_on_seed_and_purpose_alone(tmp_path: Path) -> None:
    first, second = (replace(scene(tmp_path), seed=seed) for seed in (1, 2))
    drawn = first.generator("scan").random(3).tolist()
    first.generator("imu").random(7)
    assert first.generator("scan").random(3).tolist() == drawn
    assert first.generator("imu").random(3).tolist() != drawn
    assert second.generator("scan").random(3).tolist() != drawn


def test_a_scene_knows_where_the_sensors_of_its_scenario_sit(tmp_path: Path) -> None:
    lidar = "{lidar: {rays: 90}, link: base_scan, rate: 5 Hz, pose: {z: 0.1 m}}"
    loaded = load(tmp_path, f"{LEAST}sensors: [{lidar}, contact]\n")
    assert build_scene(loaded).sensors == (
        Fitting("lidar", "lidar", "base_scan", 5.0, Pose((0.0, 0.0, 0.1)), Lidar(rays=90)),
        Fitting("contact", "contact", "base_footprint", 10.0, Pose(), ContactSensor()),
    )
