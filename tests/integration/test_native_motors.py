"""Motors, controllers, tendons, equalities and keyframes of MJCF models, simulated; compared with MuJoCo alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sim_action
from sim_action.core.errors import BadStart, ModelError
from sim_action.core.geometry import Pose
from sim_action.simulation.start_checks import raised_to_stand, refuse_bad_start
from sim_action.state.command import JointTargets
from sim_action.state.observation import Overlap
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, GROUND, World
from tests.integration.engines import advance, running, travelled
from tests.integration.test_native_robots import scene

mujoco: Any = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
RATE = 240
# The geoms collide with nothing, because MuJoCo alone would let parts of the robot touch each other.
ARM = f"""<mujoco model="arm">
  <compiler angle="radian"/>
  <option integrator="implicitfast" timestep="{1 / RATE}" cone="elliptic" gravity="0 0 {-GRAVITY}"/>
  <default><geom contype="0" conaffinity="0"/><joint damping="0.2"/>
    <default class="servo"><position kp="60" kv="4" forcerange="-9 9"/></default></default>
  <worldbody><body name="base" pos="0 0 1"><geom size="0.1"/>
    <body name="upper"><joint name="shoulder" axis="0 1 0" range="-2 2" frictionloss="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
      <body name="lower" pos="0.4 0 0"><joint name="elbow" axis="0 1 0" ref="0.3"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/><site name="tip" pos="0.3 0 0"/>
        <body name="spinner" pos="0.3 0 0"><joint name="spin" axis="1 0 0"/>
          <geom type="box" size="0.02 0.05 0.03"/></body>
        <body name="flap" pos="0.2 0 0"><joint name="flap" axis="0 1 0" stiffness="2"/><geom size="0.03"/></body>
        <body name="f1" pos="0.3 0 0"><joint name="f1" type="slide" axis="0 1 0" range="0 0.04"/>
          <geom size="0.02"/></body>
        <body name="f2" pos="0.3 0 0"><joint name="f2" type="slide" axis="0 -1 0" range="0 0.04"/>
          <geom size="0.02"/></body>
      </body></body></body>
    <body name="crank" pos="1 0 1"><joint name="crank" axis="0 1 0"/>
      <geom type="box" pos="0.1 0 0" size="0.1 0.01 0.01"/>
      <site name="end" pos="0.2 0 0"/></body></worldbody>
  <tendon><fixed name="grip"><joint joint="f1" coef="0.5"/><joint joint="f2" coef="0.5"/></fixed>
    <spatial name="spring" stiffness="15" damping="1"><site site="tip"/><site site="end"/></spatial></tendon>
  <equality><joint joint1="f2" joint2="f1"/></equality>
  <actuator>
    <position class="servo" name="shoulder" joint="shoulder" ctrlrange="-1 1"/>
    <motor name="elbow" joint="elbow" gear="3" ctrlrange="-2 2"/>
    <velocity name="spin" joint="spin" kv="0.01" gear="2"/>
    <general name="grip" tendon="grip" ctrlrange="0 255" biastype="affine" gainprm="0.0157" biasprm="0 -100 -10"/>
    <motor name="pull" tendon="spring"/>
  </actuator>
  <keyframe><key name="home" qpos="0.5 -0.4 0 0.1 0.02 0.02 0.3" ctrl="0.5 0 0 128 0"/>
    <key qpos="0 0 0 0 0 0 0"/></keyframe>
