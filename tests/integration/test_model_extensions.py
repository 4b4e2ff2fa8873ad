"""Extensions of URDF, and surfaces, that must act on both engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from sim_action.core import geometry
from sim_action.core.errors import RefusedModel
from sim_action.robot.documents.xml_document import parse_document
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from sim_action.world import Ground, World
from tests.integration.engines import at, inertia, on_every_engine, one_link, scene_of, travelled

LEAN = 0.981  # m/s^2, along x: a body without friction moves by half of that in the first second


def moved(engine: str, folder: Path, urdf: str) -> float:
    """Return the way along x in m of a robot in 1 s on a ground that leans."""
    scene = scene_of(folder, urdf, at(), World(gravity=(LEAN, 0, -9.81), ground=Ground(friction=1.0)))
    return float(travelled(engine, scene, 240).base_position_xyz[-1, 0])


BOX = '<box size="0.2 0.2 0.2"/>'


def surface(path: Sequence[str], value: float) -> str:
    """Return a <gazebo> tag with a number at a path."""
    opening, closing = "".join(f"<{tag}>" for tag in path), "".join(f"</{tag}>" for tag in reversed(path))
    return f'<gazebo reference="it">{opening}{value}{closing}</gazebo></robot>'


@on_every_engine
@pytest.mark.parametrize("friction", [0.0, 0.05])
@pytest.mark.parametrize("path", [("mu1",), ("collision", "surface", "friction", "ode", "mu")])
def test_the_friction_of_a_gazebo_tag_acts(engine: str, path: Sequence[str], friction: float, tmp_path: Path) -> None:
    urdf = one_link(BOX).replace("</robot>", surface(path, friction))
    assert moved(engine, tmp_path, urdf) == pytest.approx(0.5 * (LEAN - 9.81 * friction), rel=0.03)


@on_every_engine
@pytest.mark.parametrize(
    "stated", ['<drake:mu_static value="0.05"/>', '<drake:mu_static value="1"/><drake:mu_dynamic value="0.05"/>']
)
def test_the_friction_of_drake_acts(engine: str, stated: str, tmp_path: Path) -> None:
    properties = f"<drake:proximity_properties>{stated}</drake:proximity_properties>"
    urdf = one_link(BOX, properties).replace("<robot", '<robot xmlns:drake="http://drake.mit.edu"')
    assert moved(engine, tmp_path, urdf) == pytest.approx(0.5 * (LEAN - 9.81 * 0.05), rel=0.03)


@on_every_engine
@pytest.mark.parametrize("rolling", [0.0, 0.005, 0.5])
def test_a_ball_with_rolling_friction_rolls_less(engine: str, rolling: float, tmp_path: Path) -> None:
    contact = f'<contact><lateral_friction value="1"/><rolling_friction value="{rolling}"/></contact>'
    urdf = one_link('<sphere radius="0.1"/>').replace("<inertial>", f"{contact}<inertial>", 1)
    # A torque of the coefficient times the weight acts against 7/5 m r^2 of inertia about the contact.
    push = max(0.0, LEAN - rolling * 9.81 / 0.1) / 1.4
    assert moved(engine, tmp_path, urdf) == pytest.approx(0.5 * push, abs=0.02)


def arm(control: str = "", limits: str = 'lower="-3" upper="3"') -> str:
    """Return two joints about x, with a <ros2_control>."""
    links = "".join(
        f'<link name="{name}"><inertial><mass value="1"/>{inertia(0.01)}</inertial></link>' for name in ("l1", "l2")
    )
    joints = "".join(
        f'<joint name="j{number}" type="revolute"><parent link="world"/><child link="l{number}"/>'
        f'<limit {limits} effort="9" velocity="9"/></joint>'
        for number in (1, 2)
    )
    hardware = f'<ros2_control name="c" type="system">{control}</ros2_control>'
    return f'<robot name="arm"><link name="world"/>{links}{joints}{hardware}</robot>'


def model(folder: Path, text: str) -> RobotModel:
    (folder / "robot.urdf").write_text(text, encoding="utf-8")
    return read_urdf(folder / "robot.urdf")


def starts(joint: str, interface: str, value: str) -> str:
    stated = f'<state_interface name="{interface}"><param name="initial_value">{value}</param></state_interface>'
    return f'<joint name="{joint}">{stated}</joint>'


START = '<joint name="{}"><param name="initial_position">0.5</param></joint>'
FOLLOWS = (
    '<joint name="j2"><param name="mimic">j1</param><param name="multiplier">-0.5</param>'
    '<param name="offset">0.1</param></joint>'
)


@pytest.mark.parametrize(
    ("control", "positions", "noted"),
    [
        (starts("j1", "position", "-1.57"), {"j1": -1.57, "j2": 0.0}, ["start-position"]),
        (START.format("j2"), {"j1": 0, "j2": 0.5}, ["start-position"]),
        (starts("j1", "velocity", "1"), {"j1": 0, "j2": 0}, []),
        (starts("j1", "position", "x"), {"j1": 0, "j2": 0}, ["passed-over"]),
        (START.format("j1") + FOLLOWS, {"j1": 0.5, "j2": -0.15}, ["control-mimic", "start-position"]),
    ],
)
def test_ros2_control_states_start_positions_and_followers(
    control: str, positions: dict[str, float], noted: list[str], tmp_path: Path
) -> None:
    read = model(tmp_path, arm(control))
    assert read.positions({}) == pytest.approx(positions)
    assert [finding.rule for finding in read.findings if finding.rule != "no-collision-shape"] == noted
    assert read.positions({"j1": 0.2})["j1"] == 0.2


def test_ros2_control_states_the_start_of_a_motion_of_a_joint_with_several(tmp_path: Path) -> None:
    read = model(tmp_path, arm(START.format("j1_2")).replace("revolute", "universal", 1))
    assert [read.positions({})[name] for name in ("j1_1", "j1_2")] == [0, 0.5]
    assert "start-position" in {finding.rule for finding in read.findings}


@pytest.mark.parametrize("rpy", [(0.3, 0.0, 0.0), (0.1, -0.7, 2.0), (0.0, 1.5707963267948966, 0.4)])
def test_a_quaternion_of_urdf_1_1_turns_as_angles_do(rpy: tuple[float, float, float], tmp_path: Path) -> None:
    by_angles = arm().replace("<limit", f'<origin xyz="1 2 3" rpy="{" ".join(map(str, rpy))}"/><limit')
    # A factor does not matter.
    quaternion = " ".join(str(2 * part) for part in geometry.quaternion_from_rpy(*rpy))
    by_quaternion = arm().replace("<limit", f'<origin xyz="1 2 3" quat_xyzw="{quaternion}"/><limit')
    one, other = (
        link_poses(model(tmp_path, text), {"j1": 0.2, "j2": 0.0})["l1"] for text in (by_angles, by_quaternion)
    )
    assert other.orientation_xyzw == pytest.approx(one.orientation_xyzw, abs=1e-9)


@pytest.mark.parametrize("origin", ['quat_xyzw="0 0 0 0"', 'quat_xyzw="0 0 1"', 'quat_xyzw="0 0 0 1" rpy="0 0 0"'])
def test_an_impossible_quaternion_is_refused(origin: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedModel, match="quat_xyzw"):
        model(tmp_path, arm().replace("<limit", f"<origin {origin}/><limit"))


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("<a>\n<!-- run it: gz -r -s --iterations 9 --><b/></a>", ""),
        ("<a><!---- title ----><b/></a>", ""),
        ("<a>\n<!-- a\n- -- --><!-- b -- --><b/></a>", ""),
        ("<a><!-- fine - & --><b/></a>", None),
        ("<a>\nP & Q &lt; R&S</a>", "P & Q < R&S"),
        ("<a><![CDATA[<!-- P -- & Q -->]]></a>", None),
    ],
)
def test_what_tinyxml_reads_is_read_with_a_note(text: str, read: str | None) -> None:
    document = parse_document(text.encode(), "w.sdf")
    assert [finding.rule for finding in document.findings] == ([] if read is None else ["lenient-xml"])
    assert read is None or (document.root.text or "").strip() == read
    assert read is None or document.findings[0].location.line == (2 if "\n" in text else 1)
