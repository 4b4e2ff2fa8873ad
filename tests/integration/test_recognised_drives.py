"""Robots whose drive is recognised drive 2 m and turn by 90 deg in both engines: mesh wheels, and swivel casters."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.core.geometry import Vector3
from tests.integration.engines import on_every_engine
from tests.mesh_files import fans, obj
from tests.mesh_files import wheel as mesh_wheel
from tests.physics.robots import ORIGIN, box_shape, collision, cylinder_shape, inertial, joint, link, sphere_shape
from tests.simulated import simulated

RADIUS: Final = 0.1
WIDTH: Final = 0.04
SPEED: Final = 0.5
TURN: Final = math.pi / 6


def part(name: str, mass: float, size: float, shape: str, at: Vector3 = ORIGIN, *, friction: float = 1.0) -> str:
    rpy = (math.pi / 2, 0.0, 0.0) if "cylinder" in shape else ORIGIN
    return link(name, inertial(mass, (mass * size * size / 6,) * 3, at) + collision(shape, at, rpy), friction)


def driven_wheels(shape: str) -> str:
    sides = (("left", 0.2), ("right", -0.2))
    return "".join(
        part(f"{side}_wheel", 0.5, RADIUS, shape)
        + joint(f"{side}_wheel_joint", "continuous", "base", f"{side}_wheel", (0.0, y, 0.0))
        for side, y in sides
    )


def mesh_robot() -> str:
    tail = part("tail", 0.1, 0.05, sphere_shape(0.05), friction=0.0)
    hangs = joint("tail_joint", "fixed", "base", "tail", (-0.25, 0.0, -0.05))
    return driven_wheels('<mesh filename="wheel.obj"/>') + tail + hangs


def swivel_robot() -> str:
    """Two driven wheels, and a wheel that trails behind an upright axis by 3 cm."""
    fork = part("fork", 0.2, 0.05, box_shape((0.02, 0.02, 0.02)), (0.0, 0.0, 0.03))
    caster = part("caster", 0.1, 0.04, cylinder_shape(0.04, 0.02))
    swivel = joint("swivel", "continuous", "base", "fork", (-0.25, 0.0, -0.06), axis=(0.0, 0.0, 1.0))
    rolls = joint("caster_joint", "continuous", "fork", "caster", (-0.03, 0.0, 0.0))
    return driven_wheels(cylinder_shape(RADIUS, WIDTH)) + fork + caster + swivel + rolls


@pytest.mark.parametrize("parts", [mesh_robot(), swivel_robot()], ids=["mesh wheels", "swivel caster"])
@on_every_engine
def test_it_drives_2_m_and_turns_by_90_deg(parts: str, engine: str, tmp_path: Path) -> None:
    base = part("base", 4.0, 0.3, box_shape((0.4, 0.3, 0.1)), (-0.05, 0.0, 0.1))
    (tmp_path / "robot.urdf").write_text(f'<robot name="cart">{base}{parts}</robot>')
    points, faces = mesh_wheel(RADIUS, WIDTH)
    (tmp_path / "wheel.obj").write_bytes(obj([(x, -z, y) for x, y, z in points], fans(faces)))
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
    trace = simulated(tmp_path, scenario).trace
    stopped = trace.base_position_xyz[round(4.9 * 240)] - trace.base_position_xyz[0]
    assert stopped[0] == pytest.approx(SPEED * 4.0, rel=0.01)
    assert abs(stopped[1]) < 0.01
    yaw = np.unwrap(trace.yaw)
    assert math.degrees(yaw[-1] - yaw[0]) == pytest.approx(90, abs=2)
