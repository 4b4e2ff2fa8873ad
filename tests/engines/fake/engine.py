"""An engine without contacts: a free base falls, a fixed one stays, and motors follow their targets at once.

It shows what a third engine needs: this folder, and one row of the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.engines import EngineRow, named_version
from sim_action.engines.engine import NO_CHANNELS, Engine
from sim_action.robot.model.kinematics import LinkStates
from sim_action.state.command import JointTargets
from sim_action.state.observation import ByName, Clash, JointState, Observation, Overlap
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ContactRecord
from sim_action.world.scene import Scene

ROW = EngineRow(
    path="tests.engines.fake.engine:FakeEngine",
    title="Fake",
    package="tests",
    distribution="numpy",
    install_hint="it is a part of the tests",
    environment=("FAKE_ENGINE_*",),
)


class FakeEngine(Engine):
    """A robot that touches nothing, in a world of bodies at rest."""

    solid_terrain = True

    def __init__(self, scene: Scene, channels: Channels = NO_CHANNELS) -> None:
        self.version = named_version("fake")
        self._model, self._rate = scene.model, scene.physics.rate
        self._gravity_xyz: Vector3 = geometry.ZERO if scene.bolted else scene.world.gravity_xyz
        place = scene.placement
        self._pose = Pose((place.x, place.y, place.z or 0.0), place.orientation_xyzw)
        self._velocity_xyz = geometry.ZERO
        self._names = tuple(joint.name for joint in scene.model.moving_joints)
        self._joints = {name: JointState(scene.joint_positions[name], 0.0, 0.0) for name in self._names}
        self._speeds = dict.fromkeys(self._names, 0.0)
        self._bodies = {body.name: body for body in scene.world.objects}
        self._moments: list[Trace] = []

    @override
    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        for step, wanted in enumerate(targets, start=first_step + 1):
            if wanted is not None:
                self._speeds |= wanted.velocity
                self._turn(wanted.position)
            self._turn({name: state.position + self._speeds[name] / self._rate for name, state in self._joints.items()})
            self._velocity_xyz = geometry.add(self._velocity_xyz, geometry.scale(self._gravity_xyz, 1 / self._rate))
            way_xyz = geometry.scale(self._velocity_xyz, 1 / self._rate)
            self._pose = Pose(geometry.add(self._pose.position_xyz, way_xyz), self._pose.orientation_xyzw)
            self._moments.append(Trace.of_observation(self.observe(step, contacts=False)))

    def _turn(self, positions: Mapping[str, float]) -> None:
        self._joints |= {name: JointState(angle, self._speeds[name], 0.0) for name, angle in positions.items()}

    @override
    def collect(self) -> Trace:
        moments, self._moments = self._moments, []
        return Trace.concatenate(moments) if moments else Trace(self._names, np.empty((0, 14 + 3 * len(self._names))))

    @override
    def collect_bodies(self) -> NDArray[np.float64]:
        return np.empty((0, 0, 7))

    @override
    def observe(self, step: int, *, contacts: bool) -> Observation:
        twist, joints = Twist(self._velocity_xyz), ByName(self._joints)
        links = LinkStates(self._model, self._pose, twist, joints)
        return Observation(step / self._rate, self._pose, twist, joints, (), links=links)

    @override
    def link_contacts(self, step: int) -> Mapping[str, ContactRecord]:
        return {}

    @override
    def link_pose(self, link: str) -> Pose:
        return self.observe(0, contacts=False).links[link].pose

    @override
    def link_twist(self, link: str) -> Twist:
        return self.observe(0, contacts=False).links[link].twist

    @override
    def body_pose(self, body: str) -> Pose:
        place = self._bodies[body].pose
        return Pose((place.x, place.y, place.z or 0.0), place.orientation_xyzw)

    @override
    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full(len(ends_xyz), np.inf)

    @override
    def touching(self) -> tuple[Overlap | Clash, ...]:
        return ()

    @override
    def overlaps(self) -> tuple[Overlap, ...]:
        return ()

    @override
    def clashes(self) -> tuple[Clash, ...]:
        return ()

    @override
    def close(self) -> None:
        self._moments.clear()
