"""The PyBullet engine: implements the Engine protocol and steps the simulation.

The engine is the robot under test (see `LoadedRobot`); the other robots of the world are its `actors`. Contact points
are reported before surfaces touch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core.errors import BadStart, EngineError
from sim_action.core.records import replace
from sim_action.core.wording import system_reason
from sim_action.engines import named_version
from sim_action.engines.body_control import WorldEvents
from sim_action.engines.clearances import ClearanceRecorder
from sim_action.engines.engine import NO_CHANNELS, Engine
from sim_action.engines.observers import ReadPoses, Recorders, path_contacts
from sim_action.engines.pybullet.bodies import Distances, clashes, overlaps, pose_reader, touching
from sim_action.engines.pybullet.loaded_bodies import (
    add_object,
    belt_notes,
    configure,
    connect_ahead,
    connected,
    pave,
    release,
)
from sim_action.engines.pybullet.robot import LoadedRobot
from sim_action.state.command import JointTargets
from sim_action.state.observation import Clash, Overlap
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ContactRecord
from sim_action.world import GROUND, World
from sim_action.world.scene import EGO, Scene


def _connected_for(scene: Scene) -> tuple[int, int]:
    """Return a connection, and the number of its ground. Raises BadStart for what PyBullet does not have."""
    if scene.physics.speculative:
        only = "PyBullet has no speculative contacts: use backend: mujoco, or remove it and raise physics.rate"
        raise BadStart([(("physics", "speculative"), only)])
    return connected()


class PyBulletEngine(LoadedRobot, Engine):
    """A DIRECT connection to PyBullet that holds one scene."""

    version = named_version("pybullet")
    solid_terrain = False
    actors: Mapping[str, LoadedRobot]
    warm_up = staticmethod(connect_ahead)

    def __init__(self, scene: Scene, channels: Channels = NO_CHANNELS) -> None:
        client, ground = _connected_for(scene)
        try:
            configure(
                *(client, scene.physics.rate, scene.world.gravity_xyz),
                exact=bool(scene.scrubbing),
                apart=bool(scene.actors),
            )
            tiles = pave(client, ground, scene.world)
            objects = {body.name: add_object(client, body, scene.parts_of(body)) for body in scene.world.objects}
            super().__init__(client, ground, scene, channels)
            numbered = enumerate(scene.actors.items(), start=1)
            actors = {name: LoadedRobot(client, ground, own, number=number) for number, (name, own) in numbered}
        except pybullet.error as error:
            release(client)
            raise EngineError(f"the engine refused the world: {error}") from None
        except OSError as error:
            release(client)
            raise EngineError(f"the engine cannot open the files of the model: {system_reason(error)}") from None
        self.actors = actors
        bodies = {**objects, **{name: [actor.piece] for name, actor in actors.items()}}
        names = dict.fromkeys((ground, *tiles), GROUND)
        names |= {number: name for name, added in bodies.items() for number, _ in added}
        moving = [body.name for body in scene.world.objects if body.mass is not None]
        self._moving = {bodies[name][0][0] for name in (*moving, *actors)}
        self._held = {place for name, actor in actors.items() for place in actor.held_links(scene.actors[name])}
        self._watches_ground = channels.ground
        self._watches_contacts = channels.contacts and (channels.ground or bool(bodies))
        notes_of_actors = (f"'{name}': {note}" for name, actor in actors.items() for note in actor.notes)
        self.notes = (*self.notes, *belt_notes(scene.world), *notes_of_actors)
        self.meet(scene, bodies, names, *tiles)
        for name, actor in actors.items():
            others = {number: other for number, other in names.items() if other != name}
            actor.meet(scene.actors[name], bodies, {**others, self._robot: EGO})
            actor.others = {EGO: self, **actors}
        self.others = actors
        self._events = WorldEvents.of(scene, self._control, drives_surfaces=True)
        distances = Distances(client, self._robot, self._link_names, names)
        shaped = [link.name for link in scene.model.links if link.collisions]
        self._path_contacts = path_contacts(scene, shaped, distances.nearest)
        if self._path_contacts is not None:
            self._contacts.leave_out(
                {self._links[name] for name in scene.bolted_links},
                {number for body in scene.world.objects if body.path for number, _ in bodies[body.name]},
            )
        self._clearances = ClearanceRecorder(
            *(channels, scene, distances.radii()),
            near=distances.near,
            body_at=self._body_at,
            actors={name: actor.motion_bound() for name, actor in actors.items()} if channels.clearances else {},
        )
        self._recorders = Recorders(channels, scene, self._reader, self._contacts.of_links)
        self._watchers = [*(actor.keep for actor in actors.values()), *self._recorders.watchers]
        if any(body.path for body in scene.world.objects):
            self._watchers += (actor.keep_touches for actor in actors.values())
        if moving:
            look = self._reader(moving)
            self._watchers.append(lambda _: self._body_poses.append(look()))
        if self._self_collision is not None:
            self.model_notes = self._self_collision.notes
            self._watchers += self._self_collision.start(channels, self._states.last)
        self._body_poses: list[Sequence[float] | NDArray[np.float64]] = []
        self._is_watched = self._watches_contacts or bool(self._watchers) or not self._clearances.is_idle

    @override
    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        self._lazy_contacts.settle()
        if self.actors:
            self._settle_actors()
        simulate, client, keep, events = pybullet.stepSimulation, self._client, self._states.keep, self._events
        is_watched, has_forces = self._is_watched, self.has_forces()
        for step, new_targets in enumerate(targets, start=first_step + 1):
            if new_targets is not None:
                self.apply(new_targets)
                for name, own in (new_targets.actors or {}).items():
                    self.actors[name].apply(own)
                has_forces = self.has_forces()
            if has_forces:
                self.apply_forces(step)
            if events is not None:
                events.before_step(step - 1)
            simulate(client)
            if events is not None:
                events.after_step(step)
            keep(step)
            if is_watched:
                self._watch(step)

    @override
    def follow(self, world: World, time: float) -> None:
        self._clearances.follow(world, time)
        if self._events is not None:
            self._events.follow(world)
            self._recorders.follow(world)

    def _settle_actors(self) -> None:
        for actor in self.actors.values():
            actor.settle()

    @override
    def has_forces(self) -> bool:
        return super().has_forces() or (bool(self.actors) and any(actor.has_forces() for actor in self.actors.values()))

    @override
    def apply_forces(self, step: int) -> None:
        super().apply_forces(step)
        for actor in self.actors.values():
            actor.apply_forces(step)

    def _watch(self, step: int) -> None:
        """Record everything but the state of the robot after a step."""
        if self._watches_contacts:
            self._touches += self._present_contacts(step, ground=self._watches_ground)
        for watch in self._watchers:
            watch(step)
        if not self._clearances.is_idle:
            self._clearances.record(step, *self.last_place())

    @override
    def collect(self) -> Trace:
        clearances = self._clearances.collect()
        records = self._recorders.collect()
        trace = replace(super().collect(), clearances=clearances, **records)
        return trace if self._self_collision is None else self._self_collision.added_to(trace)

    @override
    def link_contacts(self, step: int) -> dict[str, ContactRecord]:
        return self._recorders.present_contacts(step)

    @override
    def collect_bodies(self) -> NDArray[np.float64]:
        kept, self._body_poses = self._body_poses, []
        return np.array(kept, dtype=np.float64).reshape(len(kept), -1, 7) if kept else np.empty((0, 0, 7))

    def _reader(self, names: Sequence[str]) -> ReadPoses:
        return pose_reader(self._client, [self._objects[name][0] for name in names])

    def _body_at(self, body: str) -> tuple[float, ...]:
        pose = self.body_pose(body)
        return (*pose.position_xyz, *pose.orientation_xyzw)

    @override
    def touching(self) -> tuple[Overlap | Clash, ...]:
        return tuple(touching(self._client, self._robot, self._link_names, self._body_names, self._is_loose))

    @override
    def overlaps(self) -> tuple[Overlap, ...]:
        return overlaps(self._client, self._robot, self._link_names, self._body_names)

    @override
    def clashes(self) -> tuple[Clash, ...]:
        return clashes(self._client, self._moving, self._body_names, self._is_loose)

    def _is_loose(self, body: int, link: int) -> bool:
        return body in self._moving and (body, link) not in self._held

    @override
    def close(self) -> None:
        self.settle()
        self._settle_actors()
        release(self._client)
