"""SDF in the engine: a robot of several files drives, a pendulum swings, and what comes with PyBullet is told of."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from sim_action.core.errors import ModelError, RefusedModel
from sim_action.core.field_types import Placement
from sim_action.core.workspace import Workspace
from sim_action.engines import chosen
from sim_action.robot.model.findings import ALLOWABLE
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import JointTargets, LinkWrench
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, World
from tests.integration.conftest import sim_action
from tests.integration.engines import on_every_engine, scene_of_file, travelled
from tests.robot.reading.sdf.models import INERTIAL, joint, link, sdf
from tests.ros_workspace import written
from tools.bench.robots import DATA

# Poses as people write them in SDF: from the ground, with the wheels' axes along their own z.
ROVER = """\
<?xml version="1.0"?>
<sdf version="1.8">
  <model name="rover">
    <link name="chassis">
      <pose>0 0 0.08 0 0 0</pose>
      <inertial><mass>0.8</mass><inertia><ixx>0.003</ixx><iyy>0.003</iyy><izz>0.003</izz></inertia></inertial>
      <collision name="body"><geometry><box><size>0.14 0.14 0.1</size></box></geometry></collision>
    </link>
    <link name="caster">
      <pose>-0.08 0 0.01 0 0 0</pose>
      <inertial><mass>0.01</mass><inertia><ixx>4e-7</ixx><iyy>4e-7</iyy><izz>4e-7</izz></inertia></inertial>
      <collision name="ball">
        <geometry><sphere><radius>0.01</radius></sphere></geometry>
        <surface><friction><ode><mu>0</mu><mu2>0</mu2></ode></friction></surface>
      </collision>
    </link>
    <joint name="caster_joint" type="fixed"><parent>chassis</parent><child>caster</child></joint>
    <include>
      <uri>model://rover_wheel</uri>
      <name>left</name>
      <pose>0 0.08 0.033 -1.5707963267948966 0 0</pose>
    </include>
    <include>
      <uri>model://rover_wheel</uri>
      <name>right</name>
      <pose>0 -0.08 0.033 -1.5707963267948966 0 0</pose>
    </include>
    <joint name="left_wheel_joint" type="revolute">
      <parent>chassis</parent><child>left::rim</child><axis><xyz>0 0 1</xyz></axis>
    </joint>
    <joint name="right_wheel_joint" type="revolute">
      <parent>chassis</parent><child>right::rim</child><axis><xyz>0 0 1</xyz></axis>
    </joint>
    <model name="mast">
      <pose relative_to="chassis">0 0 0.05 0 0 0</pose>
      <link name="pole">
        <inertial><pose>0 0 0.05 0 0 0</pose><mass>0.05</mass>
          <inertia><ixx>4e-5</ixx><iyy>4e-5</iyy><izz>1e-5</izz></inertia></inertial>
        <collision name="c"><pose>0 0 0.05 0 0 0</pose>
          <geometry><cylinder><radius>0.01</radius><length>0.1</length></cylinder></geometry></collision>
      </link>
    </model>
    <joint name="mast_joint" type="fixed"><parent>chassis</parent><child>mast::pole</child></joint>
    <plugin filename="libgazebo_ros_diff_drive.so" name="drive">
      <left_joint>left_wheel_joint</left_joint>
      <right_joint>right_wheel_joint</right_joint>
      <wheel_separation>0.16</wheel_separation>
      <wheel_diameter>0.066</wheel_diameter>
    </plugin>
  </model>
</sdf>
"""
WHEEL = """\
<sdf version="1.6"><model name="wheel"><link name="rim">
  <inertial><mass>0.03</mass><inertia><ixx>8.5e-6</ixx><iyy>8.5e-6</iyy><izz>1.6e-5</izz></inertia></inertial>
  <collision name="tyre">
    <geometry><cylinder><radius>0.033</radius><length>0.004</length></cylinder></geometry>
  </collision>
</link></model></sdf>
"""
SCENARIO = """\
name: rover drives straight
robot: {model: models/rover.sdf}
commands: {rate: 10 Hz, twist: [{linear: 0.5}]}
expect:
  - travel: {at_least: 1.5 m}
  - upright: {max_tilt: 5 deg}
  - no_collision
time_limit: 5 s
"""


def rover(folder: Path) -> Path:
    written(folder / "models/rover.sdf", ROVER)
    written(folder / "models/rover_wheel/model.config", "<model><sdf version='1.6'>wheel.sdf</sdf></model>")
    written(folder / "models/rover_wheel/wheel.sdf", WHEEL)
    written(folder / "drive.sim.yml", SCENARIO)
    return folder


def test_a_robot_of_several_files_drives(tmp_path: Path) -> None:
    ran = sim_action(rover(tmp_path), "run", "--verbose")
    assert ran.returncode == 0, ran.stdout


def moved(folder: Path, text: str, rate: float, steps: int, *targets: JointTargets, **robot: Any) -> Trace:
    scene = scene_of_file(folder, "robot.sdf", text, rate=rate, **robot)
    return travelled(chosen("auto"), scene, steps, *targets)


def hanging(pose: str, hinge: str, centre: str) -> str:
    """A pendulum of 1 m on a base in the world, whose bob has its link's frame wherever `pose` says."""
    inertia = "<inertia><ixx>1e-6</ixx><iyy>1e-6</iyy><izz>1e-6</izz></inertia>"
    bob = f'<link name="bob">{pose}<inertial><pose>{centre}</pose><mass>1</mass>{inertia}</inertial></link>'
    axis = "<axis><xyz expressed_in='__model__'>0 1 0</xyz></axis>"
    hook = f'<link name="hook">{INERTIAL}</link>'
    return sdf(
        "<pose>0 0 3 0 0 0</pose>",
        hook,
        bob,
        joint("up", "world", "hook"),
        joint("hinge", "hook", "bob", f"{hinge}{axis}", "continuous"),
    )


