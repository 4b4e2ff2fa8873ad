"""What becomes of what was let go, as an engine gets to see it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core import geometry
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.ros_workspace import written

BALL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


def read(folder: Path, text: str, *allow: str) -> RobotModel:
    return read_urdf(written(folder / "robot.urdf", text), allow=allow)


def links(folder: Path, text: str, *allow: str) -> dict[str, ET.Element]:
    return {link.attrib["name"]: link for link in engine_text(folder, text, *allow).iter("link")}


def inertia(link: ET.Element) -> tuple[float, float, float, float]:
    mass, moments = link.find("inertial/mass"), link.find("inertial/inertia")
    assert mass is not None
    assert moments is not None
    ixx, iyy, izz = (float(moments.attrib[name]) for name in ("ixx", "iyy", "izz"))
    return float(mass.attrib["value"]), ixx, iyy, izz


def test_a_link_without_inertial_weighs_next_to_nothing(tmp_path: Path) -> None:
    start = GOOD.index("<inertial>", GOOD.index('name="upper"'))
    end = GOOD.index("</inertial>", start) + len("</inertial>")
    mass, *moments = inertia(links(tmp_path, GOOD[:start] + GOOD[end:])["upper"])
    assert mass == pytest.approx(2e-4)
    assert moments == [pytest.approx(0.4 * 2e-4 * 0.05**2)] * 3


@pytest.mark.parametrize(("link", "mass"), [("upper", 2e-4), ("base", 0.0)])
def test_a_mass_of_zero_counts_as_left_out_but_for_the_base(link: str, mass: float, tmp_path: Path) -> None:
    place = GOOD.index("<mass", GOOD.index(f'name="{link}"'))
    text = GOOD[:place] + GOOD[place:].replace(GOOD[place : GOOD.index("/>", place)], '<mass value="0"', 1)
    assert inertia(links(tmp_path, text, "zero-mass")[link])[0] == pytest.approx(mass)


@pytest.mark.parametrize("moment", ["0", "-1"])
def test_a_body_without_a_moment_above_0_is_a_ball(moment: str, tmp_path: Path) -> None:
    text = GOOD
    for name in ("ixx", "iyy", "izz"):
        text = text.replace(f'{name}="1"', f'{name}="{moment}"', 1)
    assert inertia(links(tmp_path, text, "impossible-inertia")["base"]) == pytest.approx((2.0, 2e-3, 2e-3, 2e-3))


@pytest.mark.parametrize(("least", "added"), [("0", 0.0), ("-0.25", 0.5)])
def test_a_body_that_would_turn_without_end_about_one_axis_keeps_its_other_moments(
    least: str, added: float, tmp_path: Path
) -> None:
    text = GOOD.replace('ixx="1"', f'ixx="{least}"', 1)
    _, ixx, iyy, izz = inertia(links(tmp_path, text, "impossible-inertia")["base"])
    assert (ixx, iyy, izz) == pytest.approx((float(least) + added, 1 + added, 1 + added), abs=1e-5)
    assert ixx > 0
    assert max(iyy, izz) < ixx + min(iyy, izz)


def test_an_expression_that_was_let_go_is_left_out(tmp_path: Path) -> None:
    link = links(tmp_path, GOOD.replace("1 2 3", "${x} 2 3"), "unexpanded-expression")["base"]
    assert link.find("collision") is not None
    assert link.find("collision/origin") is None


@pytest.mark.parametrize("greatest", ["2", "2.001", "1.9999999"])
def test_a_flat_plate_turns_as_one(greatest: str, tmp_path: Path) -> None:
    # The engine takes inertia away from what is off by a rounding error.
    text = GOOD.replace('izz="1"', f'izz="{greatest}"', 1)
    _, ixx, iyy, izz = inertia(links(tmp_path, text)["base"])
    assert (ixx, iyy, izz) == pytest.approx((1.0, 1.0, float(greatest)), rel=2e-3)
    assert izz < ixx + iyy


def test_an_inertia_that_no_body_can_have_is_made_one_and_a_note_says_which(tmp_path: Path) -> None:
    text = GOOD.replace('izz="1"', 'izz="5"', 1)
    _, ixx, iyy, izz = inertia(links(tmp_path, text)["base"])
    assert (ixx, iyy, izz) == pytest.approx((4, 4, 8), rel=1e-5)
    assert izz < ixx + iyy
    (note,) = read_urdf(tmp_path / "robot.urdf").findings
    assert note.message == (
        "link 'base' has principal moments of inertia 1, 1, 5 kg m^2: none may be greater than the sum of the other "
        "two; 4, 4, 8 kg m^2 are used, the smallest increase that is possible; state the moments about the "
        "centre of mass"
    )


def test_a_joint_that_was_let_go_as_it_mimics_itself_moves_by_itself_however_often_it_says_so(tmp_path: Path) -> None:
    text = GOOD.replace("</joint>", '<mimic joint="shoulder"/><mimic joint="shoulder"/></joint>')
    assert read(tmp_path, text, "bad-mimic").joints[0].mimic is None


LIMIT = '<limit lower="-1" upper="2" effort="10" velocity="3"/>'


def engine_text(folder: Path, text: str, *allow: str) -> ET.Element:
    return ET.fromstring(read(folder, text, *allow).urdf)


def part(root: ET.Element, path: str) -> dict[str, str]:
    element = root.find(path)
    assert element is not None
    return element.attrib


def test_all_of_a_good_model_is_there(tmp_path: Path) -> None:
    root = engine_text(tmp_path, GOOD)
    assert [link.attrib["name"] for link in root.findall("link")] == ["base", "upper"]
    assert inertia(root.findall("link")[0]) == (2.0, 1.0, 1.0, 1.0)
    assert part(root, "link/inertial/origin") == {"xyz": "0.0 0.0 0.1"}
    assert part(root, "link/collision/origin") == {"xyz": "1.0 2.0 3.0"}
    assert part(root, "link/collision/geometry/sphere") == {"radius": "0.5"}
    assert part(root, "joint") == {"name": "shoulder", "type": "revolute"}
    assert part(root, "joint/origin") == {"xyz": "0.0 0.0 1.0", "rpy": "0.0 0.0 0.0"}
    assert part(root, "joint/limit") == {"lower": "-1.0", "upper": "2.0", "effort": "10.0", "velocity": "3.0"}
    assert part(root, "joint/dynamics") == {"damping": "0.1"}


@pytest.mark.parametrize("spelling", ["1\t2\t3", " 1  2 3 ", "1&#10;2&#9;3", "+1 2. 3e0", "01 .2E1 3.0000"])
def test_numbers_have_one_spelling(spelling: str, tmp_path: Path) -> None:
    # Bullet takes spaces alone for what is between numbers.
    assert part(engine_text(tmp_path, GOOD.replace("1 2 3", spelling)), "link/collision/origin")["xyz"] == "1.0 2.0 3.0"


@pytest.mark.parametrize(
    ("limit", "lower", "upper"),
    [('lower="-1"', "-1.0", "0.0"), ('upper="2"', "0.0", "2.0"), ('upper="0"', "0.0", "0.0")],
)
def test_a_limit_that_is_left_out_is_0(limit: str, lower: str, upper: str, tmp_path: Path) -> None:
    # Bullet has -1 for an upper one, which is no limit at all.
    root = engine_text(tmp_path, GOOD.replace('lower="-1" upper="2"', limit))
    assert (part(root, "joint/limit")["lower"], part(root, "joint/limit")["upper"]) == (lower, upper)


@pytest.mark.parametrize("limit", ["", '<limit effort="10"/>'])
def test_a_joint_that_was_let_go_without_limits_moves_without(limit: str, tmp_path: Path) -> None:
    attributes = part(engine_text(tmp_path, GOOD.replace(LIMIT, limit), "missing-limits"), "joint/limit")
    assert not {"lower", "upper"} & attributes.keys()
    root = engine_text(tmp_path, GOOD.replace("revolute", "continuous"))
    assert part(root, "joint/limit") == {"effort": "10.0", "velocity": "3.0"}


@pytest.mark.parametrize(
    ("axis", "direction"),
    [
        ('<axis xyz="0 0 2"/>', "0.0 0.0 1.0"),
        ('<axis xyz="0 -3 4"/>', "0.0 -0.6 0.8"),
        ('<axis xyz="0 1e-300 0"/>', "0.0 1.0 0.0"),
        ("<axis/>", "1.0 0.0 0.0"),
        ("", "1.0 0.0 0.0"),
    ],
)
def test_an_axis_is_of_unit_length(axis: str, direction: str, tmp_path: Path) -> None:
    # Bullet slides twice as far along an axis of length 2.
    text = GOOD.replace("revolute", "prismatic").replace('<axis xyz="0 0 2"/>', axis)
    assert part(engine_text(tmp_path, text), "joint/axis")["xyz"] == direction


def test_dynamics_that_say_nothing_are_left_out(tmp_path: Path) -> None:
    # Bullet refuses the whole model.
    assert (
        engine_text(tmp_path, GOOD.replace('<dynamics damping="0.1"/>', "<dynamics/>")).find("joint/dynamics") is None
    )


# Also with prefixes that nobody declared.
@pytest.mark.parametrize("name", ["", ' name=""', ' name="&#10;"', f' name="{"x" * 5000}"', ' xmlns:x="" y:z="1"'])
def test_the_engine_has_its_own_name_for_the_robot(name: str, tmp_path: Path) -> None:
    assert engine_text(tmp_path, GOOD.replace(' name="arm"', name)).attrib == {"name": "robot"}


def test_bullets_scaling_of_an_inertia_is_in_it(tmp_path: Path) -> None:
    contact = '<contact><inertia_scaling value="3"/><lateral_friction value="0.8"/><odd value="1"/></contact></link>'
    root = engine_text(tmp_path, GOOD.replace("</link>", contact, 1))
    assert part(root, "link/inertial/inertia")["ixx"] == "3.0"
    contacts = root.find("link/contact")
    assert contacts is not None
    assert [(child.tag, child.attrib) for child in contacts] == [("lateral_friction", {"value": "0.8"})]


@pytest.mark.parametrize(
    "stray",
    [
        '<link name="base"><inertial/></link>'.replace("link", "x:link"),
        "<deformable name='d'/>",
        "<self_collision_checking/>",
        "<gazebo><link name='base'/></gazebo>",
        "<!-- c --><?go?><![CDATA[<link/>]]>text",
    ],
)
def test_what_is_no_urdf_is_left_out(stray: str, tmp_path: Path) -> None:
    root = ET.tostring(engine_text(tmp_path, GOOD))
    for place in ("</robot>", "</link>", "</joint>"):
        assert ET.tostring(engine_text(tmp_path, GOOD.replace(place, stray + place))) == root


def test_a_second_of_what_there_is_one_of_is_left_out(tmp_path: Path) -> None:
    mass = '<mass value="2"/>'
    root = engine_text(tmp_path, GOOD.replace(mass, f'{mass}<mass value="7"/><origin xyz="9 9 9"/>', 1))
    assert [mass.attrib["value"] for mass in root.iterfind("link/inertial/mass")] == ["2.0", "1.0"]
    assert part(root, "link/inertial/origin") == {"xyz": "0.0 0.0 0.1"}


@pytest.mark.parametrize(
    ("follower", "mimic"),
    [
        ('type="revolute"', 'joint="shoulder" multiplier="0" offset="0.5"'),
        ('type="revolute"', 'joint="hold" multiplier="3" offset="0.5"'),
        ('type="prismatic"', 'joint="hold" offset="0.5"'),
    ],
)
def test_a_joint_whose_mimic_never_moves_it_is_fixed_where_it_would_be(
    follower: str, mimic: str, tmp_path: Path
) -> None:
    links = "".join(f'<link name="{name}">{BALL}</link>' for name in ("still", "hand"))
    hold = '<joint name="hold" type="fixed"><parent link="upper"/><child link="still"/></joint>'
    ends = '<parent link="upper"/><child link="hand"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>'
    joint = f'<joint name="j" {follower}>{ends}<limit lower="-1" upper="1"/><mimic {mimic}/></joint>'
    model = read(tmp_path, GOOD.replace("</robot>", f"{links}{hold}{joint}</robot>"))
    assert model.joints_by_name["j"].type == "fixed"
    at = geometry.compose(geometry.inverse(link_poses(model, {})["upper"]), link_poses(model, {})["hand"])
    if "prismatic" in follower:
        assert at.position_xyz == pytest.approx((0.0, 0.0, 1.5))
    else:
        assert geometry.rpy_from_quaternion(at.orientation_xyzw) == pytest.approx((0.0, 0.0, 0.5))


def test_a_root_without_mass_that_carries_a_robot_does_not_fix_it(tmp_path: Path) -> None:
    massless = BALL.replace('mass value="1"', 'mass value="0"')
    frame = f'<link name="root">{massless}</link>'
    joint = '<joint name="j" type="fixed"><parent link="root"/><child link="base"/></joint>'
    model = read(tmp_path, GOOD.replace("</robot>", f"{frame}{joint}</robot>"))
    assert (model.root, model.links_by_name["root"].mass) == ("root", None)
    assert [finding.rule for finding in model.findings] == ["massless-frame"]
