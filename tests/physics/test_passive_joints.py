"""Ball joints against the formulas of pendulums, on both engines, which must agree with each other, too.

The pendulum hangs from a ball joint with a tilted frame: its angles start at 0, and it is released there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core import geometry
from sim_action.core.lazy_numpy import FloatArray
from tests.physics.case import Run, Setup, run_on
from tests.physics.measures import joint_angle, passages
from tests.physics.oracles import GRAVITY, Vector, pendulum_period, runge_kutta
from tests.physics.robots import ball_inertia, inertial, link, robot

ENGINES = ("pybullet", "mujoco")
MASS, LENGTH, RADIUS = 1.0, 0.8, 0.1
TILT = math.radians(40)
MOMENT = MASS * LENGTH**2 + ball_inertia(MASS, RADIUS)[0]
EQUAL_LENGTH = MOMENT / (MASS * LENGTH)  # the length in m of the mathematical pendulum with the same motion


def pendulum(kind: str = "spherical", more: str = "") -> str:
    tilted = f'<origin rpy="{TILT!r} 0 0"/>'
    joint = f'<joint name="b" type="{kind}">{tilted}<parent link="base"/><child link="bob"/>{more}</joint>'
    bob = inertial(MASS, ball_inertia(MASS, RADIUS), (0.0, 0.0, -LENGTH))
    return robot(link("base", inertial(1.0, (1.0, 1.0, 1.0))), link("bob", bob), joint)


def swinging(
    engine: str, seconds: float = 4.0, model: str = "", joints: Mapping[str, float] | None = None, **keys: Any
) -> Run:
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    place = {"base": "fixed", "pose": {"z": 3.0}, "joints": joints or {}}
    setup = Setup(model or pendulum(), seconds, {"allow": ["fixed-base"], **keys}, place, settle=0.0)
    return run_on(engine, setup)


def directions(run: Run) -> FloatArray:
    """The direction (T, 3) from the joint to the bob at all moments."""
    start = geometry.quaternion_from_rpy(TILT, 0.0, 0.0)
    columns = [joint_angle(run, f"b_{axis}").tolist() for axis in "xyz"]
    found = []
    for angles in zip(*columns, strict=True):
        turned = (0.0, 0.0, -1.0)
        for axis, angle in reversed(list(enumerate(angles))):
            part = [0.0, 0.0, 0.0]
            part[axis] = math.sin(angle / 2)
            turned = geometry.rotate((part[0], part[1], part[2], math.cos(angle / 2)), turned)
        found.append(geometry.rotate(start, turned))
    return np.array(found)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pendulum_on_a_ball_joint_swings_in_a_plane_with_its_period(engine: str) -> None:
    run = swinging(engine)
    way = directions(run)
    crossed = passages(run.trace.time, way[:, 1])
    period = float(np.diff(crossed).mean())
    assert period == pytest.approx(pendulum_period(EQUAL_LENGTH, TILT), rel=1e-3)
    # It is released in the plane of y and z.
    assert np.abs(way[:, 0]).max() < 1e-6
    assert way[:, 1].max() == pytest.approx(math.sin(TILT), rel=1e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_conical_pendulum_keeps_its_height_and_its_period(engine: str) -> None:
    # A blow across, which gives the bob the speed of its circle.
    brief = 1 / 240
    rate = math.sqrt(GRAVITY / (EQUAL_LENGTH * math.cos(TILT)))
    # The force acts at the distance LENGTH from the joint.
    force = MOMENT * math.sin(TILT) * rate / (LENGTH * brief)
    blow = {"at": 0, "for": brief, "link": "bob", "force": [force, 0, 0]}
    run = swinging(engine, world={"disturbances": [blow]})
    way = directions(run)
    tilt = np.degrees(np.arccos(-way[:, 2]))
    assert np.abs(tilt - math.degrees(TILT)).max() < 0.6
    crossed = passages(run.trace.time, way[:, 0])
    assert float(np.diff(crossed).mean()) == pytest.approx(2 * math.pi / rate, rel=3e-3)


def test_both_engines_swing_a_ball_joint_in_the_same_way() -> None:
    blow = {"at": 0.5, "for": 0.1, "link": "bob", "force": [3, 2, 0], "point": [0.05, 0.02, -0.9]}
    start = {"b_x": 0.3, "b_y": -0.4, "b_z": 0.5}
    keys: dict[str, Any] = {"joints": start, "world": {"disturbances": [blow]}}
    first, second = (swinging(engine, 1.5, **keys).trace for engine in ENGINES)
    assert first.joint_position[0].tolist() == pytest.approx(list(start.values()))
    assert np.abs(first.joint_position - second.joint_position).max() < 1e-9
    assert np.abs(first.joint_velocity - second.joint_velocity).max() < 1e-9
    assert np.abs(first.joint_effort).max() == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_the_damping_of_a_ball_joint_brakes_the_pendulum(engine: str) -> None:
    damping = 0.5

    def rate(_: float, state: Vector) -> Vector:
        angle, speed = state.tolist()
        return np.array([speed, -GRAVITY / EQUAL_LENGTH * math.sin(angle) - damping / MOMENT * speed])

    run = swinging(engine, model=pendulum(more=f'<dynamics damping="{damping}"/>'))
    swung = runge_kutta(rate, (TILT, 0.0), 4.0, 960)[::240, 0]
    assert directions(run)[::240, 1].tolist() == pytest.approx(np.sin(swung).tolist(), abs=0.01)


def _part(name: str, place: str, mass: float, moments: tuple[float, float, float], shape: str) -> str:
    inertia = "".join(f"<{tag}>{moment}</{tag}>" for tag, moment in zip(("ixx", "iyy", "izz"), moments, strict=True))
    return (
        f"<link name='{name}'><pose>{place}</pose><inertial><mass>{mass}</mass><inertia>{inertia}</inertia></inertial>"
        f"<collision name='c'><geometry>{shape}</geometry></collision></link>"
    )


_WHEEL = "<cylinder><radius>0.033</radius><length>0.018</length></cylinder>"
_ROVER = "".join(
    (
        _part("body", "-0.03 0 0.08 0 0 0", 0.9, (0.004, 0.004, 0.006), "<box><size>0.14 0.14 0.08</size></box>"),
        *(
            _part(f"{side}_wheel", f"0 {y} 0.033 -1.5707963 0 0", 0.1, (5e-5, 5e-5, 1e-4), _WHEEL)
            + f"<joint name='{side}' type='revolute'><parent>body</parent><child>{side}_wheel</child>"
            "<axis><xyz>0 0 1</xyz></axis></joint>"
            for side, y in (("left", 0.08), ("right", -0.08))
        ),
        _part(
            "caster", "-0.081 0 0.005 -1.57 0 0", 0.005, (1e-5, 1e-5, 1e-5), "<sphere><radius>0.005</radius></sphere>"
        ),
        "<joint name='caster_joint' type='ball'><parent>body</parent><child>caster</child></joint>",
    )
)
ROVER = f"<sdf version='1.8'><model name='ball_caster'>{_ROVER}</model></sdf>"
"""A small robot on two wheels and a rolling ball; the ball is as small, and its inertia as large, as in public ones."""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_on_a_ball_caster_drives_straight(engine: str, tmp_path: Path) -> None:
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    (tmp_path / "rover.sdf").write_text(ROVER)
    commands = {"commands": {"rate": 10, "twist": [{"linear": 0.25, "for": 8}, {"linear": 0}]}}
    run = run_on(engine, Setup(str(tmp_path / "rover.sdf"), 10.0, commands))
    x, y = run.trace.base_position_xyz[-1, :2] - run.trace.base_position_xyz[0, :2]
    assert x == pytest.approx(2.0, rel=0.02)
    assert abs(y) < 0.01
    # The caster rolls.
    roll = run.trace.joint_velocity[run.row(4), run.trace.joint_names.index("caster_joint_x") :]
    assert float(np.linalg.norm(roll)) == pytest.approx(0.25 / 0.005, rel=0.05)


STIFFNESS, SPRUNG_KG, REST = 80.0, 2.0, 0.15


def sprung(kind: str, more: str = "") -> str:
    """A carriage of 2 kg on a level rail with a spring, or a wheel of 2 kg m^2 with a torsion spring."""
    limit = '<limit lower="-1" upper="1" effort="100" velocity="50"/>'
    spring = f'<dynamics spring_stiffness="{STIFFNESS}" spring_reference="{REST}" {more}/>'
    ends = '<parent link="base"/><child link="bob"/><axis xyz="0 0 1"/><origin rpy="0 1.5707963267948966 0"/>'
    if kind == "revolute":
        ends = ends.replace("1.5707963267948966", "0")
    joint = f'<joint name="s" type="{kind}">{ends}{limit}{spring}</joint>'
    bob = inertial(SPRUNG_KG, (SPRUNG_KG, SPRUNG_KG, SPRUNG_KG))
    return robot(link("base", inertial(1.0, (1.0, 1.0, 1.0))), link("bob", bob), joint)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_mass_on_a_spring_swings_with_its_period_and_keeps_its_energy(engine: str, kind: str) -> None:
    run = swinging(engine, 5.0, sprung(kind))
    away = run.trace.joint_position[:, 0] - REST
    period = 2 * math.pi * math.sqrt(SPRUNG_KG / STIFFNESS)
    assert float(np.diff(passages(run.trace.time, away)).mean()) == pytest.approx(period, rel=1e-3)
    assert away[-300:].max() == pytest.approx(REST, rel=0.01)
    assert np.abs(run.trace.joint_effort).max() == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_damped_spring_comes_to_rest_at_its_reference(engine: str) -> None:
    run = swinging(engine, 3.0, sprung("prismatic", 'damping="25"'))
    assert run.trace.joint_position[-1, 0] == pytest.approx(REST, abs=1e-4)


_PUCK = inertial(2.0, (0.02, 0.02, 0.03))


def _base_and(kind: str, body: str, more: str = "") -> str:
    tilted = f'<origin rpy="0 {TILT!r} 0"/>'
    joint = f'<joint name="p" type="{kind}">{tilted}<parent link="base"/><child link="bob"/>{more}</joint>'
    return robot(link("base", inertial(1.0, (1.0, 1.0, 1.0))), link("bob", body), joint)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_puck_on_a_planar_joint_slides_down_a_slope_and_turns(engine: str) -> None:
    # A push along y at the centre, and a torque about the normal.
    torque = [0.003 * math.sin(TILT), 0, 0.003 * math.cos(TILT)]
    push = {"at": 0, "for": 1, "link": "bob", "force": [0, 1, 0], "torque": torque}
    model = _base_and("planar", _PUCK, '<axis xyz="0 0 1"/>')
    run = swinging(engine, 1.0, model, world={"disturbances": [push]})
    assert run.trace.joint_names == ("p_x", "p_y", "p_turn")
    # Each integrator is off by half a step.
    assert joint_angle(run, "p_x")[-1] == pytest.approx(GRAVITY * math.sin(TILT) / 2, rel=0.005)
    assert joint_angle(run, "p_y")[-1] == pytest.approx(0.5 / 2, rel=0.005)
    assert joint_angle(run, "p_turn")[-1] == pytest.approx(0.1 / 2, rel=0.005)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_damping_of_a_planar_joint_limits_the_speed(engine: str) -> None:
    # The damping takes 5 times the speed of 2 kg each second; 20,000 times would explode.
    for damping, seconds in ((10.0, 1.5), (40_000.0, 0.5)):
        more = f'<axis xyz="0 0 1"/><dynamics damping="{damping}"/>'
        run = swinging(engine, seconds, _base_and("planar", _PUCK, more))
        speed = run.trace.joint_velocity[-1, run.trace.joint_names.index("p_x")]
        most = 2 * GRAVITY * math.sin(TILT) / damping
        if damping < 240:
            assert speed == pytest.approx(most * (1 - math.exp(-damping / 2 * seconds)), rel=0.02)
        else:
            assert abs(speed) < 0.15


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_pendulum_on_a_universal_joint_has_the_periods_of_both_axes(engine: str, axis: int) -> None:
    body = inertial(MASS, (0.06, 0.02, 0.05), (0.0, 0.0, -LENGTH))
    more = '<origin rpy="0 0 0.4"/><axis xyz="1 0 0"/><axis2 xyz="0 1 0"/>'
    hung = f'<joint name="p" type="universal">{more}<parent link="base"/><child link="bob"/></joint>'
    model = robot(link("base", inertial(1.0, (1.0, 1.0, 1.0))), link("bob", body), hung)
    run = swinging(engine, 4.0, model, {f"p_{axis + 1}": TILT})
    moment = MASS * LENGTH**2 + (0.06, 0.02)[axis]
    swung = joint_angle(run, f"p_{axis + 1}")
    period = float(np.diff(passages(run.trace.time, swung)).mean())
    assert period == pytest.approx(pendulum_period(moment / (MASS * LENGTH), TILT), rel=1e-3)
    assert np.abs(joint_angle(run, f"p_{2 - axis}")).max() < 1e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_a_body_on_a_floating_joint_falls_and_turns_as_a_free_one(engine: str) -> None:
    body = inertial(2.0, (0.03, 0.03, 0.03), (0.1, 0.0, 0.0))
    push = {"at": 0, "for": 0.5, "link": "bob", "torque": [0, 0, 0.03]}
    run = swinging(
        engine, 0.5, _base_and("floating", body).replace("rpy=", "xyz='0 0 1' rpy="), world={"disturbances": [push]}
    )
    down = [joint_angle(run, f"p_slide_{axis}")[-1] for axis in "xyz"]
    # Its origin is 0.1 m from its centre of mass, and turns by 0.125 rad about the upright axis.
    fallen = GRAVITY * 0.5**2 / 2
    at = geometry.rotate(geometry.quaternion_from_rpy(0.0, TILT, 0.0), (down[0], down[1], down[2]))
    assert at[2] == pytest.approx(-fallen, rel=0.01)
    assert math.hypot(at[0], at[1]) < 0.02
    speed = run.trace.joint_velocity[-1, [run.trace.joint_names.index(f"p_{axis}") for axis in "xyz"]]
    assert float(np.linalg.norm(speed)) == pytest.approx(0.5, rel=0.05)


def test_both_engines_move_joints_in_series_in_the_same_way() -> None:
    blow = {"at": 0.2, "for": 0.1, "link": "bob", "force": [3, 2, 1], "point": [0.05, 0.02, -0.2]}
    body = inertial(2.0, (0.02, 0.02, 0.03), (0.1, 0.0, 0.0))
    for kind in ("planar", "floating", "universal"):
        model = _base_and(kind, body, '<axis xyz="0.3 0 1"/><axis2 xyz="0 1 0.2"/><dynamics damping="0.1"/>')
        first, second = (swinging(engine, 1.0, model, world={"disturbances": [blow]}).trace for engine in ENGINES)
        assert first.joint_names == second.joint_names
        assert np.abs(first.joint_position - second.joint_position).max() < 0.01, kind
