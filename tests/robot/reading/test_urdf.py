"""URDF -> RobotModel: what is read, what is refused on which line, and what an engine gets."""

from __future__ import annotations

import random
import re
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.errors import ModelError
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.drives.wheels import held_joints
from sim_action.robot.built_in import FOLDER
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.robot.reading.urdf import read_urdf
from tests.fuzz.damage import damaged
from tests.fuzz.urdf_damage import mutated
from tests.robot.bad_models import GOOD
from tests.ros_workspace import ros_package, written
from tests.soak import examples
from tests.traces import burger

BURGER = (FOLDER / "turtlebot3_burger.urdf").read_text(encoding="utf-8")

ARM = """\
<robot name="arm">
  <link name="base">
    <inertial><mass value="2.5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision>
      <origin xyz="1 2 3"/>
      <geometry><sphere radius="0.5"/></geometry>
    </collision>
  </link>
  <link name="upper"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 0 2"/>
    <limit lower="-1" upper="2" effort="10" velocity="3" safety="soft"/>
  </joint>
</robot>
"""


def test_parts_that_are_left_out_or_stated_elsewhere(tmp_path: Path) -> None:
    # Exporters write an axis of zero for joints that do not move.
    text = ARM.replace("revolute", "fixed").replace("0 0 2", "0 0 0").replace(' name="arm"', "")
    model = read(tmp_path, text)
    assert (model.name, model.joints[0].axis_xyz) == ("robot", (1.0, 0.0, 0.0))
    tags = "<springStiffness>9</springStiffness><springReference>-0.5</springReference>"
    text = ARM.replace("</robot>", f'<gazebo reference="shoulder">{tags}</gazebo></robot>')
    joint = read(tmp_path, text.replace("revolute", "continuous")).joints_by_name["shoulder"]
    assert (joint.stiffness, joint.spring_reference) == (9.0, -0.5)
    assert (joint.lower, joint.upper, joint.max_effort, joint.axis_xyz) == (None, None, 10.0, (0.0, 0.0, 1.0))


# One of its corners twice as far out as the others.
TETRAHEDRON = (
    "solid t\n"
    + "".join(
        f"facet normal 0 0 0\nouter loop\n{''.join(f'vertex {point}{chr(10)}' for point in face)}endloop\nendfacet\n"
        for face in combinations(("0 0 0", "1 0 0", "0 1 0", "0 0 2"), 3)
    )
    + "endsolid t\n"
)


def mesh_text(model: RobotModel) -> str:
    """What the engine is given for the one mesh of a model."""
    (mesh,) = ET.fromstring(model.urdf).iter("mesh")
    return model.hull_files[mesh.attrib["filename"]].decode()


def read(folder: Path, text: str | bytes) -> RobotModel:
    path = folder / "robot.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_urdf(path)


def refusal(folder: Path, text: str | bytes) -> ModelError:
    with pytest.raises(ModelError) as raised:
        read(folder, text)
    return raised.value


def test_links_joints_and_limits_are_read(tmp_path: Path) -> None:
    model = read(tmp_path, ARM)
    assert (model.name, model.source) == ("arm", str(tmp_path / "robot.urdf"))
    assert [(link.name, link.mass) for link in model.links] == [("base", 2.5), ("upper", None)]
    (shape,) = model.links[0].collisions
    assert (shape.kind, shape.radius, shape.pose.position_xyz) == ("sphere", 0.5, (1.0, 2.0, 3.0))
    (joint,) = model.joints
    assert (joint.type, joint.parent, joint.child) == ("revolute", "base", "upper")
    assert (joint.lower, joint.upper, joint.max_effort, joint.max_velocity) == (-1.0, 2.0, 10.0, 3.0)
    assert joint.origin.position_xyz == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("limits", "read_as"),
    [
        ('upper="2"', (0.0, 2.0)),
        ('lower="-1"', (-1.0, 0.0)),
        ('lower="0.5" upper="1e16"', (0.5, None)),
        ('lower="-1e16" upper="-0.5"', (None, -0.5)),
        ('lower="-1e17" upper="1e16"', (None, None)),
        ('lower="0" upper="9e15"', (0.0, 9e15)),
    ],
)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_limit_left_out_is_0_and_one_of_1e16_is_none(
    kind: str, limits: str, read_as: tuple[float | None, float | None], tmp_path: Path
) -> None:
    text = ARM.replace('lower="-1" upper="2"', limits).replace("revolute", kind)
    (joint,) = read(tmp_path, text).joints
    assert (joint.lower, joint.upper) == read_as


