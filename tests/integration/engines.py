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
from sim_action.engines import ENGINES, installed
from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceWatch
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

on_every_engine = pytest.mark.parametrize(
    "engine",
    [
        pytest.param(name, marks=pytest.mark.skipif(name not in installed(), reason=f"{name} is not installed"))
        for name in ENGINES
    ],
)


def inertia(moment: float) -> str:
    return f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'


def one_link(shape: str, more: str = "", mass: float = 1.0, moment: float = 0.004) -> str:
    return (
        f'<robot name="it"><link name="it"><inertial><mass value="{mass}"/>{inertia(moment)}</inertial>'
        f"<collision>{more}<geometry>{shape}</geometry></collision></link></robot>"
    )


# A ball of 0.1 m and 1 kg, homogeneous: 2/5 m r^2.
BALL = one_link('<sphere radius="0.1"/>')
CRATE = one_link('<box size="0.4 0.4 0.1"/>', mass=10, moment=0.1)

# The centre of mass is neither at the link's origin nor turned like it.
LOPSIDED = """
<robot name="lopsided"><link name="base">
  <inertial><origin xyz="0.3 0.1 0.2" rpy="0.4 0.5 0.6"/><mass value="2"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.3 0.1 0.2"/><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
</link></robot>
"""

# Bolted to the world; an axis that is upright has no gravity about it.
MECHANISM = """
<robot name="mechanism">
  <link name="world"/>
  <joint name="mount" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 3"/></joint>
  <link name="base"><inertial><mass value="1"/>{inertia}</inertial></link>
  <joint name="joint" type="{type}"><parent link="base"/><child link="part"/><axis xyz="{axis}"/>
    <limit lower="-30" upper="30" effort="{effort}" velocity="{velocity}"/>
    <dynamics damping="{damping}" friction="{friction}"/></joint>
  <link name="part"><inertial><mass value="2"/>{inertia}</inertial></link>
</robot>
"""
MOMENT = 0.5


def mechanism(kind: str = "continuous", axis: str = "0 0 1", **stated: float) -> str:
    numbers: dict[str, float] = {"effort": 100, "velocity": 50, "damping": 0, "friction": 0}
    return MECHANISM.format(type=kind, axis=axis, inertia=inertia(MOMENT), **numbers | stated)


def at(z: float | None = None, **pose: float) -> Robot:
    return Robot(model="robot.urdf", pose=Placement(z=z, **pose))


def scene_of(
    folder: Path, urdf: str, robot: Robot, world: World | None = None, *, rate: float = 240.0, allow: Sequence[str] = ()
) -> Scene:
    path = folder / "robot.urdf"
    path.write_text(urdf, encoding="utf-8")
    model = read_urdf(path, allow=allow)
    return Scene(robot, model, world or World(), Physics(rate=rate), Workspace(folder, folder))


def scene_of_file(
    folder: Path, name: str, text: str, world: World | None = None, *, rate: float = 240.0, **robot: Any
) -> Scene:
    """The scene of a model in any format; `robot`: more of what a scenario says of it."""
    (folder / name).write_text(text, encoding="utf-8")
    spec, workspace = Robot(model=name, **robot), Workspace(folder, folder)
    return Scene(spec, load_model(spec, workspace), world or World(), Physics(rate=rate), workspace)


@contextmanager
def running(
    engine: str,
    scene: Scene,
    *,
    contacts: bool = False,
    clearances: Iterable[ClearanceWatch] = (),
    objects: Iterable[str] = (),
    self_contacts: bool = False,
) -> Iterator[Engine]:
    pytest.importorskip(ENGINES[engine].package, reason=f"{engine} is not installed")
    channels = Channels(contacts, frozenset(clearances), objects=frozenset(objects), self_contacts=self_contacts)
    backend = ENGINES[engine].load()(scene, channels)
    try:
        yield backend
    finally:
        backend.close()


def advance(backend: Engine, first_step: int, steps: int, *targets: JointTargets) -> Trace:
    """Steps on, with these targets at the first steps."""
    backend.advance(first_step, [*targets, *[None] * (steps - len(targets))])
    return backend.collect()


def travelled(
    engine: str,
    scene: Scene,
    steps: int,
    *targets: JointTargets,
    start: Sequence[Vector3] = (),
    contacts: bool = False,
    clearances: Iterable[ClearanceWatch] = (),
) -> Trace:
    """The trace of the first steps. `start`: the velocity of the base link's origin, as `push` takes it."""
    with running(engine, scene, contacts=contacts, clearances=clearances) as backend:
        if start:
            push(backend, *start)
        return advance(backend, 0, steps, *targets)


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
