"""Robots whose drive is recognised drive 2 m and turn by 90 deg in both engines: mesh wheels, and swivel casters."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import simulate
from tests.integration.engines import on_every_engine
from tests.mesh_files import Face, Point, obj

RADIUS: Final = 0.1
HALF_WIDTH: Final = 0.02
SPEED: Final = 0.5
TURN: Final = math.pi / 6


def prism(corners: int) -> bytes:
    """A wheel about y."""
    angles = [2 * math.pi * number / corners for number in range(corners)]
    points: list[Point] = [
        (RADIUS * math.cos(angle), side, RADIUS * math.sin(angle))
        for side in (-HALF_WIDTH, HALF_WIDTH)
        for angle in angles
    ]
    following = [(number, (number + 1) % corners) for number in range(corners)]
    rims: list[Face] = [(one, two, two + corners) for one, two in following]
    rims += [(one, two + corners, one + corners) for one, two in following]
    ends: list[Face] = [
        (start, start + one, start + one + 1) for start in (0, corners) for one in range(1, corners - 1)
    ]
    return obj(points, rims + ends)


def link(name: str, mass: float, size: float, shape: str, *, place: str = "0 0 0", friction: float = 1.0) -> str:
    moment = mass * size * size / 6
    collision = f'<collision><origin xyz="{place}" rpy="{{}}"/><geometry>{shape}</geometry></collision>'
    rpy = f"{math.pi / 2} 0 0" if "cylinder" in shape else "0 0 0"
    return (
        f'<link name="{name}"><inertial><origin xyz="{place}"/><mass value="{mass}"/><inertia ixx="{moment}" ixy="0" '
        f'ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/></inertial>{collision.format(rpy)}'
        f'<contact><lateral_friction value="{friction}"/></contact></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, place: str, *, axis: str = "0 1 0") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}"/><axis xyz="{axis}"/></joint>'
    )


def driven_wheels(shape: str) -> Iterator[str]:
    for side, y in (("left", 0.2), ("right", -0.2)):
        yield link(f"{side}_wheel", 0.5, RADIUS, shape)
        yield joint(f"{side}_wheel_joint", "continuous", "base", f"{side}_wheel", f"0 {y} 0")


def mesh_robot() -> str:
    tail = link("tail", 0.1, 0.05, '<sphere radius="0.05"/>', friction=0.0)
    hangs = joint("tail_joint", "fixed", "base", "tail", "-0.25 0 -0.05")
    return "".join((*driven_wheels('<mesh filename="wheel.obj"/>'), tail, hangs))


def swivel_robot() -> str:
    """Two driven wheels, and a wheel that trails behind an upright axis by 3 cm."""
    wheels = driven_wheels(f'<cylinder radius="{RADIUS}" length="{2 * HALF_WIDTH}"/>')
    fork = link("fork", 0.2, 0.05, '<box size="0.02 0.02 0.02"/>', place="0 0 0.03")
    caster = link("caster", 0.1, 0.04, '<cylinder radius="0.04" length="0.02"/>')
    swivel = joint("swivel", "continuous", "base", "fork", "-0.25 0 -0.06", axis="0 0 1")
    rolls = joint("caster_joint", "continuous", "fork", "caster", "-0.03 0 0")
    return "".join((*wheels, fork, caster, swivel, rolls))


@pytest.mark.parametrize(
    ("parts", "corners"), [(mesh_robot(), 64), (swivel_robot(), 0)], ids=["mesh wheels", "swivel caster"]
)
@on_every_engine
def test_it_drives_2_m_and_turns_by_90_deg(parts: str, corners: int, engine: str, tmp_path: Path) -> None:
    pytest.importorskip(engine)
    base = link("base", 4.0, 0.3, '<box size="0.4 0.3 0.1"/>', place="-0.05 0 0.1")
    (tmp_path / "robot.urdf").write_text(f'<robot name="cart">{base}{parts}</robot>')
    if corners:
        (tmp_path / "wheel.obj").write_bytes(prism(corners))
    twist = [{"linear": SPEED, "for": 4.0}, {"linear": 0.0, "for": 1.0}, {"angular": TURN, "for": 3.0}]
    scenario = {
        "name": "drives",
        "robot": {"model": "robot.urdf"},
        "commands": {"rate": "10 Hz", "twist": [*twist, {"angular": 0.0}]},
        "expect": ["upright"],
        "time_limit": 9.0,
        "trace": {"rate": 240},
        "backend": engine,
    }
    (tmp_path / "a.sim.yml").write_text(json.dumps(scenario))
    loaded = load_scenario(tmp_path / "a.sim.yml")
    trace = simulate(loaded.scenario, build_scene(loaded), lambda _: None).trace
    stopped = trace.base_position_xyz[round(4.9 * 240)] - trace.base_position_xyz[0]
    assert stopped[0] == pytest.approx(SPEED * 4.0, rel=0.01)
    assert abs(stopped[1]) < 0.01
    yaw = np.unwrap(trace.yaw)
    assert math.degrees(yaw[-1] - yaw[0]) == pytest.approx(90, abs=2)
