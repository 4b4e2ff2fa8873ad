"""SDF -> RobotModel: links and what axes mean, by hand; what joints hold, and what is bolted to the world."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.geometry import Vector3
from sim_action.robot.model.robot_model import Mimic
from tests.robot.reading.sdf.models import INERTIAL, SPHERE, joint, link, load, near, position, rules, sdf

HALF = math.pi / 2


def turning(pose: str = "", axis: str = "<xyz>0 0 1</xyz>", kind: str = "revolute") -> str:
    child = link("b", f"<pose>1 0 0 0 0 {HALF}</pose>")
    return "\n".join((link("a"), child, joint("j", "a", "b", f"{pose}<axis>{axis}</axis>", kind)))


def test_a_link_whose_joint_is_elsewhere_has_its_frame_at_the_joint(tmp_path: Path) -> None:
    model = load(tmp_path, sdf(turning("<pose>0.5 0 0 0 0 0</pose>")))
    # The joint is half a metre along the child's x axis, which is the parent's y.
    assert position(model, "b") == near(1, 0.5, 0)
    (shape,) = model.links_by_name["b"].collisions
    assert shape.pose.position_xyz == near(-0.5, 0, 0)
    inertial = ET.fromstring(model.urdf).find("link[@name='b']/inertial/origin")
    assert inertial is not None
    assert [float(word) for word in inertial.attrib["xyz"].split()] == pytest.approx([-0.5, 0, 0])


@pytest.mark.parametrize(
    ("pose", "kind"), [("0 0 0.5 0 0 0", "revolute"), ("0.5 0 0 0 0 0", "prismatic"), ("0 1 0.5 0 0 0", "fixed")]
)
def test_a_link_keeps_its_frame_where_that_moves_alike(pose: str, kind: str, tmp_path: Path) -> None:
    model = load(tmp_path, sdf(turning(f"<pose>{pose}</pose>", kind=kind)))
    assert position(model, "b") == near(1, 0, 0)
    assert model.links_by_name["b"].collisions[0].pose.position_xyz == near(0, 0, 0)


@pytest.mark.parametrize(
    ("kind", "limit", "expected"),
    [
        ("revolute", "", ("continuous", None, None)),
        ("revolute", "<limit><lower>-1e16</lower><upper>1e+16</upper></limit>", ("continuous", None, None)),
        ("revolute", "<limit><lower>-inf</lower><upper>inf</upper></limit>", ("continuous", None, None)),
        ("revolute", "<limit><effort>3</effort></limit>", ("continuous", None, None)),
        ("revolute", "<limit><lower>-1</lower><upper>2</upper></limit>", ("revolute", -1, 2)),
        ("revolute", "<limit><lower>0</lower><upper>inf</upper></limit>", ("revolute", 0, None)),
        ("prismatic", "", ("prismatic", None, None)),
    ],
)
def test_a_joint_without_limits_turns_or_slides_for_ever(
    kind: str, limit: str, expected: tuple[str, float | None, float | None], tmp_path: Path
) -> None:
    (made,) = load(tmp_path, sdf(turning(axis=f"<xyz>0 0 1</xyz>{limit}", kind=kind))).joints
    assert (made.type, made.lower, made.upper) == expected


@pytest.mark.parametrize(
    ("effort", "velocity", "expected"), [("-1", "-1", (None, None)), ("inf", "2", (None, 2)), ("5", "1e16", (5, None))]
)
def test_a_negative_or_infinite_effort_is_no_limit(
    effort: str, velocity: str, expected: tuple[float | None, float | None], tmp_path: Path
) -> None:
    limit = f"<limit><effort>{effort}</effort><velocity>{velocity}</velocity></limit>"
    (made,) = load(tmp_path, sdf(turning(axis=f"<xyz>0 0 1</xyz>{limit}", kind="continuous"))).joints
    assert (made.max_effort, made.max_velocity) == expected


def test_damping_mimic_and_what_is_passed_over(tmp_path: Path) -> None:
    leader = joint("lead", "a", "b", "<axis><xyz>0 0 1</xyz></axis>", "continuous")
    mimic = '<mimic joint="lead"><multiplier>2</multiplier><offset>1</offset><reference>0.25</reference></mimic>'
    stated = "<damping>0.3</damping><friction>0.2</friction><spring_stiffness>9</spring_stiffness>"
    dynamics = f"<dynamics>{stated}</dynamics>"
    start = "<initial_position>0.5</initial_position>"
    follower = joint("j", "b", "c", f"<axis><xyz>0 0 1</xyz>{start}{dynamics}{mimic}</axis>", "continuous")
    text = sdf(link("a"), link("b"), link("c"), leader, follower, version="1.11")
    model = load(tmp_path, text)
    made = ET.fromstring(model.urdf).find("joint[@name='j']/dynamics")
    assert made is not None
    assert made.attrib == {"damping": "0.3", "friction": "0.2"}
    assert model.joints_by_name["j"].mimic == Mimic("lead", 2.0, 0.5)
    plain = load(tmp_path, text.replace("<reference>0.25</reference>", ""))
    assert plain.joints_by_name["j"].mimic == Mimic("lead", 2.0, 1.0)
    assert (model.joints_by_name["j"].stiffness, model.joints_by_name["j"].spring_reference) == (9.0, 0.0)
    assert rules(model) == ["passed-over"]
    assert "robot.joints: {j: 0.5}" in model.findings[0].message


def test_a_ball_joint_turns_about_the_origin_of_its_own_frame(tmp_path: Path) -> None:
    ball = joint("j", "a", "b", "<pose>0 0 0.5 0 0 0</pose>", "ball")
    model = load(tmp_path, sdf(link("a"), link("b", "<pose>0 0 1 0 0 0</pose>"), ball))
    assert rules(model) == []
    parts = [(part.name, part.type, part.ball) for part in model.joints]
    assert parts == [(f"j_{axis}", "ball", "j") for axis in "xyz"]
    assert model.joints[0].origin.position_xyz == near(0, 0, 1.5)
    element = ET.fromstring(model.urdf).find("joint[@name='j']")
    assert element is not None
    assert element.get("type") == "spherical"


def test_a_ball_joint_has_the_damping_of_its_axis(tmp_path: Path) -> None:
    axis = "<axis><xyz>0 0 1</xyz><dynamics><damping>0.3</damping></dynamics></axis>"
    model = load(tmp_path, sdf(link("a"), link("b"), joint("j", "a", "b", axis, "ball")))
    dynamics = ET.fromstring(model.urdf).find("joint[@name='j']/dynamics")
    assert dynamics is not None
    assert dynamics.attrib == {"damping": "0.3"}
    assert rules(model) == []


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
def test_a_joint_with_two_axes_is_two_hinges_at_the_origin_of_its_own_frame(kind: str, tmp_path: Path) -> None:
    first = "<axis><xyz>0 0 1</xyz><limit><lower>-0.5</lower><upper>0.6</upper></limit></axis>"
    dynamics = "<dynamics><damping>0.3</damping><spring_stiffness>9</spring_stiffness></dynamics>"
    second = f"<axis2><xyz>1 0 0</xyz>{dynamics}<initial_position>0.2</initial_position></axis2>"
    two = joint("j", "a", "b", f"<pose>0 0 0.5 0 0 1.5707963267948966</pose>{first}{second}", kind)
    model = load(tmp_path, sdf(link("a"), link("b", "<pose>0 0 1 0 0 0</pose>"), two))
    assert [(part.name, part.type, part.parent, part.child) for part in model.joints] == [
        ("j_1", "revolute", "a", "j_1"),
        ("j_2", "continuous", "j_1", "b"),
    ]
    one, other = model.joints
    assert {one.series, other.series} == {"j"}
    assert (one.origin.position_xyz, other.origin.position_xyz) == (near(0, 0, 1.5), near(0, 0, 0))
    assert (one.axis_xyz, other.axis_xyz) == (near(0, 0, 1), near(0, 1, 0))
    assert (one.lower, one.upper, other.stiffness) == (-0.5, 0.6, 9.0)
    assert rules(model) == ["passed-over"]
    assert "robot.joints: {j_2: 0.2}" in model.findings[0].message


def test_a_joint_that_is_not_simulated_is_fixed_where_that_is_allowed(tmp_path: Path) -> None:
    model = load(tmp_path, sdf(link("a"), link("b"), joint("j", "a", "b", "", "screw")), allow=("unsupported-joint",))
    assert model.joints[0].type == "fixed"
    assert rules(model) == ["unsupported-joint"]


def test_what_hangs_on_the_world_is_where_the_pose_of_the_model_or_of_its_placement_frame_is(tmp_path: Path) -> None:
    parts = ("<pose>0 0 1 0 0 0</pose>", link("a", "<pose>2 0 0 0 0 0</pose>"), joint("j", "world", "a"))
    model = load(tmp_path, sdf(*parts))
    assert (model.root, position(model, "a")) == ("world", near(2, 0, 1))
    placed = load(tmp_path, sdf(*parts, attributes=' placement_frame="a"'))
    assert position(placed, "a") == near(0, 0, 1)


def test_what_is_static_hangs_on_the_world_and_does_not_move(tmp_path: Path) -> None:
    model = load(tmp_path, sdf("<static>true</static>", turning(), link("lid", "<pose>0 0 3 0 0 0</pose>")))
    assert model.root == "world"
    assert {joint.type for joint in model.joints} == {"fixed"}
    assert (position(model, "b"), position(model, "lid")) == (near(1, 0, 0), near(0, 0, 3))


def test_plugins_are_handed_on_as_they_stand(tmp_path: Path) -> None:
    parameters = "<left_joint>wl</left_joint><odom><rate>30</rate></odom>"
    plugin = f'<plugin filename="libdrive.so" name="drive">{parameters}</plugin>'
    (handed,) = load(tmp_path, sdf(link("a"), plugin)).plugins
    assert (handed.name, handed.parameters) == ("drive", (("left_joint", "wl"), ("odom", "")))


def test_what_never_had_a_meaning_is_said(tmp_path: Path) -> None:
    model = load(tmp_path, sdf("<self_collide>1</self_collide>", link("a", '<pose frame="base"/>'), version="1.6"))
    assert rules(model) == ["passed-over", "passed-over"]
    assert [finding.location.line for finding in model.findings] == [3, 4]
    # A newer version is read as the newest that is known.
    assert rules(load(tmp_path, sdf(link("a"), version="1.13"))) == ["passed-over"]


def test_a_link_named_world_is_the_world_where_it_may_be(tmp_path: Path) -> None:
    parts = ('<link name="world"/>', link("a"), joint("j", "world", "a"))
    assert [link.name for link in load(tmp_path, sdf(*parts, version="1.6")).links] == ["world", "a"]


def test_the_mass_and_its_place_are_read(tmp_path: Path) -> None:
    inertial = INERTIAL.replace("<mass>1", f"<pose>1 2 3 0 0 {HALF}</pose><mass>2.5")
    model = load(tmp_path, sdf(f'<link name="a">{inertial}{SPHERE}</link>'))
    assert model.mass == 2.5
    assert model.findings == ()
    origin = ET.fromstring(model.urdf).find("link/inertial/origin")
    assert origin is not None
    assert origin.attrib["xyz"] == "1.0 2.0 3.0"
    assert [float(word) for word in origin.attrib["rpy"].split()] == pytest.approx([0, 0, HALF])


def test_what_an_inertial_leaves_out_is_as_the_format_has_it_and_a_static_model_needs_none(tmp_path: Path) -> None:
    model = load(tmp_path, sdf("<static>1</static>", '<link name="a"/>', '<link name="b"/>'))
    assert (rules(model), model.mass) == (["no-collision-shape"], 0)
    model = load(tmp_path, sdf(f'<link name="a">{SPHERE}<inertial/></link>'))
    assert model.mass == 1.0
    (finding,) = model.findings
    assert finding.rule == "default-inertia"
    assert "mass = 1 kg, inertia/ixx = 1 kg m^2" in finding.message


def test_a_link_without_inertial_has_the_mass_and_moments_of_the_format(tmp_path: Path) -> None:
    """As in Link::Load of libsdformat: 1 kg and moments of 1 kg m^2, in the frame of the link."""
    bare = f'<link name="b"><pose>1 2 3 0 0 {HALF}</pose>{SPHERE}</link>'
    model = load(tmp_path, sdf(link("a"), bare, joint("j", "a", "b")))
    assert (model.mass, model.links_by_name["b"].mass) == (2.0, 1.0)
    (finding,) = model.findings
    assert (finding.rule, finding.location.line) == ("default-inertia", 4)
    assert finding.message.startswith(
        "<inertial> of link 'b' is missing or empty; SDF's defaults are used: mass = 1 kg"
    )
    stated, default = (ET.tostring(part) for part in ET.fromstring(model.urdf).iterfind("link/inertial"))
    assert default == stated
    auto = bare.replace("<pose>", '<inertial auto="true"><mass>3</mass></inertial><pose>')
    mesh = auto.replace(SPHERE, SPHERE.replace("<sphere><radius>0.1</radius></sphere>", "<empty/>"))
    model = load(tmp_path, sdf(link("a"), mesh, joint("j", "a", "b")), allow=("unsupported-part",))
    assert (model.mass, rules(model)) == (4.0, ["unsupported-part", "default-inertia"])


@pytest.mark.parametrize(
    ("shape", "upper"),
    [
        ("<box><size>1 2 3</size></box>", (0.5, 1, 1.5)),
        ("<sphere><radius>2</radius></sphere>", (2, 2, 2)),
        ("<cylinder><radius>2</radius><length>3</length></cylinder>", (2, 2, 1.5)),
        ("<capsule><radius>2</radius><length>3</length></capsule>", (2, 2, 3.5)),
        ("<ellipsoid><radii>2 2 2</radii></ellipsoid>", (2, 2, 2)),
    ],
)
def test_shapes_have_their_size(shape: str, upper: Vector3, tmp_path: Path) -> None:
    collision = f'<collision name="c"><pose>1 0 0 0 0 0</pose><geometry>{shape}</geometry></collision>'
    model = load(tmp_path, sdf(f'<link name="a">{collision}{INERTIAL}</link>'))
    (read,) = model.links[0].collisions
    assert (read.upper_xyz, read.pose.position_xyz) == (upper, (1, 0, 0))


def test_what_is_empty_collides_with_nothing_and_parts_may_be_placed_relative_to_other_frames(tmp_path: Path) -> None:
    empty = '<collision name="e"><geometry><empty/></geometry></collision>'
    assert len(load(tmp_path, sdf(link("a", empty))).links[0].collisions) == 1
    part = '<collision name="d"><pose relative_to="a">0 0 1 0 0 0</pose><geometry><sphere><radius>1</radius></sphere>'
    child = link("b", f"<pose>5 0 0 0 0 0</pose>{part}</geometry></collision>")
    model = load(tmp_path, sdf(link("a"), child, joint("j", "a", "b")))
    assert model.links_by_name["b"].collisions[0].pose.position_xyz == near(-5, 0, 1)


@pytest.mark.parametrize(
    ("frictions", "expected", "found"),
    [
        ([""], 1.0, []),
        (["<mu>0.2</mu><mu2>0.3</mu2>"], 0.2, ["two-frictions"]),
        (["<mu>0.2</mu>"], 0.2, []),
        (["<mu>100</mu><mu2>50</mu2>"], 1.0, ["two-frictions"]),
        (["<mu>0.2</mu><mu2>0.2</mu2>", "<mu>0</mu><mu2>0</mu2>"], 0.0, ["shared-friction"]),
        (["<mu>0.2</mu><mu2>0.2</mu2>", ""], 0.2, ["shared-friction"]),
        (["", "<mu>0</mu><mu2>0</mu2>"], 0.0, ["shared-friction"]),
        (["", "<mu>50</mu><mu2>50</mu2>"], 1.0, []),
        (["<mu>-1</mu><mu2>-1</mu2>"], 1.0, []),  # below 0: nothing slides
    ],
)
def test_friction_is_what_a_collision_of_the_link_says(
    frictions: list[str], expected: float, found: list[str], tmp_path: Path
) -> None:
    surfaces = [f"<surface><friction><ode>{text}</ode></friction></surface>" if text else "" for text in frictions]
    shapes = [SPHERE.replace("</collision>", f"{surface}</collision>") for surface in surfaces]
    model = load(tmp_path, sdf(f'<link name="a">{INERTIAL}{"".join(shapes)}</link>'))
    assert model.links[0].surface.friction == expected
    assert rules(model) == found


def test_stiffness_and_damping_of_contacts_are_handed_on(tmp_path: Path) -> None:
    contact = "<surface><contact><ode><kp>1e5</kp><kd>10</kd></ode></contact></surface></collision>"
    surface = load(tmp_path, sdf(link("a").replace("</collision>", contact))).links[0].surface
    assert (surface.stiffness, surface.damping) == (1e5, 10)


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ("<box><size>1 2 3</size></box>", (1, 2, 3)),
        ("<sphere><radius>2</radius></sphere>", (4, 4, 4)),
        ("<cylinder><radius>2</radius><length>3</length></cylinder>", (4, 4, 3)),
        ("<capsule><radius>2</radius><length>3</length></capsule>", (4, 4, 7)),
    ],
)
def test_what_is_to_be_looked_at_is_read(shape: str, size: Vector3, tmp_path: Path) -> None:
    material = "<material><ambient>0 0 0</ambient><diffuse>1 0.5 0 1</diffuse></material>"
    visual = f'<visual name="v"><pose>1 0 0 0 0 0</pose><geometry>{shape}</geometry>{material}</visual>'
    (read,) = load(tmp_path, sdf(link("a", visual))).links[0].visuals
    assert (read.size_xyz, read.pose.position_xyz, read.color) == (size, (1, 0, 0), (1.0, 0.5, 0.0))


@pytest.mark.parametrize(
    "geometry",
    ["", "<box/>", "<box><size>1 2</size></box>", "<plane/>", "<sphere><radius>x</radius></sphere>", "<empty/>"],
)
def test_what_cannot_be_looked_at_is_passed_over(geometry: str, tmp_path: Path) -> None:
    visual = f'<visual name="v"><geometry>{geometry}</geometry></visual><visual name="w"/>'
    model = load(tmp_path, sdf(link("a", visual)))
    assert (model.links[0].visuals, model.findings) == ((), ())


@pytest.mark.parametrize(
    ("transparency", "diffuse", "color", "opacity"),
    [
        ("", "1 0 0", (1, 0, 0), 1),
        ("", "1 0 0 0.5", (1, 0, 0), 0.5),
        ("0.75", "1 0 0 1", (1, 0, 0), 0.25),
        ("0.5", "1 0 0 0.5", (1, 0, 0), 0.25),
        ("7", "1 0 0 1", (1, 0, 0), 0),
        ("glass", "1 0 0 nan", (1, 0, 0), 1),
        *(("", diffuse, None, 1) for diffuse in ("", "1 2", "red green blue", "nan 0 0 1")),
    ],
)
def test_a_visual_has_its_colour_and_opacity(
    transparency: str, diffuse: str, color: Vector3 | None, opacity: float, tmp_path: Path
) -> None:
    stated = f"<transparency>{transparency}</transparency>" if transparency else ""
    look = f"{stated}<material><diffuse>{diffuse}</diffuse></material>"
    visual = f'<visual name="v">{look}<geometry><box><size>1 2 3</size></box></geometry></visual>'
    (read,) = load(tmp_path, sdf(link("a", visual))).links[0].visuals
    assert (read.color, read.opacity) == (color, opacity)
