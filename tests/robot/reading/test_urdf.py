"""URDF -> RobotModel: what is read, what is refused on which line, and that nothing else can happen."""

from __future__ import annotations

import random
import re
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ModelError
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.robot.built_in import FOLDER
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.robot.reading.urdf import read_urdf
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


def test_the_engine_gets_short_lines(tmp_path: Path) -> None:
    one_line = "".join(line.strip() for line in BURGER.splitlines()[1:])
    model = read(tmp_path, one_line.replace("-->", "--> "))
    assert max(len(line) for line in model.urdf.splitlines()) < 200
    assert ET.fromstring(model.urdf).tag == "robot"


def test_meshes_are_given_as_text(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/part.stl").write_text(TETRAHEDRON)
    model = read(tmp_path, ARM.replace('<sphere radius="0.5"/>', '<mesh filename="meshes/part.stl"/>'))
    assert mesh_text(model).count("\nv ") == 4
    assert model.links[0].collisions[0].kind == "mesh"
    assert model.links[0].collisions[0].radius is None


def test_meshes_lie_in_the_workspace(tmp_path: Path) -> None:
    for folder in ("robot/meshes", "robot/urdf"):
        (tmp_path / folder).mkdir(parents=True)
    for mesh in ("robot/meshes/part.stl", "secret.stl"):
        (tmp_path / mesh).write_text(TETRAHEDRON)
    root = (tmp_path / "robot").resolve()
    path = root / "urdf/robot.urdf"
    path.write_text(ARM.replace('<sphere radius="0.5"/>', '<mesh filename="../meshes/part.stl"/>'))
    assert mesh_text(read_urdf(path, Packages(Workspace(root, root))))
    path.write_text(ARM.replace('<sphere radius="0.5"/>', '<mesh filename="../../secret.stl"/>'))
    with pytest.raises(ModelError, match=r"robot\.urdf:6: '\.\./\.\./secret\.stl' is outside the workspace"):
        read_urdf(path, Packages(Workspace(root, root)))


def test_the_nearer_of_two_packages_is_taken_and_that_is_told(tmp_path: Path) -> None:
    for folder in ("near/other", "far/away/other"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "package.xml").write_text("<package><name>other</name></package>")
        (tmp_path / folder / "part.stl").write_text(TETRAHEDRON)
    path = tmp_path / "near/robot.urdf"
    path.write_text(ARM.replace('<sphere radius="0.5"/>', '<mesh filename="package://other/part.stl"/>'))
    model = read_urdf(path, Packages(Workspace(path.parent, tmp_path)))
    assert mesh_text(model)
    assert [finding.rule for finding in model.findings] == ["missing-inertia", "several-packages"]


def test_the_engine_gets_nothing_to_look_at(tmp_path: Path) -> None:
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


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "robot.urdf").open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(ModelError, match="a model may have at most 20 MB"):
        read_urdf(tmp_path / "robot.urdf")


def test_a_visual_without_a_shape_hides_no_other(tmp_path: Path) -> None:
    visuals = '<visual><geometry/></visual><visual><geometry><sphere radius="2"/></geometry></visual>'
    model = read(tmp_path, ARM.replace("</link>", f"{visuals}</link>", 1))
    assert [visual.kind for visual in model.links_by_name["base"].visuals] == ["sphere"]


def test_very_many_problems_are_told_in_few_lines(tmp_path: Path) -> None:
    told = str(refusal(tmp_path, "<robot>\n" + "<link/>\n" * 1000 + "</robot>")).splitlines()
    assert len(told) == 101
    assert told[99].endswith(":101: <link> has no attribute 'name' [missing-part]")
    assert "robot.urdf:102: 900 more problems like these" in told[100]


def test_a_missing_file_and_a_folder_are_model_errors(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.urdf", tmp_path):
        with pytest.raises(ModelError, match="cannot be read: "):
            read_urdf(path)


def test_links_of_meshes_in_a_circle_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("a")
    error = refusal(tmp_path, ARM.replace('<sphere radius="0.5"/>', '<mesh filename="a"/>'))
    # Since Python 3.13, such a path is one that leads nowhere.
    assert re.search("'a' (is not a valid path|does not exist)", str(error))


def mutated(text: str, seed: int) -> bytes:
    """The text with a few things deleted, doubled, exchanged or made up."""
    rng = random.Random(seed)
    data = bytearray(text.encode())
    numbers = ["0.5", "2", "1 0 0", "0.1 0.2 0.3", "nan", "1e999", "-0", "", "0 0 0", "1e-320", "\u0661"]
    numbers += ["x" * 50, "${x}", "base_footprint"]
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        start = rng.randrange(len(data))
        end = min(len(data), start + rng.choice([1, 3, 20, 60]))
        match rng.randrange(7):
            case 0:
                del data[start:end]
            case 1:
                data[start:start] = data[start:end]
            case 2:
                data[start] = rng.randrange(256)
            case 3:
                quote = data.find(b'"', start)
                close = data.find(b'"', quote + 1)
                data[quote + 1 : close] = rng.choice(numbers).encode()
            case 4 | 5:
                after = data.find(b">", start) + 1
                data[after:after] = rng.choice((b"\n", b"\t ", b"<!-- c -->", b"<gazebo/>"))
            case _:
                lines = bytes(data).split(b"\n")
                rng.shuffle(lines) if rng.random() < 0.1 else lines.pop(rng.randrange(len(lines)))
                data = bytearray(b"\n".join(lines))
        if not data:
            break
    return bytes(data)


@examples(120)
@given(st.sampled_from([BURGER, ARM]), st.integers(0, 2**32 - 1))
def test_a_damaged_model_is_a_model_or_a_model_error(
    tmp_path_factory: pytest.TempPathFactory, text: str, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.urdf"
    path.write_bytes(mutated(text, seed))
    try:
        model = read_urdf(path)
    except ModelError as error:
        assert error.location is not None  # noqa: PT017 - either is right
    else:
        assert model.root in model.links_by_name
        assert all(link.mass is None or link.mass >= 0 for link in model.links)


@examples(80)
@given(st.binary(max_size=300))
def test_any_bytes_are_a_model_or_a_model_error(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.urdf"
    path.write_bytes(data)
    with pytest.raises(ModelError):
        read_urdf(path)