def test_meshes_are_given_as_text_and_lie_in_the_workspace(tmp_path: Path) -> None:
    for mesh in ("robot/meshes/part.stl", "secret.stl"):
        written(tmp_path / mesh, TETRAHEDRON)
    root = (tmp_path / "robot").resolve()
    reference = ARM.replace('<sphere radius="0.5"/>', '<mesh filename="../meshes/part.stl"/>')
    path = written(root / "urdf/robot.urdf", reference)
    model = read_urdf(path, Packages(Workspace(root, root)))
    assert mesh_text(model).count("\nv ") == 4
    shape = model.links[0].collisions[0]
    assert (shape.kind, shape.radius) == ("mesh", None)
    path.write_text(ARM.replace('<sphere radius="0.5"/>', '<mesh filename="../../secret.stl"/>'))
    with pytest.raises(ModelError, match=r"robot\.urdf:6: '\.\./\.\./secret\.stl' is outside the workspace"):
        read_urdf(path, Packages(Workspace(root, root)))


def test_the_nearer_of_two_packages_is_taken_and_that_is_told(tmp_path: Path) -> None:
    for folder in ("near/other", "far/away/other"):
        written(ros_package(tmp_path / folder) / "part.stl", TETRAHEDRON)
    reference = ARM.replace('<sphere radius="0.5"/>', '<mesh filename="package://other/part.stl"/>')
    path = written(tmp_path / "near/robot.urdf", reference)
    model = read_urdf(path, Packages(Workspace(path.parent, tmp_path)))
    assert mesh_text(model)
    assert [finding.rule for finding in model.findings] == ["unknown-part", "missing-inertia", "several-packages"]


def test_the_engine_gets_short_lines_and_nothing_to_look_at(tmp_path: Path) -> None:
    one_line = "".join(line.strip() for line in BURGER.splitlines()[1:])
    model = read(tmp_path, one_line.replace("-->", "--> "))
    assert max(len(line) for line in model.urdf.splitlines()) < 200
    assert ET.fromstring(model.urdf).tag == "robot"
    texture = '<material name="m"><texture filename="/etc/hostname"/><color rgba="1 0 0 1"/></material>'
    visual = f'<visual><geometry><sphere radius="1"/></geometry>{texture}</visual>'
    urdf = read(tmp_path, ARM.replace("</link>", f"{visual}</link>{texture}", 1)).urdf
    assert not any(word in urdf for word in ("texture", "visual", "material"))


def test_other_encodings_and_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    text = ARM.replace("arm", "bras-é")
    assert read(tmp_path, b"\xef\xbb\xbf" + text.encode()).name == "bras-é"
    declared = f'<?xml version="1.0" encoding="ISO-8859-1"?>\n{text}'
    assert read(tmp_path, declared.encode("latin-1")).name == "bras-é"