</mujoco>"""

LIMIT_RAD = 1e-7  # largest difference in rad (m) to MuJoCo alone, over the whole run


def positions(trace: Trace) -> Any:
    """Return the joint positions (T, J)."""
    return trace.state[:, 14 : 14 + len(trace.joint_names)]


def efforts(trace: Trace) -> Any:
    """Return the joint efforts (T, J)."""
    return trace.state[:, 14 + 2 * len(trace.joint_names) :]


def alone(steps: int, controls: Callable[[int], dict[str, float]], key: str | None = "home") -> Any:
    """Return the joint positions (T, J) after each step of MuJoCo alone."""
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    rows = []
    for step in range(steps):
        for name, control in controls(step).items():
            data.ctrl[model.actuator(name).id] = control
        mujoco.mj_step(model, data)
        rows.append(data.qpos.copy())
    return np.array(rows)


def test_motors_tendons_and_equalities_move_the_joints_as_mujoco_alone(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM, keyframe="home")

    def target(step: int) -> float:
        return 0.5 + 0.9 * step / 480

    commands = [
        JointTargets(
            position={"shoulder": target(step), "f1": 0.03 if step > 100 else 0.0},
            velocity={"spin": 4.0},
            effort={"elbow": 7.0},
        )
        for step in range(480)
    ]

    def controls(step: int) -> dict[str, float]:
        # 3 times 2 is the most that the elbow can exert.
        grip = 100 * (0.03 if step > 100 else 0.0) / 0.0157
        return {"shoulder": target(step), "elbow": 7 / 3, "spin": 2 * 4.0, "grip": grip}

    trace = travelled("mujoco", arm, 480, *commands)
    expected = alone(480, controls)
    names = [joint.name for joint in arm.model.moving_joints]
    assert names == ["shoulder", "elbow", "spin", "flap", "f1", "f2", "crank"]
    assert np.abs(positions(trace) - expected).max() < LIMIT_RAD
    # All of them moved.
    assert np.ptp(expected, axis=0).min() > 0.005
    assert efforts(trace)[:, 0].max() <= 9 + 1e-9
    assert efforts(trace)[-1, 1] == pytest.approx(6)


def test_the_motors_hold_the_keyframe_as_mujoco_alone(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM, keyframe="home")
    trace = travelled("mujoco", arm, 240, JointTargets(effort={"elbow": 0.0}))
    assert np.abs(positions(trace) - alone(240, lambda _: {})).max() < LIMIT_RAD


def test_joints_of_the_scenario_override_the_keyframe_and_its_controls(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM, keyframe="home", joints={"shoulder": -0.3, "f1": 0.01})
    assert arm.joint_positions == pytest.approx(
        {"shoulder": -0.3, "elbow": -0.4, "spin": 0, "flap": 0.1, "f1": 0.01, "f2": 0.01, "crank": 0.3}
    )
    assert set(arm.controls) == {"elbow", "spin", "pull"}
    trace = travelled("mujoco", arm, 480, JointTargets(effort={"elbow": 0.0}))
    assert positions(trace)[-1, 0] == pytest.approx(-0.3, abs=0.3)
    assert positions(trace)[-1, 4] == pytest.approx(0.01, abs=0.002)


def test_a_motor_that_cannot_do_what_is_commanded_gives_way_to_the_servo(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM)
    with running("mujoco", arm) as engine:
        # The elbow is a motor; the shoulder a position servo, whose target moves.
        trace = advance(engine, 0, 240, JointTargets(velocity={"shoulder": 0.5}, position={"elbow": 0.5}))
        later = advance(engine, 240, 240, JointTargets(effort={"shoulder": 0.0}))
    assert positions(trace)[0, 1] == pytest.approx(0.3, abs=0.02)
    assert positions(trace)[-1, 1] == pytest.approx(0.5, abs=0.01)
    assert positions(trace)[-1, 0] - positions(trace)[120, 0] == pytest.approx(0.25, abs=0.1)
    assert efforts(later)[-1, 0] == pytest.approx(0, abs=1e-9)
    assert positions(later)[-1, 0] > positions(trace)[-1, 0] + 0.2


def test_an_actuator_without_a_joint_to_command_is_a_note(tmp_path: Path) -> None:
    notes = [finding for finding in scene(tmp_path, ARM).model.findings if "no command can name" in finding.message]
    line = next(number for number, text in enumerate(ARM.splitlines(), 1) if 'name="pull"' in text)
    assert [finding.location.line for finding in notes] == [line]


def test_a_keyframe_has_its_name_and_its_number_and_a_typo_has_a_suggestion(tmp_path: Path) -> None:
    for key, elbow in ((1, 0), ("1", 0), (0, -0.4), ("home", -0.4)):
        assert scene(tmp_path, ARM, keyframe=key).joint_positions["elbow"] == elbow
    for key, problem in (
        ("hone", "has no keyframe 'hone'; did you mean 'home'"),
        ("xx", r"the model has no keyframe 'xx' \(allowed: 1, home\)$"),
        (2, "the model has no keyframe '2'"),
    ):
        with pytest.raises(ModelError, match=problem):
            scene(tmp_path, ARM, keyframe=key)
    with pytest.raises(ModelError, match="the model has no keyframes; remove 'keyframe: home'"):
        scene(tmp_path, "<mujoco><worldbody><body><geom size='1'/></body></worldbody></mujoco>", keyframe="home")


@pytest.mark.parametrize(
    ("before", "after", "flaw"),
    [
        ("0.02 0.3", "0.02", "'qpos' has 6 numbers, but the joints of the file need 7"),
        ("0.02 0.3", "0.02 0.3 0", "'qpos' has 8 numbers, but the joints of the file need 7"),
        ("128 0", "128", "'ctrl' has 4 numbers, but the actuators of the file need 5"),
    ],
)
def test_a_keyframe_with_a_wrong_count_of_numbers_is_refused_with_its_line(
    before: str, after: str, flaw: str, tmp_path: Path
) -> None:
    odd = ARM.replace(before, after)
    with pytest.raises(ModelError, match=rf"keyframe 'home' cannot be used: {flaw}; correct it") as refused:
        scene(tmp_path, odd, keyframe="home")
    assert refused.value.location is not None
    assert refused.value.location.line == 1 + odd[: odd.index('<key name="home"')].count("\n")
    assert scene(tmp_path, odd, keyframe=1).keyframe is not None, "others can be used"


FLYING = """<mujoco><worldbody>{floor}
  <body name="d"><freejoint name="root"/><geom size="0.1" mass="1"/></body></worldbody>
  <keyframe><key name="up" qpos="{qpos}"/></keyframe></mujoco>"""


def test_a_keyframe_places_the_base_above_the_floor_of_its_file_unless_the_scenario_does(tmp_path: Path) -> None:
    drone = FLYING.format(floor="", qpos="5 6 2 0.7071 0 0 0.7071")
    placed = scene(tmp_path, drone, keyframe="up").placement
    assert (placed.x, placed.y, placed.z, placed.yaw) == pytest.approx((0, 0, 2, np.pi / 2), abs=1e-4)
    placed = scene(tmp_path, drone, keyframe="up", pose={"z": 3, "yaw": 0.1}).placement
    assert (placed.z, placed.yaw) == (3, 0.1)
    floor = '<geom type="plane" size="1 1 1" pos="0 0 -1"/>'
    low = FLYING.format(floor=floor, qpos="0 0 -0.5 0 0 0 0")
    placed = scene(tmp_path, low, keyframe="up").placement
    assert (placed.z, placed.orientation_xyzw) == (0.5, (0, 0, 0, 1))
    placed = scene(tmp_path, low.replace("plane", "sphere"), keyframe="up").placement
    assert placed.z is None, "below the ground: it stands on the ground"


DOG = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
  <body name="d"><freejoint name="root"/><geom size="0.1" mass="1"/></body></worldbody>
  <keyframe><key name="home" qpos="0 0 {} 1 0 0 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize(
    ("height", "pose", "placed"),
    [(0.08, {}, 0.1), (0.3, {}, 0.3), (0.04, {}, 0.04), (0.08, {"z": 0.09}, 0.09), (0.096, {}, 0.1)],
)
def test_a_keyframe_that_is_a_little_inside_the_ground_is_raised(
    height: float, pose: dict[str, float], placed: float, tmp_path: Path
) -> None:
    dog = scene(tmp_path, DOG.format(height), keyframe="home", pose=pose)
    with running("mujoco", dog) as engine:
        at = engine.observe(0, contacts=False).pose
        sunk = [overlap.depth for overlap in engine.overlaps()]
    assert at.position_xyz[2] == pytest.approx(placed)
    assert sum(sunk) == pytest.approx(max(0, 0.1 - placed), abs=1e-6)
    note = raised_to_stand(dog, at)
    assert (note is not None) == (height == 0.08 and not pose)
    assert note is None or "keyframe 'home' puts the robot 0.02 m inside the ground" in note


def test_a_keyframe_that_is_far_inside_the_ground_is_named(tmp_path: Path) -> None:
    dog = scene(tmp_path, DOG.format(0.04), keyframe="home")
    with pytest.raises(BadStart, match=r"by keyframe 'home'; set robot\.pose\.z, or correct the keyframe"):
        refuse_bad_start(dog, Pose((0, 0, 0.04)), [Overlap("d", GROUND, 0.06)], [])


def test_a_bolted_robot_is_above_the_floor_of_its_file(tmp_path: Path) -> None:
    arm = """<mujoco><option timestep="0.01" integrator="RK4"/><worldbody>
      <geom type="plane" size="1 1 1" pos="0 0 -0.5"/><body name="d" pos="0 0 -0.2"><geom size="0.1"/></body>
      </worldbody></mujoco>"""
    bolted = scene(tmp_path, arm)
    assert bolted.placement.z == 0.5
    with running("mujoco", bolted) as engine:
        assert engine.link_pose("d").position_xyz == pytest.approx((0, 0, 0.3))


def test_adhesion_holds_as_in_mujoco_alone(tmp_path: Path) -> None:
    text = """<mujoco><option gravity="0 0 {gravity}"/><worldbody>{floor}<body name="b" pos="0 0 .1"><freejoint/>
      <geom type="sphere" size=".1" mass="1" adhesion="{adhesion}" gap=".01"/></body></worldbody></mujoco>"""
    for adhesion in (25, 15):
        plain = mujoco.MjModel.from_xml_string(
            text.format(gravity=20, adhesion=adhesion, floor='<geom type="plane" size="1 1 1"/>')
        )
        data = mujoco.MjData(plain)
        mujoco.mj_step(plain, data, 250)
        robot = scene(tmp_path, text.format(gravity=-9, adhesion=adhesion, floor=""), World(gravity=(0, 0, 20)))
        height = travelled("mujoco", robot, 120).base_position_xyz[-1, 2]
        assert (data.qpos[2] < 0.12) == (height < 0.12) == (adhesion == 25)


@pytest.mark.parametrize("option", ['integrator="RK4"', 'cone="pyramidal" solver="PGS"', 'iterations="3" impratio="2"'])
def test_the_options_of_the_solver_are_named(option: str, tmp_path: Path) -> None:
    text = f'<mujoco><option {option}/><worldbody><body><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    notes = [finding.message for finding in scene(tmp_path, text).model.findings]
    assert all(any(name.split("=")[0] in note for note in notes) for name in option.split())


SUCTION = "world: {disturbances: [{at: 0, link: suction, %s}]}\n"


@pytest.mark.parametrize(
    ("keyframe", "world", "passes"),
    [
        ("on", "", True),
        ("off", "", False),
        ("off", SUCTION % "adhesion: 25 N", True),
        ("off", SUCTION % "adhesion: 5 N", False),
        ("off", SUCTION % "adhesion: 31 N", "the actuator 'suction' holds with 30 N at most"),
        ("off", SUCTION % "payload: 1 kg", "give 'adhesion', or name its link"),
        ("off", "world: {disturbances: [{at: 0, link: suctoin, adhesion: 5 N}]}\n", "the robot has no link 'suctoin'"),
    ],
)
def test_an_adhesion_actuator_obeys_the_keyframe_and_disturbances(
    keyframe: str, world: str, passes: bool | str, tmp_path: Path
) -> None:
    """A suction of 30 N at a control of 1 holds 1 kg, which weighs 9.8 N, against 20 N upward, as 25 N do."""
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


CHAIN = """<mujoco model="arm">
  <compiler angle="radian"/>
  <option integrator="implicitfast" timestep="{step}" cone="elliptic" gravity="0 0 -{gravity}"/>
  <default><geom contype="0" conaffinity="0"/><joint axis="0 1 0" damping="0.1"/></default>
  <worldbody><body name="base" pos="0 0 1"><geom size="0.1"/>
    {bodies}</body></worldbody>
  <actuator>{before}{actuator}
    <position name="last" joint="last" kp="40" kv="3"/></actuator>{more}
