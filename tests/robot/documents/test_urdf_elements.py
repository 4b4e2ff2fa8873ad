"""What counts of <gazebo> tags: friction, springs, plugins."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.robot.model.robot_model import RobotModel, Surface
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.ros_workspace import written
from tests.work import work_of


def read(folder: Path, more: str) -> RobotModel:
    return read_urdf(written(folder / "robot.urdf", GOOD.replace("</robot>", f"{more}</robot>")))


def surface(folder: Path, more: str) -> Surface:
    return read(folder, f'<gazebo reference="upper">{more}</gazebo>').links_by_name["upper"].surface


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        # Bullet assumes this friction.
        ("<material>Gazebo/Blue</material>", Surface(0.5, None, 1.0)),
        ("<mu1>0.3</mu1>", Surface(0.3)),
        ("<mu1>0.3</mu1><mu2>0.7</mu2>", Surface(0.3)),
        ("<mu2> 0.7 </mu2>", Surface(0.7)),
        ('<mu1 value="0.2"/>', Surface(0.2)),
        ("<mu1>0</mu1>", Surface(0.0)),
        # There the lesser of two counts: as grippy as the ground.
        ("<mu1>100000.0</mu1>", Surface(1.0)),
        ("<kp>500000.0</kp><kd>10.0</kd>", Surface(0.5, 5e5, 10.0)),
    ],
)
def test_the_surface_of_a_link_is_read(tags: str, expected: Surface, tmp_path: Path) -> None:
    assert surface(tmp_path, tags) == expected


def test_the_contact_element_that_bullet_knows_says_the_same(tmp_path: Path) -> None:
    contact = '<contact><lateral_friction value="1.5"/><stiffness value="3000"/><damping value="7"/></contact>'
    text = GOOD.replace('<link name="upper">', f'<link name="upper">{contact}')
    path = written(tmp_path / "robot.urdf", text)
    assert read_urdf(path).links_by_name["upper"].surface == Surface(1.5, 3000.0, 7.0)
    path.write_text(text.replace("</robot>", '<gazebo reference="upper"><mu1>0.1</mu1></gazebo></robot>'))
    assert read_urdf(path).links_by_name["upper"].surface == Surface(0.1, 3000.0, 7.0)


def test_another_link_is_left_alone(tmp_path: Path) -> None:
    model = read(tmp_path, '<gazebo reference="upper"><mu1>0.1</mu1></gazebo><gazebo><mu1>0.9</mu1></gazebo>')
    assert model.links_by_name["base"].surface == Surface()


def test_plugins_keep_what_they_were_given(tmp_path: Path) -> None:
    model = read(
        tmp_path,
        '<gazebo><plugin name="drive" filename="libgazebo_ros_diff_drive.so">'
        "<leftJoint> a </leftJoint><joint>b</joint><joint>c</joint><empty/></plugin></gazebo>"
        '<gazebo reference="upper"><sensor><plugin filename="gz-sim-imu-system"/></sensor></gazebo>',
    )
    (drive,) = model.plugins
    assert (drive.name, drive.title) == ("gazebo_ros_diff_drive", "drive")
    assert drive.parameters == (("leftJoint", "a"), ("joint", "b"), ("joint", "c"), ("empty", ""))
    assert drive.texts("joint") == ("b", "c")
    assert drive.texts("rightJoint") == ()


def test_names_that_are_not_there_cost_what_they_take_to_write(tmp_path: Path) -> None:
    links = "".join(f'<link name="l{number}"/>' for number in range(100))
    ends = '<parent link="base"/><child link="l{0}"/>'
    joints = "".join(f'<joint name="to_{n}" type="fixed">{ends.format(n)}</joint>' for n in range(100))

    def work(count: int) -> int:
        return work_of(lambda: read(tmp_path, links + joints + '<gazebo reference="nope"/>' * count))

    work(1)  # what is done once is done
    # Looked for among the tags of each link, one more takes some thousand instructions, compared
    # with each name 70,000.
    assert (work(200) - work(100)) / 100 < 10_000


def test_only_the_first_names_that_are_not_there_are_told_what_there_is(tmp_path: Path) -> None:
    findings = read(tmp_path, '<gazebo reference="uper"/>' * 20).findings
    assert ["did you mean 'upper'?" in finding.message for finding in findings] == [True] * 10 + [False] * 10
