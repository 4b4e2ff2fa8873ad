"""What tests need of an engine that the Engine protocol does not offer: to set a robot in motion at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Vector3
from sim_action.core.workspace import Workspace
from sim_action.engines import ENGINES, Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

on_every_engine = pytest.mark.parametrize("engine", list(ENGINES))


def at(z: float | None = None, **pose: float) -> Robot:
    return Robot(model="robot.urdf", pose=Placement(z=z, **pose))


def scene_of(
    folder: Path, urdf: str, robot: Robot, world: World | None = None, *, rate: float = 240.0, allow: Sequence[str] = ()
) -> Scene:
    path = folder / "robot.urdf"
    path.write_text(urdf, encoding="utf-8")
    model = read_urdf(path, allow=allow)
    return Scene(robot, model, world or World(), Physics(rate=rate), Workspace(folder, folder))


@contextmanager
def running(
    engine: str, scene: Scene, *, contacts: bool = False, clearances: Iterable[ClearanceWatch] = ()
) -> Iterator[Engine]:
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    backend = ENGINES.load(engine)(scene, Channels(contacts, frozenset(clearances)))
    try:
        yield backend
    finally:
        backend.close()


def advance(backend: Engine, first_step: int, steps: int, *targets: JointTargets) -> Trace:
    """Steps on, with these targets at the first steps."""
    backend.advance(first_step, [*targets, *[None] * (steps - len(targets))])
    return backend.collect()


def push(backend: Engine, linear: Vector3 = geometry.ZERO, angular: Vector3 = geometry.ZERO) -> None:
    """Gives the base link's origin a velocity, world frame."""
    (_push_bullet if backend.version.startswith("pybullet") else _push_mujoco)(backend, linear, angular)


def _push_bullet(backend: Any, linear: Vector3, angular: Vector3) -> None:
    import pybullet

    orientation = backend.observe(0, contacts=False).pose.orientation_xyzw
    around = geometry.cross(angular, geometry.rotate(orientation, backend._states.com_in_link.position_xyz))
    of_com = [speed + more for speed, more in zip(linear, around, strict=True)]
    pybullet.resetBaseVelocity(backend._robot, of_com, angular, backend._client)


def _push_mujoco(backend: Any, linear: Vector3, angular: Vector3) -> None:
    orientation = backend.observe(0, contacts=False).pose.orientation_xyzw
    own = geometry.rotate(geometry.conjugate(orientation), angular)
    backend._states._qvel[:6] = *linear, *own
