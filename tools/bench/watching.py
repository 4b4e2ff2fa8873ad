"""Measure contacts and clearance at every step, against hand-written loops that step and store the state."""

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
ROUNDS: Final = 15

# Rounds among things. To drive straight towards something is more work: every step comes nearer than all before.
SCENARIO: Final = """\
name: burger drives on among things
robot: {{model: turtlebot3_burger}}
world:
  objects:
    - {{name: wall, box: [0.1, 3.0, 0.5], pose: {{x: 2}}}}
    - {{name: left, cylinder: {{radius: 10 cm, height: 1.0}}, pose: {{x: 0.0, y: 1.3}}}}
    - {{name: right, box: [0.3, 0.3, 0.3], pose: {{x: -0.9, y: 0.3}}}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.2, angular: 0.5}}]}}
expect: [{{travel: {{at_least: 50 cm}}}}{watching}]
duration: 20 s
time_limit: 20 s
backend: {engine}
"""
WATCHING: Final = ", no_collision, {clearance: {at_least: 10 cm}}"
WHEELS: Final = JointTargets(velocity={"wheel_left_joint": 4.8, "wheel_right_joint": 7.3})


class WatchingCost(NamedTuple):
    """Seconds of loops, without loading and settling."""

    watching: float
    unwatched: float
    by_hand: float


def watching_cost(engine: str) -> WatchingCost:
    """The least of several rounds in which they take turns."""
    loops = [_ours(engine, WATCHING), _ours(engine, ""), _by_hand(engine)]
    rounds = [[loop() for loop in loops] for _ in range(ROUNDS)]
    return WatchingCost(*map(min, zip(*rounds, strict=True)))


def _ours(engine: str, watching: str) -> Callable[[], float]:
    loaded = _load(engine, watching)

    def call() -> float:
        run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
        assert all(verdict.passed for verdict in run.verdicts)
        return run.wall_time

    return call


def _by_hand(engine: str) -> Callable[[], float]:
    scene, loop = build_scene(_load(engine, "")), {"pybullet": _pybullet, "mujoco": _mujoco}[engine]

    def call() -> float:
        backend = ENGINES[engine].load()(scene)
        backend.advance(0, [WHEELS])
        started = time.perf_counter()
        loop(backend)
        took = time.perf_counter() - started
        backend.close()
        return took

    return call


def _load(engine: str, watching: str) -> LoadedScenario:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "things.sim.yml")
        path.write_text(SCENARIO.format(engine=engine, watching=watching))
        return load_scenario(path)


def _pybullet(backend: Any) -> object:
    import pybullet

    client = backend._client  # noqa: SLF001 - as a user would have it at hand
    robot = pybullet.getBodyUniqueId(pybullet.getNumBodies(client) - 1, client)
    infos = [pybullet.getJointInfo(robot, index, client) for index in range(pybullet.getNumJoints(robot, client))]
    wheels = [info[0] for info in infos if info[3] >= 0]
    rows = []
    for _step in range(STEPS):
        pybullet.stepSimulation(client)
        base = pybullet.getBasePositionAndOrientation(robot, client), pybullet.getBaseVelocity(robot, client)
        rows.append((*base, pybullet.getJointStates(robot, wheels, client)))
    return rows


def _mujoco(backend: Any) -> object:
    """The motors are ours: the engine has none that turn wheels as they should."""
    import mujoco

    motors = backend._motors  # noqa: SLF001 - as a user would have them at hand
    model, data = motors._model, motors._data  # noqa: SLF001 - as above
    states = np.empty((STEPS, model.nq + model.nv))
    for step in range(STEPS):
        mujoco.mj_step1(model, data)
        motors.drive(memoryview(data.efc_aref))
        mujoco.mj_step2(model, data)
        states[step, : model.nq], states[step, model.nq :] = data.qpos, data.qvel
    return states
