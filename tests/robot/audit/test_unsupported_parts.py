"""What SDF says and is not simulated is said; what says nothing is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import RefusedModel
from tests.robot.reading.sdf.models import INERTIAL, joint, link, load, rules, sdf
from tests.ros_workspace import written

GEOMETRY = "<geometry><sphere><radius>0.1</radius></sphere></geometry>"


def collision(inside: str) -> str:
    surface = f"<surface>{inside}</surface>"
    return sdf(f'<link name="a">{INERTIAL}\n<collision name="c">{surface}{GEOMETRY}</collision></link>')


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        ("<gravity>false</gravity>", "<gravity>true</gravity>"),
        ("<kinematic>1</kinematic>", "<kinematic>0</kinematic>"),
        ("<self_collide>true</self_collide>", "<self_collide>false</self_collide>"),
        ("<enable_wind>true</enable_wind>", "<enable_wind>0</enable_wind>"),
        (
            "<velocity_decay><linear>0.1</linear></velocity_decay>",
            "<velocity_decay><linear>0</linear></velocity_decay>",
        ),
        ("<velocity_decay><angular>1</angular></velocity_decay>", "<velocity_decay/>"),
    ],
)
def test_what_a_link_is_and_is_not_simulated_as(odd: str, usual: str, tmp_path: Path) -> None:
    assert rules(load(tmp_path, sdf(link("a", odd)))) == ["passed-over"]
    assert rules(load(tmp_path, sdf(link("a", usual)))) == []


@pytest.mark.parametrize(
    ("odd", "usual"),
    [
        (
            "<friction><torsional><coefficient>1</coefficient></torsional></friction>",
            "<friction/>",
        ),
        ("<friction><ode><slip1>0.1</slip1></ode></friction>", "<friction><ode><slip1>0</slip1></ode></friction>"),
        ("<friction><ode><slip2>0.1</slip2></ode></friction>", "<friction><ode><slip2>0</slip2></ode></friction>"),
        (
            "<friction><bullet><rolling_friction>1</rolling_friction></bullet></friction>",
            "<friction><bullet><rolling_friction>0</rolling_friction></bullet></friction>",
        ),
        (
            "<friction><bullet><friction>0.2</friction></bullet></friction>",
            "<friction><ode><mu>0.2</mu></ode><bullet><friction>0.2</friction></bullet></friction>",
        ),
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


def test_wind_and_touching_itself_are_passed_over_for_a_model(tmp_path: Path) -> None:
    model = load(tmp_path, sdf("<enable_wind>1</enable_wind>", "<self_collide>1</self_collide>", link("a")))
    assert sorted(finding.location.line or 0 for finding in model.findings) == [3, 4]


def test_water_that_moves_along_is_passed_over(tmp_path: Path) -> None:
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
    assert first.message == "<gravity>false</gravity> of link 'a' is not simulated; it is ignored (3 of them)"
    assert second.message.startswith("<kinematic>")


def test_sensors_and_forces_of_plugins_are_noted(tmp_path: Path) -> None:
    sensors = '<sensor type="imu" name="i"/><sensor type="gpu_lidar" name="l"/>'
    wing = '<plugin filename="gz-sim-lift-drag-system" name="gz::sim::systems::LiftDrag"/>'
    drive = '<plugin filename="gz-sim-diff-drive-system" name="gz::sim::systems::DiffDrive"/>'
    lift, lidar = load(tmp_path, sdf(link("a", sensors), wing, drive, wing)).findings
    assert lidar.message.startswith("<sensor type=\"imu\"> 'i' of link 'a'")
    assert lidar.message.endswith("(2 of them)")
    assert "the force of plugin 'gz::sim::systems::LiftDrag' is not simulated" in lift.message


def test_the_direction_of_friction_is_noted(tmp_path: Path) -> None:
    (finding,) = load(tmp_path, collision("<friction><ode><fdir1>1 0 0</fdir1></ode></friction>")).findings
    assert "<fdir1>1 0 0</fdir1>" in finding.message
    assert load(tmp_path, collision("<friction><ode><fdir1>0 0 0</fdir1></ode></friction>")).findings == ()
