"""What links of SDF hold: masses, shapes, surfaces."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.geometry import Vector3
from tests.robot.reading.sdf.models import INERTIAL, SPHERE, joint, link, load, near, rules, sdf

HALF = math.pi / 2


def test_the_mass_and_its_place_are_read(tmp_path: Path) -> None:
    inertial = INERTIAL.replace("<mass>1", f"<pose>1 2 3 0 0 {HALF}</pose><mass>2.5")
    model = load(tmp_path, sdf(f'<link name="a">{inertial}{SPHERE}</link>'))
    assert model.mass == 2.5
    assert model.findings == ()
    origin = ET.fromstring(model.urdf).find("link/inertial/origin")
    assert origin is not None
    assert origin.attrib["xyz"] == "1.0 2.0 3.0"
    assert [float(word) for word in origin.attrib["rpy"].split()] == pytest.approx([0, 0, HALF])


def test_what_an_inertial_leaves_out_is_as_the_format_has_it(tmp_path: Path) -> None:
    model = load(tmp_path, sdf(f'<link name="a">{SPHERE}<inertial/></link>'))
    assert model.mass == 1.0
    (finding,) = model.findings
    assert finding.rule == "default-inertia"
    assert "mass = 1 kg, inertia/ixx = 1 kg m^2" in finding.message


def test_a_link_without_inertial_weighs_next_to_nothing(tmp_path: Path) -> None:
    model = load(tmp_path, sdf(link("a"), f'<link name="b">{SPHERE}</link>', joint("j", "a", "b")))
    assert (model.mass, rules(model)) == (1.0, ["missing-inertia"])


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


def test_what_is_empty_collides_with_nothing(tmp_path: Path) -> None:
    empty = '<collision name="e"><geometry><empty/></geometry></collision>'
    assert len(load(tmp_path, sdf(link("a", empty))).links[0].collisions) == 1


def test_a_part_of_a_link_may_be_placed_relative_to_another_frame(tmp_path: Path) -> None:
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
    contact = "<surface><contact><ode><kp>1e5</kp><kd>10</kd></ode></contact></surface>"
    model = load(
        tmp_path, sdf(f'<link name="a">{INERTIAL}{SPHERE.replace("</collision>", contact + "</collision>")}</link>')
    )
    assert (model.links[0].surface.stiffness, model.links[0].surface.damping) == (1e5, 10)


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
    ("look", "opacity"),
    [
        ("<material><diffuse>1 0 0</diffuse></material>", 1),
        ("<material><diffuse>1 0 0 0.5</diffuse></material>", 0.5),
        ("<transparency>0.75</transparency><material><diffuse>1 0 0 1</diffuse></material>", 0.25),
        ("<transparency>0.5</transparency><material><diffuse>1 0 0 0.5</diffuse></material>", 0.25),
        ("<transparency>7</transparency><material><diffuse>1 0 0 1</diffuse></material>", 0),
        ("<transparency>glass</transparency><material><diffuse>1 0 0 nan</diffuse></material>", 1),
    ],
)
def test_what_is_transparent_is_so(look: str, opacity: float, tmp_path: Path) -> None:
    visual = f'<visual name="v">{look}<geometry><box><size>1 2 3</size></box></geometry></visual>'
    (read,) = load(tmp_path, sdf(link("a", visual))).links[0].visuals
    assert (read.color, read.opacity) == ((1.0, 0.0, 0.0), opacity)


@pytest.mark.parametrize("diffuse", ["", "1 2", "red green blue", "nan 0 0 1"])
def test_a_colour_that_is_none_is_passed_over(diffuse: str, tmp_path: Path) -> None:
    material = f"<material><diffuse>{diffuse}</diffuse></material>"
    visual = f'<visual name="v"><geometry><box><size>1 2 3</size></box></geometry>{material}</visual>'
    (read,) = load(tmp_path, sdf(link("a", visual))).links[0].visuals
    assert read.color is None


def test_a_friction_below_0_means_that_nothing_slides(tmp_path: Path) -> None:
    surface = "<surface><friction><ode><mu>-1</mu><mu2>-1</mu2></ode></friction></surface>"
    rough = SPHERE.replace("</geometry>", f"</geometry>{surface}")
    model = load(tmp_path, sdf(f'<link name="a">{INERTIAL}{rough}</link>'))
    assert (model.links[0].surface.friction, model.findings) == (1.0, ())