@pytest.mark.parametrize(
    ("pose", "hinge", "centre"),
    [
        ("", "", "0 0 -1 0 0 0"),
        # The bob's frame is in its middle, and turned; the joint is 1 m from it.
        ("<pose>0 0 -1 0 0 0</pose>", "<pose>0 0 1 0 0 0</pose>", "0 0 0 0 0 0"),
        (f"<pose>0 0 -1 0 {math.pi / 2} 0</pose>", "<pose relative_to='hook'/>", "0 0 0 1 2 3"),
        ("<pose>0.5 0.25 0 0 0 0</pose>", "<pose relative_to='hook'/>", "-0.5 -0.25 -1 0 0 0"),
    ],
)
def test_a_pendulum_swings_alike_wherever_its_frames_are(pose: str, hinge: str, centre: str, tmp_path: Path) -> None:
    trace = moved(tmp_path, hanging(pose, hinge, centre), 1000, 4000, joints={"hinge": 0.1})
    angle = trace.joint_position[:, 0]
    crossings = trace.time[1:][(angle[:-1] < 0) & (angle[1:] >= 0)]
    assert np.diff(crossings) == pytest.approx(2 * math.pi * math.sqrt(1 / GRAVITY) * (1 + 0.1**2 / 16), rel=0.002)
    assert trace.base_position_xyz[-1] == pytest.approx((0, 0, 0)), "the world stays where it is"


def test_a_slider_without_limits_slides(tmp_path: Path) -> None:
    text = sdf(
        link("rail"),
        link("cart"),
        joint("up", "world", "rail"),
        joint("slide", "rail", "cart", "<axis><xyz>1 0 0</xyz></axis>", "prismatic"),
    )
    trace = moved(tmp_path, text, 240, 240, JointTargets(velocity={"slide": 2.0}), pose=Placement(z=1))
    assert trace.joint_position[-1, 0] == pytest.approx(2.0, rel=0.02)


@on_every_engine
def test_links_without_inertial_are_simulated_with_the_mass_that_is_reported(engine: str, tmp_path: Path) -> None:
    """A base of 1 kg and a welded sensor 0.5 m to each side, all with moments of 1: F / m, and M / (3 + 2 m r^2)."""
    bare = [f'<link name="{name}"><pose>0 {y} 0 0 0 0</pose></link>' for name, y in (("left", 0.5), ("right", -0.5))]
    joints = joint("l", "base", "left"), joint("r", "base", "right")
    world = World.model_validate({"gravity": (0.0, 0.0, 0.0)})
    text = sdf(link("base"), *bare, *joints)
    scene = scene_of_file(tmp_path, "robot.sdf", text, world, rate=1000, pose=Placement(z=5.0))
    pull = JointTargets(wrenches=(LinkWrench("base", (6.0, 0.0, 0.0), (0.0, 0.0, 0.7)),))
    trace = travelled(engine, scene, 1, pull)
    assert scene.model.mass == 3.0
    assert trace.base_linear_xyz[-1] == pytest.approx((6 / scene.model.mass / 1000, 0, 0), rel=1e-6)
    assert trace.base_angular_xyz[-1] == pytest.approx((0, 0, 0.7 / 3.5 / 1000), rel=1e-6)


def sdf_files() -> list[str]:
    return sorted(str(path.relative_to(DATA)) for path in DATA.rglob("*.sdf"))


def named(model: Path) -> RobotModel:
    workspace = Workspace(model.parent, model.parent, allow_outside=True)
    return load_model(Robot(model=str(model), allow=ALLOWABLE), workspace)


@pytest.mark.parametrize("name", sdf_files())
def test_a_world_is_refused_in_clear_words(name: str) -> None:
    told = r"sdf:[0-9]+: this SDF describes a world with the models '.*name file and robot in the section world"
    with pytest.raises(RefusedModel, match=told):
        named(DATA / name)


OUTCOMES: Final = {
    "plane_stadium.sdf": ["<plane> is not supported"],
    "stadium.sdf": ["", "<plane> is not supported", ""],
    "stadium_no_collision.sdf": ["", "<plane> is not supported", ""],
    "kuka_iiwa/kuka_world.sdf": ["'meshes/coarse/link_0.stl' does not exist"],
    "kuka_iiwa/model2.sdf": ["'meshes/coarse/link_0.stl' does not exist"] * 2,
    "kuka_iiwa/kuka_with_gripper.sdf": ["'/meshes/link_0.stl' does not exist"],
    "kuka_iiwa/kuka_with_gripper2.sdf": ["'/meshes/link_0.stl' does not exist"],
}
"""What is said of the models in each, once they are moved out; all others load."""


@pytest.mark.parametrize("name", sdf_files())
def test_its_models_load_or_are_refused_once_they_are_moved_out(name: str, tmp_path: Path) -> None:
    text = (DATA / name).read_text(encoding="utf-8")
    models = re.findall(r"(?s)<model.*?</model>", text)
    expected = OUTCOMES.get(name, [""] * len(models))
    for folder in (DATA / name).parent.iterdir():
        if folder.is_dir() or folder.suffix in {".obj", ".stl"}:
            (tmp_path / folder.name).symlink_to(folder)
    for model, said in zip(models, expected, strict=True):
        path = written(tmp_path / "robot.sdf", f'<sdf version="1.6">{model}</sdf>')
        if said:
            with pytest.raises(ModelError, match=re.escape(said)):
                named(path)
        else:
            stated = sum(float(mass.text or "") for mass in ET.fromstring(model).iterfind("link/inertial/mass"))
            assert named(path).mass == pytest.approx(stated)