def test_the_burger_weighs_and_is_what_is_published() -> None:
    model = burger()
    assert model.mass == pytest.approx(1.002)
    assert model.root == "base_footprint"
    assert [joint.name for joint in model.moving_joints] == ["wheel_left_joint", "wheel_right_joint"]
    assert model.links_by_name["caster_back_link"].collisions == (
        Shape("sphere", Pose(), 0.006, (-0.006,) * 3, (0.006,) * 3),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not well-formed XML: no element found"),
        ("robot", "not well-formed XML"),
        ('<robot>\n<?xml version="1.0"?></robot>', ":2: not well-formed XML: there is text before <?xml ...?>"),
        ("<robot>\n</robot>\0", ":2: not well-formed XML: a NUL character; remove it"),
        ("<sdf/>", "the root element of a URDF is <robot>, but this file has <sdf>"),
        ("<mujoco/>", "it is MJCF, which only MuJoCo reads"),
        ("<robot/>", "the model has no <link>; at least one is required"),
        ("<robot>" + "<a>" * 5000, "more than 100 elements inside each other"),
        (b"\xff\xfe\x00", "not well-formed XML"),
        (b"\x00" * 100, "not well-formed XML"),
        ('<?xml version="1.0" encoding="utf-7"?><robot/>', "save the model as UTF-8"),
        ('<?xml version="1.0" encoding="shift_jis"?><robot/>', "save the model as UTF-8"),
    ],
)
def test_files_that_are_no_urdf_are_refused(text: str | bytes, message: str, tmp_path: Path) -> None:
    assert message in str(refusal(tmp_path, text))


def test_a_huge_file_is_refused_unread_and_a_missing_one_and_a_folder_as_well(tmp_path: Path) -> None:
    with (tmp_path / "robot.urdf").open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(ModelError, match="a model may have at most 20 MB"):
        read_urdf(tmp_path / "robot.urdf")
    for path in (tmp_path / "absent.urdf", tmp_path):
        with pytest.raises(ModelError, match="cannot be read: "):
            read_urdf(path)


def test_a_visual_without_a_shape_hides_no_other(tmp_path: Path) -> None:
    visuals = '<visual><geometry/></visual><visual><geometry><sphere radius="2"/></geometry></visual>'
    model = read(tmp_path, ARM.replace("</link>", f"{visuals}</link>", 1))
    assert [visual.kind for visual in model.links_by_name["base"].visuals] == ["sphere"]


def test_very_many_problems_are_told_in_few_lines(tmp_path: Path) -> None:
    told = str(refusal(tmp_path, "<robot>\n" + "<link/>\n" * 1000 + "</robot>")).splitlines()
    assert len(told) == 101
    assert told[99].endswith(":101: <link> has no attribute 'name' [missing-part]")
    assert "robot.urdf:102: 900 more problems like these" in told[100]


def test_links_of_meshes_in_a_circle_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("a")
    error = refusal(tmp_path, ARM.replace('<sphere radius="0.5"/>', '<mesh filename="a"/>'))
    # Since Python 3.13, such a path is one that leads nowhere.
    assert re.search("'a' (is not a valid path|does not exist)", str(error))


