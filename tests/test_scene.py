"""What follows from a scenario and its model together: what is bolted, where it begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.models.urdf import read_urdf
from sim_action.scene import Scene
from sim_action.workspace import Workspace
from sim_action.world import Physics, Placement, Robot, World
from tests.models.bad_models import GOOD

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


def test_the_world_is_where_the_world_is(tmp_path: Path) -> None:
    world = GOOD.replace('"base"', '"world"')
    assert scene(tmp_path, world, pose={"x": 1}).placement == Placement(x=1, z=0)
    assert scene(tmp_path, world, pose={"z": 2}).placement == Placement(z=2)
    assert scene(tmp_path, world, base="free").placement == Placement()
    assert scene(tmp_path, base="fixed").placement == Placement()


def test_followers_begin_where_their_leader_wants_them(tmp_path: Path) -> None:
    there = scene(tmp_path, GOOD.replace("</robot>", f"{FOLLOWER}</robot>"), joints={"shoulder": 1.0})
    assert there.joint_positions == {"shoulder": 1.0, "bend": -1.5, "curl": -1.5}
