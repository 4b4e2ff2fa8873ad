"""Controllers of MJCF models that have several controls or none, commanded as in MuJoCo alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.errors import ModelError
from sim_action.state.command import JointTargets
from sim_action.world import GRAVITY
from tests.integration.engines import travelled
from tests.integration.test_native_motors import LIMIT_RAD, RATE, positions
from tests.integration.test_native_robots import scene

mujoco: Any = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")

ARM = """<mujoco model="arm">
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
    return ARM.format(step=1 / RATE, gravity=GRAVITY, bodies=BODIES, actuator=actuator, before=before, more=more)


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
