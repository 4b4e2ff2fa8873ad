"""Parts of SDF and of <gazebo> tags that are not simulated are named, and those without an effect are not."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import RefusedModel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.robot.reading.sdf.models import INERTIAL, joint, link, load, rules, sdf
from tests.ros_workspace import written

GEOMETRY = "<geometry><sphere><radius>0.1</radius></sphere></geometry>"


def collision(inside: str) -> str:
    surface = f"<surface>{inside}</surface>"
    return sdf(f'<link name="a">{INERTIAL}\n<collision name="c">{surface}{GEOMETRY}</collision></link>')


DECAYS = [("<linear>0.1</linear>", "<linear>0</linear>"), ("<angular>1</angular>", "")]
BULLET, ROLLING = (
    "<bullet><friction>0.2</friction></bullet>",
    "<bullet><rolling_friction>{}</rolling_friction></bullet>",
)
FRICTIONS = [
    ("<torsional><coefficient>1</coefficient></torsional>", ""),
    *((f"<ode><{tag}>0.1</{tag}></ode>", f"<ode><{tag}>0</{tag}></ode>") for tag in ("slip1", "slip2")),
    (ROLLING.format(1), ROLLING.format(0)),
    (BULLET, f"<ode><mu>0.2</mu></ode>{BULLET}"),
    ("<ode><fdir1>1 0 0</fdir1></ode>", "<ode><fdir1>0 0 0</fdir1></ode>"),
]


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        ("<gravity>false</gravity>", "<gravity>true</gravity>"),
        ("<kinematic>1</kinematic>", "<kinematic>0</kinematic>"),
        ("<self_collide>true</self_collide>", "<self_collide>false</self_collide>"),
        ("<enable_wind>true</enable_wind>", "<enable_wind>0</enable_wind>"),
        *(
            (f"<velocity_decay>{odd}</velocity_decay>", f"<velocity_decay>{usual}</velocity_decay>")
            for odd, usual in DECAYS
        ),
    ],
)
def test_what_a_link_is_and_is_not_simulated_as(odd: str, usual: str, tmp_path: Path) -> None:
    assert rules(load(tmp_path, sdf(link("a", odd)))) == ["passed-over"]
    assert rules(load(tmp_path, sdf(link("a", usual)))) == []


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        *((f"<friction>{odd}</friction>", f"<friction>{usual}</friction>") for odd, usual in FRICTIONS),
        ("<soft_contact/>", "<contact><ode><min_depth>0.01</min_depth></ode></contact>"),
    ],
)
def test_how_a_collision_touches_and_is_not_simulated_to(odd: str, usual: str, tmp_path: Path) -> None:
    (finding,) = load(tmp_path, collision(odd)).findings
    assert (finding.rule, finding.location.line) == ("passed-over", 4)
    assert "collision 'c' of link 'a'" in finding.message
    assert load(tmp_path, collision(usual)).findings == ()


def test_a_restitution_is_refused_unless_it_is_allowed(tmp_path: Path) -> None:
    def bouncing(restitution: str) -> str:
        return collision(f"<bounce><restitution_coefficient>{restitution}</restitution_coefficient></bounce>")

    with pytest.raises(RefusedModel) as refused:
        load(tmp_path, bouncing("0.9"))
    (problem,) = refused.value.problems
    assert problem.location.line == 4
    assert problem.message == (
        "<restitution_coefficient> of collision 'c' of link 'a' is 0.9, but nothing bounces in the simulation: "
        "set it to 0, or ignore it by robot.allow [restitution]"
    )
    assert rules(load(tmp_path, bouncing("0.9"), ("restitution",))) == ["restitution"]
    assert load(tmp_path, bouncing("0")).findings == ()
    assert load(tmp_path, collision("<bounce/>")).findings == ()


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        ("<limit><stiffness>10</stiffness></limit>", "<limit><stiffness>1e8</stiffness></limit>"),
        ("<limit><dissipation>2</dissipation></limit>", "<limit><dissipation>1</dissipation></limit>"),
    ],
)
def test_how_a_joint_moves_and_is_not_simulated_to(odd: str, usual: str, tmp_path: Path) -> None:
    def found(inside: str) -> list[str]:
        axis = f"<axis><xyz>0 0 1</xyz>{inside}</axis>"
        return rules(load(tmp_path, sdf(link("a"), link("b"), joint("j", "a", "b", axis, "continuous"))))

    assert (found(odd), found(usual)) == (["passed-over"], [])


def test_wind_touching_itself_and_water_that_moves_along_are_passed_over_for_a_model(tmp_path: Path) -> None:
    model = load(tmp_path, sdf("<enable_wind>1</enable_wind>", "<self_collide>1</self_collide>", link("a")))
    assert sorted(finding.location.line or 0 for finding in model.findings) == [3, 4]
    wet = link("a").replace("</inertial>", "<fluid_added_mass><xx>1</xx></fluid_added_mass></inertial>")
    assert rules(load(tmp_path, sdf(wet))) == ["passed-over"]


@pytest.mark.parametrize(
    ("contact", "is_odd"),
    [
        ("<collide_without_contact>true</collide_without_contact>", True),
        ("<collide_without_contact>false</collide_without_contact>", False),
        ("<collide_bitmask>0</collide_bitmask>", True),
        ("<collide_bitmask>0x00</collide_bitmask>", True),
        ("<collide_bitmask>0x10000</collide_bitmask>", True),
        ("<collide_bitmask>0</collide_bitmask><category_bitmask>1</category_bitmask>", False),
        ("<collide_bitmask>0x02</collide_bitmask>", False),
        ("<collide_bitmask>65535</collide_bitmask>", False),
        ("<category_bitmask>0</category_bitmask>", False),
    ],
)
def test_a_collision_that_nothing_touches_is_refused(contact: str, is_odd: bool, tmp_path: Path) -> None:
    model = load(tmp_path, collision(f"<contact>{contact}</contact>"), allow=("unsupported-part",))
    assert rules(model) == ["unsupported-part"] * is_odd


def test_changes_to_what_is_included_are_refused(tmp_path: Path) -> None:
    written(tmp_path / "arm.sdf", sdf(link("a")))
    changes = '\n<experimental:params><link element_id="a" action="remove"/></experimental:params>'
    model = load(tmp_path, sdf(f"<include><uri>arm.sdf</uri>{changes}</include>"), allow=("unsupported-part",))
    assert rules(model) == ["unsupported-part"]
    assert model.findings[0].location.line == 4


def test_parts_of_one_kind_are_one_note(tmp_path: Path) -> None:
    light = [link(name, "<gravity>false</gravity><kinematic>1</kinematic>") for name in "abc"]
    joints = (joint("i", "a", "b"), joint("j", "b", "c"))
    first, second = load(tmp_path, sdf(*light, *joints)).findings
    assert (first.location.line, second.location.line) == (3, 3)
    ignored = "<gravity>false</gravity> of link 'a' is not simulated; it is ignored: the link falls"
    assert first.message == f"{ignored} (3 of them; lines 3, 4, 5)"
    assert second.message.startswith("<kinematic>")


def test_sensors_and_forces_of_plugins_are_noted(tmp_path: Path) -> None:
    sensors = '<sensor type="imu" name="i"/><sensor type="gpu_lidar" name="l"/>'
    wing = '<plugin filename="gz-sim-lift-drag-system" name="gz::sim::systems::LiftDrag"/>'
    drive = '<plugin filename="gz-sim-diff-drive-system" name="gz::sim::systems::DiffDrive"/>'
    lidar, lift = load(tmp_path, sdf(link("a", sensors), wing, drive, wing)).findings
    assert lidar.message.startswith("<sensor type=\"imu\"> 'i' of link 'a'")
    assert lidar.message.endswith("(2 of them; line 3)")
    assert "the force of plugin 'gz::sim::systems::LiftDrag' is not simulated" in lift.message


def read(folder: Path, more: str) -> RobotModel:
    return read_urdf(written(folder / "robot.urdf", GOOD.replace("</robot>", f"{more}</robot>")))


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
    assert rules(read(tmp_path, f'<gazebo reference="upper">{odd}</gazebo>')) == ["passed-over"]
    assert rules(read(tmp_path, f'<gazebo reference="upper">{usual}<material>Gazebo/Blue</material></gazebo>')) == []


def test_parts_without_an_effect_on_the_motion_are_not_named(tmp_path: Path) -> None:
    feedback = "<provideFeedback>true</provideFeedback><stopCfm>0.1</stopCfm><disableFixedJointLumping/>"
    drawn = "<visual><material/></visual><minDepth>0.001</minDepth><maxContacts>1</maxContacts><kp>1e6</kp>"
    both = f'<gazebo reference="shoulder">{feedback}</gazebo><gazebo reference="upper">{drawn}</gazebo>'
    assert rules(read(tmp_path, both)) == []


def test_forces_of_plugins_and_parts_of_other_models_are_named(tmp_path: Path) -> None:
    force = '<plugin name="push" filename="libgazebo_ros_force.so"/>'
    moves = '<plugin name="drive" filename="libhector_gazebo_ros_force_based_move.so"/>'
    (found,) = read(tmp_path, f"<gazebo>{force}{moves}</gazebo>").findings
    assert found.message == "the force of plugin 'push' is not simulated; it is ignored"
    assert rules(read(tmp_path, '<gazebo><joint name="closing" type="revolute"/></gazebo>')) == ["passed-over"]


@pytest.mark.parametrize(
    ("typo", "meant"),
    [("mu_1", "mu1"), ("mu", "mu1"), ("turngravityoff", "turnGravityOff"), ("selfCollid", "selfCollide")],
)
def test_a_misspelled_part_is_named_with_the_nearest_name(typo: str, meant: str, tmp_path: Path) -> None:
    (found,) = read(tmp_path, f'<gazebo reference="upper"><{typo}>0.0</{typo}></gazebo>').findings
    assert found.rule == "unknown-tag"
    assert found.message == f"unknown element <{typo}> in <gazebo> is ignored; did you mean <{meant}>?"


def test_a_static_model_has_a_fixed_base(tmp_path: Path) -> None:
    model = read(tmp_path, "<gazebo><static>true</static></gazebo>")
    assert (model.root, model.findings) == ("world", ())
    joint = next(joint for joint in model.joints if joint.parent == "world")
    assert (joint.child, joint.type) == ("base", "fixed")
    assert read(tmp_path, "<gazebo><static>false</static></gazebo>").root == "base"
