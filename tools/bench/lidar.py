"""Measure the cost of a lidar with 360 rays at 10 Hz: against hand-written loops with the same rays, and unread."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from sim_action.engines import ENGINES
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from sim_action.state.command import JointTargets

STEPS: Final = 4800
SCAN_PERIOD: Final = 24
RANGE: Final = 3.5
ROUNDS: Final = 12

SCENARIO: Final = """\
name: burger drives on in a room
robot: {{model: turtlebot3_burger, pose: {{x: -1}}}}
world:
  objects:
    - {{name: south, box: [4, 0.1, 0.5], pose: {{y: -2}}}}
    - {{name: north, box: [4, 0.1, 0.5], pose: {{y: 2}}}}
    - {{name: west, box: [0.1, 4, 0.5], pose: {{x: -2}}}}
    - {{name: east, box: [0.1, 4, 0.5], pose: {{x: 2}}}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.066}}]}}
sensors: {sensors}
expect: [{{travel: {{at_least: 1 m}}}}]
duration: 20 s
time_limit: 20 s
backend: {engine}
"""
LIDAR: Final = "[{{lidar: {{rays: 360, range: 3.5 m}}, link: base_scan, rate: 10 Hz, trace: {heard}}}]"
WHEELS: Final = JointTargets(velocity={"wheel_left_joint": 2.0, "wheel_right_joint": 2.0})

_ANGLES: Final = np.linspace(-np.pi, np.pi, 360, endpoint=False)
_DIRECTIONS: Final = RANGE * np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(360)))


class LidarCost(NamedTuple):
    """Seconds of loops, without loading and settling: three of ours, two by hand."""

    heard: float
    unheard: float
    none: float
    by_hand: float
    by_hand_without: float


def lidar_cost(engine: str) -> LidarCost:
    """The least of several rounds in which they take turns."""
    ours = [
        _with_sensors(engine, sensors) for sensors in (LIDAR.format(heard="true"), LIDAR.format(heard="false"), "[]")
    ]
    loops = [*ours, _by_hand(engine, SCAN_PERIOD), _by_hand(engine, STEPS + 1)]
    rounds = [[loop() for loop in loops] for _ in range(ROUNDS)]
    return LidarCost(*map(min, zip(*rounds, strict=True)))


def _with_sensors(engine: str, sensors: str) -> Callable[[], float]:
    loaded = _load(engine, sensors)
    return lambda: simulate(loaded.scenario, build_scene(loaded), lambda _: None).wall_time


def _by_hand(engine: str, scan_period: int) -> Callable[[], float]:
    """The engine's steps, the state of each, and scans."""
    scene, loop = build_scene(_load(engine, "[]")), {"pybullet": _pybullet, "mujoco": _mujoco}[engine]

    def call() -> float:
        backend = ENGINES[engine].load()(scene)
        backend.advance(0, [WHEELS])
        started = time.perf_counter()
        loop(backend, scan_period)
        took = time.perf_counter() - started
        backend.close()
        return took

    return call


def _load(engine: str, sensors: str) -> LoadedScenario:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "room.sim.yml")
        path.write_text(SCENARIO.format(engine=engine, sensors=sensors))
        return load_scenario(path)


def _pybullet(backend: Any, scan_period: int) -> object:
    import pybullet

    client = backend._client  # noqa: SLF001 - as a user would have it at hand
    robot = pybullet.getBodyUniqueId(pybullet.getNumBodies(client) - 1, client)
    infos = [pybullet.getJointInfo(robot, index, client) for index in range(pybullet.getNumJoints(robot, client))]
    wheels = [info[0] for info in infos if info[3] >= 0]
    (lidar,) = (info[0] for info in infos if info[12] == b"base_scan")
    rows, scans = [], []
    for step in range(1, STEPS + 1):
        if step % scan_period == 0:
            place, turned = pybullet.getLinkState(robot, lidar, computeForwardKinematics=1, physicsClientId=client)[4:6]
            matrix = np.reshape(pybullet.getMatrixFromQuaternion(turned), (3, 3))
            ends = (_DIRECTIONS @ matrix.T + place).tolist()
            hits = pybullet.rayTestBatch([place] * 360, ends, collisionFilterMask=3, physicsClientId=client)
            scans.append(np.array([hit[2] * RANGE if hit[0] >= 0 else np.inf for hit in hits]))
        pybullet.stepSimulation(client)
        base = pybullet.getBasePositionAndOrientation(robot, client), pybullet.getBaseVelocity(robot, client)
        rows.append((*base, pybullet.getJointStates(robot, wheels, client)))
    return rows, scans


def _mujoco(backend: Any, scan_period: int) -> object:
    """The motors are ours: the engine has none that turn wheels as they should."""
    import mujoco

    motors = backend._motors  # noqa: SLF001 - as a user would have them at hand
    model, data = motors._model, motors._data  # noqa: SLF001 - as above
    lidar, group = data.body("robot/base_scan"), np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
    geoms, distances = np.empty(360, np.int32), np.empty(360)
    states, scans = np.empty((STEPS, model.nq + model.nv)), []
    for step in range(1, STEPS + 1):
        if step % scan_period == 0:
            mujoco.mj_kinematics(model, data)
            ways = _DIRECTIONS @ lidar.xmat.reshape(3, 3).T
            mujoco.mj_multiRay(model, data, lidar.xpos, ways.ravel(), group, 1, -1, geoms, distances, None, 360, RANGE)
            scans.append(np.where((distances < 0) | (distances > 1), np.inf, distances * RANGE))
        mujoco.mj_step1(model, data)
        motors.drive(memoryview(data.efc_aref))
        mujoco.mj_step2(model, data)
        states[step - 1, : model.nq], states[step - 1, model.nq :] = data.qpos, data.qvel
    return states, scans