@examples(120)
@given(st.sampled_from([BURGER, ARM]), st.integers(0, 2**32 - 1))
def test_a_damaged_model_is_a_model_or_a_model_error(
    tmp_path_factory: pytest.TempPathFactory, text: str, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.urdf"
    chance = random.Random(seed)
    data = mutated(text, chance).encode("utf-8", "surrogatepass")
    path.write_bytes(data if seed % 2 else damaged(data, chance))
    try:
        model = read_urdf(path)
    except ModelError as error:
        assert error.location is not None  # noqa: PT017 - either is right
    else:
        assert model.root in model.links_by_name
        assert all(link.mass is None or link.mass >= 0 for link in model.links)


BALL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="2" effort="10" velocity="3"/>'


def read_allowing(folder: Path, text: str, *allow: str) -> RobotModel:
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


def test_an_expression_and_a_mimic_of_itself_that_were_let_go_are_left_out(tmp_path: Path) -> None:
    text = GOOD.replace("</joint>", '<mimic joint="shoulder"/><mimic joint="shoulder"/></joint>')
    assert read_allowing(tmp_path, text, "bad-mimic").joints[0].mimic is None
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


def engine_text(folder: Path, text: str, *allow: str) -> ET.Element:
    return ET.fromstring(read_allowing(folder, text, *allow).urdf)


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
    assert part(root, "joint/limit") == {"lower": "-1.00005", "upper": "2.00005", "effort": "10.0", "velocity": "3.0"}
    assert part(root, "joint/dynamics") == {"damping": "0.1"}


@pytest.mark.parametrize("spelling", ["1\t2\t3", " 1  2 3 ", "1&#10;2&#9;3", "+1 2. 3e0", "01 .2E1 3.0000"])
def test_numbers_have_one_spelling(spelling: str, tmp_path: Path) -> None:
    # Bullet takes spaces alone for what is between numbers.
    assert part(engine_text(tmp_path, GOOD.replace("1 2 3", spelling)), "link/collision/origin")["xyz"] == "1.0 2.0 3.0"


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
    # Bullet refuses the whole model for dynamics that say nothing.
    root = engine_text(tmp_path, GOOD.replace('<dynamics damping="0.1"/>', "<dynamics/>"))
    assert root.find("joint/dynamics") is None


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
    model = read_allowing(tmp_path, GOOD.replace("</robot>", f"{links}{hold}{joint}</robot>"))
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
    model = read_allowing(tmp_path, GOOD.replace("</robot>", f"{frame}{joint}</robot>"))
    assert (model.root, model.links_by_name["root"].mass) == ("root", None)
    assert [finding.rule for finding in model.findings] == ["massless-frame"]


def read_series(folder: Path, kind: str, more: str = "", axis: str = "0 0 2") -> RobotModel:
    """Return a model with a joint of several motions, which is replaced by joints in series and massless links."""
    model = read_allowing(folder, GOOD.replace("revolute", kind).replace(LIMIT, more).replace("0 0 2", axis))
    assert model.findings == ()
    return model


def test_a_planar_joint_is_two_slides_and_a_hinge(tmp_path: Path) -> None:
    model = read_series(tmp_path, "planar")
    assert [(part.name, part.type, part.axis_xyz) for part in model.joints] == [
        ("shoulder_x", "prismatic", (1, 0, 0)),
        ("shoulder_y", "prismatic", (0, 1, 0)),
        ("shoulder_turn", "continuous", (0, 0, 1)),
    ]
    assert {part.series for part in model.joints} == {"shoulder"}
    assert held_joints(model) == frozenset()
    assert model.mass == 3
    root = ET.fromstring(model.urdf)
    masses = {link.attrib["name"]: mass.attrib["value"] for link in root for mass in link.iterfind("inertial/mass")}
    assert masses == {"base": "2.0", "upper": "1.0", "shoulder_x": "0.0", "shoulder_y": "0.0"}
    at = link_poses(model, {"shoulder_x": 1.0, "shoulder_y": 2.0, "shoulder_turn": 0.5})["upper"]
    assert at.position_xyz == pytest.approx((1, 2, 1))
    assert [joint.get("damping") for joint in root.iterfind("joint/dynamics")] == ["0.1"] * 3
    x, y, z = (pytest.approx(axis) for axis in geometry.AXES)
    for axis, slides in (("3 0 0", [y, z]), ("0 1 0", [z, x]), ("0 0 -1", [x, pytest.approx((0, -1, 0))])):
        assert [slide.axis_xyz for slide in read_series(tmp_path, "planar", axis=axis).joints[:2]] == slides


def test_a_universal_joint_has_limits_for_each_axis(tmp_path: Path) -> None:
    model = read_series(tmp_path, "universal", '<limit lower="-1" upper="1"/><axis2 xyz="0 1 0"/><limit2 effort="3"/>')
    first, second = model.joints
    assert (first.name, first.type, first.lower, first.upper) == ("shoulder_1", "revolute", -1, 1)
    assert (second.name, second.type, second.lower, second.max_effort) == ("shoulder_2", "continuous", None, 3)
    assert held_joints(model) == frozenset()


def test_a_floating_joint_below_the_base_is_three_slides_and_a_ball_joint(tmp_path: Path) -> None:
    model = read_series(tmp_path, "floating")
    slides = [f"shoulder_slide_{axis}" for axis in "xyz"]
    assert [part.name for part in model.joints] == [*slides, "shoulder_x", "shoulder_y", "shoulder_z"]
    assert [link.name for link in model.links if link.mass is None] == [*slides, "shoulder_x", "shoulder_y"]
    assert model.balls == ("shoulder",)
