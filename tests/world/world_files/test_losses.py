"""The table of the parts of worlds: what is lost, and what has no effect."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.world.world_files.losses import lost_parts


def lost(text: str, *, moves: bool = False) -> list[str]:
    return [message for _, message in lost_parts(ET.fromstring(text), moves=moves)]


def test_what_is_only_drawn_or_set_for_the_engine_of_gazebo_is_not_lost() -> None:
    drawn = ("light", "scene", "gui", "physics", "road", "magnetic_field", "atmosphere", "wind")
    world = "".join(f"<{tag}><inside>1</inside></{tag}>" for tag in drawn)
    assert lost(f"<world>{world}</world>") == []


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_a_joint_between_models_is_lost(kind: str) -> None:
    joint = f"<world><joint type='{kind}'/></world>"
    assert lost(joint) == ["<joint> is not simulated: the models are not joined"]


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("<link><gravitty>0</gravitty></link>", "<gravitty> of <link> is not supported and has no effect"),
        ("<link mas='1'/>", '<link mas="1"> of <link> is not supported and has no effect'),
        ("<link><pose unit='m'/></link>", '<pose unit="m"> of <pose> is not supported and has no effect'),
        ("<link><inertial><mas>1</mas></inertial></link>", "<mas> of <inertial> is not supported and has no effect"),
        (
            "<link><inertial><fluid_added_mass/></inertial></link>",
            "<fluid_added_mass> is not simulated: there is no water",
        ),
        ("<state><insertions/></state>", None),
        ("<state><insertions><model/></insertions></state>", "<insertions> is not simulated: its models are missing"),
    ],
)
def test_an_unknown_part_is_lost_wherever_it_is(model: str, message: str | None) -> None:
    assert lost(model) == [message] * (message is not None)


@pytest.mark.parametrize(
    ("link", "fixed", "moving"),
    [
        ("<gravity>0</gravity>", 0, 1),
        ("<gravity>true</gravity>", 0, 0),
        ("<kinematic>false</kinematic>", 0, 0),
        ("<kinematic>1</kinematic>", 0, 1),
        ("<self_collide>true</self_collide>", 0, 1),
        ("<self_collide>0</self_collide>", 0, 0),
        ("<velocity_decay><linear>0</linear><angular>0.1</angular></velocity_decay>", 0, 1),
        ("<visual><anything/></visual>", 0, 0),
        ("<sensor><camera/></sensor>", 0, 0),
    ],
)
def test_a_part_of_the_motion_is_lost_only_where_something_moves(link: str, fixed: int, moving: int) -> None:
    text = f"<link>{link}</link>"
    assert (len(lost(text)), len(lost(text, moves=True))) == (fixed, moving)


@pytest.mark.parametrize(
    ("surface", "count"),
    [
        ("<contact><ode/></contact><friction><ode/><torsional><ode/></torsional></friction><bounce/>", 0),
        ("<contact><ode><kp>1e6</kp><kd>1</kd><max_vel>0.1</max_vel></ode></contact>", 0),
        ("<contact><collide_without_contact>1</collide_without_contact></contact>", 1),
        ("<bounce><restitution_coefficient>0.5</restitution_coefficient><threshold>1</threshold></bounce>", 1),
        ("<bounce><restitution_coefficient>0</restitution_coefficient></bounce>", 0),
        ("<friction><torsional><patch_radius>0.1</patch_radius></torsional></friction>", 1),
        ("<soft_contact/>", 1),
    ],
)
def test_properties_of_contacts(surface: str, count: int) -> None:
    assert len(lost(f"<collision><surface>{surface}</surface></collision>")) == count


@given(st.sampled_from(["0", "0.0", "-0", "0e3", "false", "False"]))
def test_a_neutral_value_counts_however_it_is_written(text: str) -> None:
    assert lost(f"<collision><laser_retro>{text}</laser_retro></collision>") == []


@given(st.floats(allow_nan=False, allow_infinity=False).filter(bool))
def test_any_other_value_is_lost(value: float) -> None:
    assert len(lost(f"<collision><laser_retro>{value!r}</laser_retro></collision>")) == 1