</mujoco>"""
BODIES = "".join(
    f"""<body pos="0 {0.3 * place} 0"><joint name="{name}" {kind}/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03"/></body>"""
    for place, (name, kind) in enumerate(
        [("first", 'range="-2 2"'), ("arm", 'range="-2 2"'), ("ball", 'type="ball"'), ("last", 'range="-2 2"')], 1
    )
)
# They shift the place of the control: two controls, none, and three.
BEFORE = {
    "": 0,
    '<pid name="b" joint="first" kp="30" kv="2"/>': 2,
    '<dcmotor name="b" joint="first" motorconst="0.1" resistance="1" input="none"/>': 0,
    '<orientation name="b" joint="ball" kp="1" kv="0.1"/>': 3,
}
# actuator -> the command for 'arm', and the controls that it sets.
COMMANDED: dict[str, tuple[dict[str, float], dict[int, float]]] = {
    '<pid joint="arm" kp="1" kv="0.5" input="pos"/>': ({"position": 1.0}, {0: 1.0}),
    '<pid joint="arm" kp="30" kv="2" gear="3"/>': ({"position": 1.0, "velocity": 0.3}, {0: 3.0, 1: 0.9}),
    '<pid joint="arm" kp="30" ki="20" kv="2" imax="0.1" slewmax="2"/>': ({"position": 1.0}, {0: 1.0}),
    '<pid joint="arm" kp="0" kv="2" input="vel" gear="2"/>': ({"velocity": 0.7}, {0: 1.4}),
    '<pid joint="arm" kp="0" input="ff" gear="2"/>': ({"effort": 0.5}, {0: 0.25}),
    '<dcmotor joint="arm" motorconst="0.5" resistance="2" gear="4"/>': ({"velocity": 0.7}, {0: 0.7 * 4 * 0.5}),
    '<dcmotor joint="arm" motorconst="0.5" resistance="2" gear="-4" />': ({"effort": 1.0}, {0: -1.0 / 4 * 2 / 0.5}),
    '<dcmotor joint="arm" motorconst="0.5" resistance="2" input="pos" controller="9 1 1 3 0.1 24"/>': (
        {"position": 1.0},
        {0: 1.0},
    ),
    '<dcmotor joint="arm" motorconst="0.5" resistance="2" input="vel ff" controller="0 0 1"/>': (
        {"velocity": 1.0},
        {0: 1.0},
    ),
    '<intvelocity joint="arm" kp="30" kv="1" actrange="-2 2" gear="2"/>': ({"velocity": 0.7}, {0: 1.4}),
    '<position joint="arm" kp="30" kv="2" delay="0.25" nsample="100"/>': ({"position": 1.0}, {0: 1.0}),
}


