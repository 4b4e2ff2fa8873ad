"""Measure a step with sim-action and one in the same world without it, in microseconds; the two take turns."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.core.geometry import Twist
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from tools.bench.robots import KnownRobot

SECONDS: Final = 5
"""Measured sim time in s, after settling."""

ROUNDS: Final = 5
"""Noise only ever adds: the least time counts."""


@dataclass(frozen=True, slots=True)
class StepCost:
    """Microseconds of wall time a step."""

    ours: float
    raw: float


def step_cost(known: KnownRobot) -> StepCost:
    """Measures a robot at rest."""
    with tempfile.TemporaryDirectory() as folder:
        loaded = known.resting(Path(folder), SECONDS)
    rounds = [(_ours(loaded), _raw(loaded)) for _ in range(ROUNDS)]
    ours, raw = map(min, zip(*rounds, strict=True))
    return StepCost(ours, raw)


def _ours(loaded: LoadedScenario) -> float:
    """The whole loop: commands, steps, the state of each, the watchdog, two assertions, the digest."""
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    return run.wall_time / (run.sim_time * loaded.scenario.physics.rate) * 1e6


def _raw(loaded: LoadedScenario) -> float:
    """A loop by hand: a step, and the state of the base and of all joints that move."""
    import pybullet

    from sim_action.engines.pybullet.engine import PyBulletEngine

    physics, scene = loaded.scenario.physics, build_scene(loaded)
    backend = PyBulletEngine(scene)
    settling = round(physics.settle * physics.rate)
    drive = loaded.scenario.robot.drive
    brake = drive.open(scene.model, physics.rate).targets(Twist(), 1) if drive else []
    backend.advance(-settling, [*brake, *[None] * (settling - len(brake))])
    client = backend._client  # noqa: SLF001 - as a user would have it at hand
    robot = pybullet.getBodyUniqueId(pybullet.getNumBodies(client) - 1, client)
    infos = [pybullet.getJointInfo(robot, index, client) for index in range(pybullet.getNumJoints(robot, client))]
    joints = [info[0] for info in infos if info[3] >= 0]
    steps = round(SECONDS * physics.rate)
    rows = []
    started = time.perf_counter()
    for _ in range(steps):
        pybullet.stepSimulation(client)
        base = pybullet.getBasePositionAndOrientation(robot, client), pybullet.getBaseVelocity(robot, client)
        rows.append((*base, pybullet.getJointStates(robot, joints, client) if joints else ()))
    took = time.perf_counter() - started
    backend.close()
    return took / steps * 1e6
