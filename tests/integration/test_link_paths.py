"""Links of real arms follow straight lines in the real engines; an arm carries a box to another place.

The wanted line is computed from its ends alone, and the link's place from the recorded joints. `test_link_poses.py`
compares such places with those of the engines. Between two ticks a joint has one speed, so the link leaves its line by
some hundredths of a millimetre.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Quaternion, Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.permissions import Permissions
from sim_action.robot.model.kinematics import LinkMotion, link_motion
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.physics.robots import collision, inertial, joint, link, robot
from tests.simulated import simulated
from tools.bench.robots import ROBOTS

EXAMPLE: Final = Path(__file__).parents[2] / "examples/ur5e_gripper/pick_and_place.sim.yml"
OFF_LINE_M: Final = 2e-4
END_M: Final = 1e-4
END_RAD: Final = math.radians(0.01)


def run(folder: Path, engine: str, link: str, **keys: Any) -> tuple[SimulationRun, LinkMotion]:
    speed = [{"max_speed": {"link": link, "linear": 5}}]
    scenario = {"name": "lines", "backend": engine, "expect": speed, "trace": {"rate": 240}, **keys}
    done = simulated(folder, scenario, outside=True)
    scene = build_scene(load_scenario(folder / "s.sim.yml", Permissions(outside=True)))
    return done, link_motion(scene.model, done.trace, link)


def off_line(points: FloatArray, start: FloatArray, end: Vector3) -> float:
    """The largest distance of points (T, 3) from the line between two others, in m."""
    along = (np.array(end) - start) / math.dist(start, end)
    away = points - start
    return float(np.linalg.norm(away - np.outer(away @ along, along), axis=1).max())


def angle_between(one: FloatArray, other: Quaternion) -> float:
    return 2 * math.acos(min(1.0, abs(float(one @ np.array(other)))))


@on_every_engine
def test_a_tool_follows_a_line_and_turns(engine: str, tmp_path: Path) -> None:
    start = {
        "shoulder_lift_joint": "-87.94 deg",
        "elbow_joint": "98.91 deg",
        "wrist_1_joint": "-100.97 deg",
        "wrist_2_joint": "-90 deg",
    }
    goal = {"x": 0.4, "y": -0.1, "z": 0.25, "roll": math.pi, "pitch": 0.2, "yaw": -1.0}
    _, motion = run(
        tmp_path,
        engine,
        "tool0",
        robot={"model": "ur5e_gripper", "joints": start},
        commands={"pose": {"link": "tool0", "waypoints": [{**goal, "at": 0.8}]}},
        time_limit=1,
    )
    assert off_line(motion.position_xyz, motion.position_xyz[0], (0.4, -0.1, 0.25)) < OFF_LINE_M
    assert math.dist(motion.position_xyz[-1], (0.4, -0.1, 0.25)) < END_M
    turned = geometry.quaternion_from_rpy(math.pi, 0.2, -1.0)
    assert angle_between(motion.orientation_xyzw[-1], turned) < END_RAD


@pytest.mark.pybullet
@on_every_engine
def test_a_redundant_arm_that_stands_on_the_ground(engine: str, tmp_path: Path) -> None:
    """Only the run shows the height of its base."""
    kuka = next(known for known in ROBOTS if known.name == "kuka_iiwa")
    start = {"lbr_iiwa_joint_2": 0.6, "lbr_iiwa_joint_4": -1.4, "lbr_iiwa_joint_6": 1.1}
    link = "lbr_iiwa_link_7"
    _, motion = run(
        tmp_path,
        engine,
        link,
        robot={"model": kuka.path, **kuka.keys, "joints": start},
        commands={"pose": {"link": link, "waypoints": [{"x": 0.55, "y": 0.2, "z": 0.5, "at": 0.8}]}},
        time_limit=1,
    )
    assert off_line(motion.position_xyz, motion.position_xyz[0], (0.55, 0.2, 0.5)) < OFF_LINE_M
    assert math.dist(motion.position_xyz[-1], (0.55, 0.2, 0.5)) < END_M
    x, y, z, w = motion.orientation_xyzw[0].tolist()
    assert angle_between(motion.orientation_xyzw[-1], (x, y, z, w)) < END_RAD


LIMIT: Final = 'lower="-3" upper="3" effort="50" velocity="2"'
LIGHT: Final = inertial(0.05, (0.05, 0.05, 0.05))
UP: Final = (0.0, 0.0, 1.0)
MOBILE: Final = robot(
    link("base", inertial(50.0, (5.0, 5.0, 5.0)) + collision('<box size="0.8 0.8 0.4"/>')),
    *(link(name, LIGHT) for name in ("upper", "fore", "tip")),
    joint("shoulder", "revolute", "base", "upper", (0.0, 0.0, 0.3), axis=UP, limit=LIMIT),
    joint("elbow", "revolute", "upper", "fore", (0.5, 0.0, 0.0), axis=UP, limit=LIMIT),
    joint("tip_joint", "fixed", "fore", "tip", (0.3, 0.0, 0.0)),
)


@on_every_engine
def test_a_base_that_slides_away_does_not_take_the_tip_with_it(engine: str, tmp_path: Path) -> None:
    (tmp_path / "mobile.urdf").write_text(MOBILE)
    done, motion = run(
        tmp_path,
        engine,
        "tip",
        robot={"model": "mobile.urdf", "joints": {"elbow": 1.2, "shoulder": -0.5}},
        world={"disturbances": [{"at": 0.6, "for": 0.3, "force": [300, 0, 0]}]},
        commands={
            "pose": {"link": "tip", "orientation": "free", "waypoints": [{"x": 0.6, "y": 0.2, "at": 0.5}]},
            "rate": 240,
        },
        time_limit=1.5,
    )
    moved = done.trace.base_position_xyz[-1] - done.trace.base_position_xyz[0]
    assert moved[0] > 0.02
    assert math.dist(motion.position_xyz[-1][:2], (0.6, 0.2)) < 1e-3
    # While the base is pushed, each target is based on the step before it.
    away = np.hypot(motion.position_xyz[120:, 0] - 0.6, motion.position_xyz[120:, 1] - 0.2)
    assert float(away.max()) < 5e-3


@on_every_engine
def test_a_gripper_that_stays_open_carries_nothing(engine: str, tmp_path: Path) -> None:
    """`test_examples.py` runs the example as it is."""
    text = EXAMPLE.read_text(encoding="utf-8")
    opened = text.replace("effort: {left_finger_joint: 60 N}", "effort: {left_finger_joint: -5 N}")
    assert opened != text
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    done = simulated(tmp_path, f"backend: {engine}\n{opened}")
    assert next(verdict.status for verdict in done.verdicts) == "failed"