def arm(actuator: str, before: str = "", more: str = "") -> str:
    return CHAIN.format(step=1 / RATE, gravity=GRAVITY, bodies=BODIES, actuator=actuator, before=before, more=more)


@pytest.mark.parametrize("before", BEFORE)
@pytest.mark.parametrize("actuator", COMMANDED)
def test_the_controller_of_the_model_moves_as_in_mujoco_alone(actuator: str, before: str, tmp_path: Path) -> None:
    wanted, controls = COMMANDED[actuator]
    robot = scene(tmp_path, arm(actuator, before))
    moved: dict[str, Any] = {reading: {"arm": value} for reading, value in wanted.items()}
    trace = travelled("mujoco", robot, 240, JointTargets(**moved))
    model = mujoco.MjModel.from_xml_string(arm(actuator, before))
    data = mujoco.MjData(model)
    for number, control in controls.items():
        data.ctrl[BEFORE[before] + number] = control
    angles = []
    for _ in range(240):
        mujoco.mj_step(model, data)
        angles.append([data.joint(name).qpos[0] for name in ("first", "arm", "last")])
    assert np.abs(positions(trace)[:, :3] - angles).max() < LIMIT_RAD
    assert abs(angles[-1][1]) > 0.02, "it moved"


@pytest.mark.parametrize("joint", ['stiffness="20" springyield="0.1"', 'damping="0.1 0.3 0.2"', 'stiffness="1 5 20"'])
def test_plastic_springs_and_polynomials_act_as_in_mujoco_alone(joint: str, tmp_path: Path) -> None:
    text = arm('<motor joint="arm"/>').replace('name="arm" range', f'name="arm" {joint} range')
    assert text != arm('<motor joint="arm"/>')
    angles = positions(travelled("mujoco", scene(tmp_path, text), 480, JointTargets(effort={"arm": 4.0})))[:, 1]
    for alone, limit in ((text, (0.0, LIMIT_RAD)), (arm('<motor joint="arm"/>'), (0.01, np.inf))):
        data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(alone))
        data.ctrl[0] = 4.0
        expected = [mujoco.mj_step(model, data) or data.joint("arm").qpos[0] for _ in range(480)]
        assert limit[0] <= np.abs(angles - expected).max() < limit[1]


