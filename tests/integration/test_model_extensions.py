"""Extensions of URDF, and surfaces, that must act on both engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import sim_action
from sim_action.core import geometry
from sim_action.core.errors import RefusedModel
from sim_action.robot.documents.xml_document import parse_document
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.trace import Trace
from sim_action.world import Ground, World
from tests.integration.engines import advance, at, inertia, on_every_engine, one_link, running, scene_of

LEAN = 0.981  # m/s^2, along x: a body without friction moves by half of that in the first second


def moved(engine: str, folder: Path, urdf: str) -> float:
    """Return the way along x in m of a robot in 1 s on a ground that leans."""
    scene = scene_of(folder, urdf, at(), World(gravity=(LEAN, 0, -9.81), ground=Ground(friction=1.0)))
    with running(engine, scene) as backend:
        trace: Trace = advance(backend, 0, 240)
    return float(trace.base_position_xyz[-1, 0])


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


def rules(found: RobotModel) -> list[str]:
    return [finding.rule for finding in found.findings if finding.rule != "no-collision-shape"]


@pytest.mark.parametrize(
    ("control", "positions", "noted"),
    [
        (
            (
                '<joint name="j1"><state_interface name="position"><param name="initial_value">-1.57</param>'
                "</state_interface></joint>"
            ),
            {"j1": -1.57, "j2": 0.0},
            ["start-position"],
        ),
        (
            '<joint name="j2"><param name="initial_position">0.5</param></joint>',
            {"j1": 0, "j2": 0.5},
            ["start-position"],
        ),
        (
            (
                '<joint name="j1"><state_interface name="velocity"><param name="initial_value">1</param>'
                "</state_interface></joint>"
            ),
            {"j1": 0, "j2": 0},
            [],
        ),
        (
            (
                '<joint name="j1"><state_interface name="position"><param name="initial_value">x</param>'
                "</state_interface></joint>"
            ),
            {"j1": 0, "j2": 0},
            ["passed-over"],
        ),
        (
            (
                '<joint name="j1"><param name="initial_position">0.5</param></joint><joint name="j2">'
                '<param name="mimic">j1</param><param name="multiplier">-0.5</param>'
                '<param name="offset">0.1</param></joint>'
            ),
            {"j1": 0.5, "j2": -0.15},
            ["control-mimic", "start-position"],
        ),
    ],
)
def test_ros2_control_states_start_positions_and_followers(
    control: str, positions: dict[str, float], noted: list[str], tmp_path: Path
) -> None:
    found = model(tmp_path, arm(control))
    assert found.positions({}) == pytest.approx(positions)
    assert rules(found) == noted
    assert found.positions({"j1": 0.2})["j1"] == 0.2


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


def test_adhesion_holds_as_in_mujoco_alone(tmp_path: Path) -> None:
    mujoco: Any = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    from tests.integration.test_native_robots import scene

    text = """<mujoco><option gravity="0 0 {gravity}"/><worldbody>{floor}<body name="b" pos="0 0 .1"><freejoint/>
      <geom type="sphere" size=".1" mass="1" adhesion="{adhesion}" gap=".01"/></body></worldbody></mujoco>"""
    for adhesion in (25, 15):
        plain = mujoco.MjModel.from_xml_string(
            text.format(gravity=20, adhesion=adhesion, floor='<geom type="plane" size="1 1 1"/>')
        )
        data = mujoco.MjData(plain)
        mujoco.mj_step(plain, data, 250)
        robot = scene(tmp_path, text.format(gravity=-9, adhesion=adhesion, floor=""), World(gravity=(0, 0, 20)))
        with running("mujoco", robot) as engine:
            trace = advance(engine, 0, 120)
        assert (data.qpos[2] < 0.12) == (trace.base_position_xyz[-1, 2] < 0.12) == (adhesion == 25)


@pytest.mark.parametrize("option", ['integrator="RK4"', 'cone="pyramidal" solver="PGS"', 'iterations="3" impratio="2"'])
def test_the_options_of_the_solver_are_named(option: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    from tests.integration.test_native_robots import scene

    text = f'<mujoco><option {option}/><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    notes = [finding.message for finding in scene(tmp_path, text).model.findings]
    assert all(any(name.split("=")[0] in note for note in notes) for name in option.split())


SUCTION = "world: {disturbances: [{at: 0, link: suction, adhesion: %s N}]}\n"


@pytest.mark.parametrize(
    ("keyframe", "world", "passes"),
    [
        ("on", "", True),
        ("off", "", False),
        ("off", SUCTION % 25, True),
        ("off", SUCTION % 5, False),
        ("off", SUCTION % 31, "the actuator 'suction' holds with 30 N at most"),
        (
            "off",
            "world: {disturbances: [{at: 0, link: suction, payload: 1 kg}]}\n",
            "give 'adhesion', or name its link",
        ),
        ("off", "world: {disturbances: [{at: 0, link: suctoin, adhesion: 5 N}]}\n", "the robot has no link 'suctoin'"),
    ],
)
def test_an_adhesion_actuator_obeys_the_keyframe_and_disturbances(
    keyframe: str, world: str, passes: bool | str, tmp_path: Path
) -> None:
    """A suction of 30 N at a control of 1 holds 1 kg, which weighs 9.8 N, against 20 N upward, as 25 N do."""
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    (tmp_path / "foot.xml").write_text(
        '<mujoco><worldbody><body name="foot" pos="0 0 .05"><freejoint/><geom type="box" size=".05 .05 .05" mass="1"/>'
        '</body></worldbody><actuator><adhesion name="suction" body="foot" ctrlrange="0 1" gain="30"/></actuator>'
        '<keyframe><key name="on" qpos="0 0 .05 1 0 0 0" ctrl="1"/><key name="off" qpos="0 0 .05 1 0 0 0" ctrl="0"/>'
        "</keyframe></mujoco>"
    )
    (tmp_path / "foot.sim.yml").write_text(
        f"name: suction\nrobot: {{model: foot.xml, keyframe: '{keyframe}'}}\nbackend: mujoco\n{world}"
        "commands: [{wrench: {force: [0, 0, 20 N], at: 0.2 s, for: 1 s}}]\n"
        "expect: [{stay_within: {z: [-0.06 m, 0.06 m]}}]\ntime_limit: 1 s\n"
    )
    results = sim_action.run(tmp_path / "foot.sim.yml", report=False)
    if isinstance(passes, str):
        assert passes in str(results.outcomes[0].failures)
    else:
        assert results.passed == passes
