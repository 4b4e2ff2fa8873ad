"""The parts of <gazebo> tags that are not simulated are named, and misspelled ones are found."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.ros_workspace import written


def read(folder: Path, more: str) -> RobotModel:
    return read_urdf(written(folder / "robot.urdf", GOOD.replace("</robot>", f"{more}</robot>")))


def findings(folder: Path, more: str) -> tuple[Finding, ...]:
    return read(folder, more).findings


def rules(folder: Path, more: str) -> list[str]:
    return [found.rule for found in findings(folder, more)]


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        ("<turnGravityOff>true</turnGravityOff>", "<turnGravityOff>false</turnGravityOff>"),
        ('<turnGravityOff value="true"/>', '<turnGravityOff value="false"/>'),
        ("<gravity>0</gravity>", "<gravity>1</gravity>"),
        ("<selfCollide>True</selfCollide>", "<selfCollide>false</selfCollide>"),
        ("<self_collide>1</self_collide>", "<self_collide>0</self_collide>"),
        ("<dampingFactor>0.3</dampingFactor>", "<dampingFactor>0.0</dampingFactor>"),
        ("<maxVel>0.1</maxVel>", "<maxVel>0.01</maxVel>"),
        ("<fdir1>1 0 0</fdir1>", "<fdir1>0 0 0</fdir1>"),
        ("<dampingFactor>${damping}</dampingFactor>", "<laserRetro>1</laserRetro>"),
    ],
)
def test_parts_of_a_link_that_are_not_simulated(odd: str, usual: str, tmp_path: Path) -> None:
    assert rules(tmp_path, f'<gazebo reference="upper">{odd}</gazebo>') == ["passed-over"]
    assert rules(tmp_path, f'<gazebo reference="upper">{usual}<material>Gazebo/Blue</material></gazebo>') == []


def test_parts_without_an_effect_on_the_motion_are_not_named(tmp_path: Path) -> None:
    feedback = "<provideFeedback>true</provideFeedback><stopCfm>0.1</stopCfm><disableFixedJointLumping/>"
    drawn = "<visual><material/></visual><minDepth>0.001</minDepth><maxContacts>1</maxContacts><kp>1e6</kp>"
    both = f'<gazebo reference="shoulder">{feedback}</gazebo><gazebo reference="upper">{drawn}</gazebo>'
    assert rules(tmp_path, both) == []


def test_parts_of_one_kind_are_one_note_at_the_first_of_them(tmp_path: Path) -> None:
    tags = "".join(
        f'<gazebo reference="{name}">\n<turnGravityOff>true</turnGravityOff></gazebo>' for name in ("base", "upper")
    )
    (found,) = findings(tmp_path, tags)
    assert found.location.line == GOOD.count("\n") + 1
    text = "<turnGravityOff>true</turnGravityOff> of link 'base' is not simulated; it is ignored (2 of them)"
    assert found.message == text


def test_forces_of_plugins_and_parts_of_other_models_are_named(tmp_path: Path) -> None:
    force = '<plugin name="push" filename="libgazebo_ros_force.so"/>'
    moves = '<plugin name="drive" filename="libhector_gazebo_ros_force_based_move.so"/>'
    (found,) = findings(tmp_path, f"<gazebo>{force}{moves}</gazebo>")
    assert found.message == "the force of plugin 'push' is not simulated; it is ignored"
    assert rules(tmp_path, '<gazebo><joint name="closing" type="revolute"/></gazebo>') == ["passed-over"]


@pytest.mark.parametrize(
    ("typo", "meant"),
    [("mu_1", "mu1"), ("mu", "mu1"), ("turngravityoff", "turnGravityOff"), ("selfCollid", "selfCollide")],
)
def test_a_misspelled_part_is_named_with_the_nearest_name(typo: str, meant: str, tmp_path: Path) -> None:
    (found,) = findings(tmp_path, f'<gazebo reference="upper"><{typo}>0.0</{typo}></gazebo>')
    assert found.rule == "unknown-tag"
    assert found.message == f"unknown element <{typo}> in <gazebo> is ignored; did you mean <{meant}>?"


def test_a_static_model_has_a_fixed_base(tmp_path: Path) -> None:
    model = read(tmp_path, "<gazebo><static>true</static></gazebo>")
    assert (model.root, model.findings) == ("world", ())
    joint = next(joint for joint in model.joints if joint.parent == "world")
    assert (joint.child, joint.type) == ("base", "fixed")
    assert read(tmp_path, "<gazebo><static>false</static></gazebo>").root == "base"