@pytest.mark.parametrize(
    ("actuator", "reading", "message"),
    [
        (
            '<dcmotor name="m" joint="arm" motorconst="1" resistance="1"/>',
            "position",
            "DC motor 'm' drives it.*velocity or effort",
        ),
        ('<pid name="m" joint="arm" input="vel"/>', "position", "velocity servo 'm' drives it, .* follow a position"),
        ('<pid name="m" joint="arm" input="ff"/>', "velocity", "motor 'm' drives it, .* command its effort"),
        ('<intvelocity name="m" joint="arm" kp="3" actrange="-1 1"/>', "position", "command its velocity"),
        ('<muscle name="m" joint="arm" lengthrange="0 1"/>', "position", "no command can set, because it is a muscle"),
        ('<general name="m" joint="arm" dyntype="integrator"/>', "effort", "acts on the integral"),
    ],
)
def test_an_ideal_servo_does_not_act_in_place_of_a_controller(
    actuator: str, reading: Any, message: str, tmp_path: Path
) -> None:
    model = scene(tmp_path, arm(actuator)).model
    with pytest.raises(AssertionError, match=message):
        assert model.why_not_driven("arm", reading) is None, model.why_not_driven("arm", reading)
    assert model.why_not_driven("last", reading) is None


def test_a_keyframe_gives_each_actuator_its_controls(tmp_path: Path) -> None:
    key = '<keyframe><key name="home" qpos="0 0 1 0 0 0 0" ctrl="0.1 0.2 0.3 0.4"/></keyframe>'
    text = arm('<pid name="m" joint="arm" input="pos ff"/>', '<dcmotor name="b" joint="first" nominal="9 1 9"/>', key)
    home = scene(tmp_path, text, keyframe="home")
    assert home.controls == {"b": (0.1,), "m": (0.2, 0.3), "last": (0.4,)}
    trace = travelled("mujoco", home, 240)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 240)
    assert positions(trace)[-1, :3] == pytest.approx(data.qpos[[0, 1, 6]], abs=LIMIT_RAD)
    with pytest.raises(ModelError, match="'ctrl' has 3 numbers, but the actuators of the file need 4"):
        scene(tmp_path, text.replace("0.3 0.4", "0.3"), keyframe="home")
