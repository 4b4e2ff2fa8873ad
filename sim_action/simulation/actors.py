"""The other robots of a run: their controllers, sensors and drives, in the same clock as the robot under test.

Each robot plans its targets until its own next tick. The loop asks the robot under test for no more steps than all
others have planned, and hands all targets to the engine together.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from itertools import chain, combinations

import numpy as np
from typing_extensions import override

from sim_action.core.errors import BadSource, ControllersFinished, RunError, ScriptError
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import replace
from sim_action.engines.engine import Engine, RobotQueries
from sim_action.robot.model.kinematics import link_motion
from sim_action.scenario.model import DrivenActor, Scenario
from sim_action.simulation.controllers import Controls
from sim_action.simulation.guards import Guard, Watchdog, last_speed
from sim_action.simulation.sensors import Sensing
from sim_action.simulation.start_checks import about_robot, about_settling, drive_of
from sim_action.simulation.tunnelling import Tunnelling
from sim_action.state.command import JointTargets
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, frame_stride
from sim_action.world.scene import Scene


def prepared(scenario: Scenario, scene: Scene) -> Scene:
    """Return a scene in which the drives of the other robots have set what they need."""
    actors = dict(scene.actors)
    for actor in scenario.world.actors:
        if (drive := drive_of(scenario.as_seen_by(actor), actors[actor.name])) is not None:
            actors[actor.name] = drive.prepared(actors[actor.name])
    return replace(scene, actors=actors)


class _Actor:
    """One of the other robots.

    Attributes:
        until: the step until which its targets are planned.
        tunnelling: its watch for missed contacts, from t = 0 on.
        events: of the scenario, with what they start and stop of it.
    """

    def __init__(self, spec: DrivenActor, scenario: Scenario, scene: Scene, robot: RobotQueries) -> None:
        self.name, self.scene, self.robot, self.until = spec.name, scene, robot, 0
        own = scenario.as_seen_by(spec)
        drive = drive_of(own, scene)
        motion = self._motion = drive.open(scene.model, scenario.physics.rate, scene.world.weight) if drive else None
        self.controls, self.events = Controls(own, scene, motion), own.events
        heard, more = self.controls.are_watching, self.controls.sensors
        self.sensing = Sensing(own, scene, robot, heard=heard, more=more)
        self._placed = robot.observe(0, contacts=False)
        self._guards: list[Guard] = [Watchdog.of(scene, self._placed)]
        self._about = [*about_robot(own, scene, drive)]
        self._first = 0
        self._rows = list[JointTargets | None]()

    def begin(self, bodies: FloatArray, *, solid_terrain: bool) -> None:
        """Take the poses (M, 7) of the bodies with a mass at t = 0."""
        start = self.robot.observe(0, contacts=False)
        self._about += about_settling(self.scene, self._placed.pose, start.pose)
        self.tunnelling = Tunnelling(self.scene, start, bodies, solid_terrain=solid_terrain, links_only=True)
        self._guards.append(self.tunnelling)
        if any(body.path for body in self.scene.world.objects):
            from sim_action.simulation.bodies_on_paths import Pinning  # few worlds have bodies on paths

            self._guards.append(Pinning(self.scene, start.twist.linear_xyz))

    def watch(self, trace: Trace, bodies: FloatArray) -> tuple[Trace, RunError | None]:
        """Return the moments before the first one that can have no verdict, and its error."""
        error = None
        for guard in self._guards:
            trace, earlier = guard.watch(trace, bodies)
            error = earlier or error
        return trace, error

    def follow(self, scene: Scene) -> None:
        """Take a scene that states the times of events in the world since t = 0."""
        for guard in self._guards:
            guard.follow(replace(self.scene, world=scene.world))

    def plan(self, step: int, end: int) -> None:
        """Plan targets from a step on, if there are none yet, until its next tick or step `end`."""
        if step < self.until:
            return
        self.sensing.read(step)
        try:
            self._rows = self.controls.plan(step, self.sensing.next_tick(step, end), self.sensing.look)
        except ControllersFinished:
            # Its motors keep their last targets.
            self._rows = [None] * (end - step)
        self._first, self.until = step, step + len(self._rows)

    def targets(self, step: int, count: int) -> Iterator[tuple[int, JointTargets]]:
        """Yield its new targets at some steps, each with its number among them; without one it keeps the last ones."""
        rows = self._rows[step - self._first :][:count]
        return ((at, targets) for at, targets in enumerate(rows) if targets is not None)

    def notes(self, end: float) -> Iterator[str]:
        """Yield the notes on its run."""
        of_drive = self._motion.notes if self._motion else ()
        of_guards = (note for guard in self._guards for note in guard.notes(end))
        for note in (*self._about, *of_drive, *self.controls.notes(end), *self.sensing.notes, *of_guards):
            yield f"'{self.name}': {note}"


class Actors(Guard):
    """All other robots of a run; as a guard, it ends a run in which one explodes, or passes through something."""

    def __init__(
        self, scenario: Scenario, scene: Scene, backend: Engine, *, judged: Collection[str], filmed: bool
    ) -> None:
        """Open their controllers and sensors. Raise ScriptError, BadSource after closing the open ones.

        `judged`: names of robots and links whose poses expectations need at every step; `filmed`: a replay needs all
        links.
        """
        self._rate, self._frames, self._filmed = scenario.physics.rate, scene.frames, filmed
        self._solid_terrain = backend.solid_terrain
        self._links = [name for name in self._frames if "/" in name]
        # The moments that no guard has seen yet.
        self._unseen: dict[str, list[Trace]] = {name: [] for name in scene.actors}
        self._film: dict[str, list[Trace]] = {name: [] for name in scene.actors}
        self._judged = [name for name in sorted(judged) if name in self._frames]
        self._actors: list[_Actor] = []
        with ExitStack() as opened:
            for index, spec in enumerate(scenario.world.actors):
                with _of_actor(index, spec.name):
                    actor = _Actor(spec, scenario, scene.actors[spec.name], backend.actors[spec.name])
                opened.enter_context(closing(actor.controls))
                self._actors.append(actor)
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close the controllers after the run."""
        self._opened.close()

    @property
    def controls(self) -> tuple[Controls, ...]:
        """The command sources of each robot."""
        return tuple(actor.controls for actor in self._actors)

    @property
    def at_rest(self) -> dict[str, JointTargets]:
        """The targets that hold each of them before t = 0."""
        return {actor.name: actor.controls.at_rest for actor in self._actors}

    def switch(self, index: int, step: int) -> None:
        """Let the command sources that an event starts or stops do so at a physics step."""
        for actor in self._actors:
            actor.controls.switch(actor.events[index], step)

    def plan(self, step: int, until: int) -> int:
        """Plan targets from a step on; return the step until which the targets of all robots are planned."""
        for index, actor in enumerate(self._actors):
            with _of_actor(index, actor.name):
                actor.plan(step, until)
            until = min(until, actor.until)
        return until

    def added_to(self, planned: Sequence[JointTargets | None], step: int) -> list[JointTargets | None]:
        """Return the targets of the robot under test from a step on, with the targets of all other robots."""
        joined: dict[int, dict[str, JointTargets]] = {}
        for actor in self._actors:
            for at, targets in actor.targets(step, len(planned)):
                joined.setdefault(at, {})[actor.name] = targets
        return [
            replace(row or JointTargets(), actors=joined[at]) if at in joined else row for at, row in enumerate(planned)
        ]

    def seen_with(self, trace: Trace) -> Trace:
        """Return the trace since the last call with the poses of the robots."""
        traces = {actor.name: actor.robot.collect() for actor in self._actors}
        for name, unseen in self._unseen.items():
            unseen.append(traces[name])
        objects = dict(self._records(traces, self._judged))
        shown = self._frames_of(traces) if self._filmed else {}
        for name, moments in shown.items():
            self._film[name].append(moments)
        film = dict(self._records(shown, self._links)) if shown else {}
        return replace(trace, objects={**trace.objects, **objects}, bodies={**trace.bodies, **film})

    @override
    def watch(self, trace: Trace, bodies: FloatArray) -> tuple[Trace, RunError | None]:
        error: RunError | None = None
        for index, actor in enumerate(self._actors):
            unseen, self._unseen[actor.name] = self._unseen[actor.name], []
            seen, missed = actor.watch(Trace.concatenate(unseen), bodies)
            if missed is not None and len(seen) < len(trace):
                trace = trace.first(len(seen))
                keys = missed.keys
                if keys and keys[0] == "robot":
                    keys = ("world", "actors", index, *keys[1:])
                error = type(missed)(f"'{actor.name}': {missed}", keys=keys)
        watches = [("", self._ego), *((actor.name, actor.tunnelling) for actor in self._actors)]
        for (name, one), (other, met) in combinations(watches, 2):
            trace, missed = one.met(met, other, trace)
            if missed is not None:
                error = type(missed)(f"'{name}': {missed}", keys=missed.keys) if name else missed
        return trace, error

    def settled(self) -> float:
        """Drop the states before t = 0, and return the greatest speed of all, see `last_speed`."""
        return max(last_speed(actor.robot.collect()) for actor in self._actors)

    def begin(self, bodies: FloatArray, ego: Tunnelling) -> None:
        """Take the poses (M, 7) of the bodies with a mass at t = 0, and the watch of the robot under test."""
        self._ego = ego
        for actor in self._actors:
            actor.begin(bodies, solid_terrain=self._solid_terrain)

    @override
    def follow(self, scene: Scene) -> None:
        for actor in self._actors:
            actor.follow(scene)

    def film(self, end: float) -> dict[str, Trace]:
        """Return name -> the moments until a sim time in s that a replay shows; empty without a replay."""
        return {name: Trace.concatenate(kept).between(0.0, end) for name, kept in self._film.items() if kept}

    def _frames_of(self, traces: Mapping[str, Trace]) -> dict[str, Trace]:
        """Return the moments of traces that a replay shows."""
        frames = {}
        for name, trace in traces.items():
            steps = np.rint(trace.time * self._rate).astype(int)
            shown = (steps > 0) & ((steps % frame_stride(self._rate) == 0) | (steps == 1))
            frames[name] = trace.rows(np.flatnonzero(shown))
        return frames

    def _records(self, traces: Mapping[str, Trace], names: Iterable[str]) -> Iterator[tuple[str, BodyRecord]]:
        models = {actor.name: actor.scene.model for actor in self._actors}
        for name in names:
            robot, link = self._frames[name]
            if len(trace := traces[robot]):
                motion = link_motion(models[robot], trace, link)
                yield name, BodyRecord(trace.time, motion.position_xyz, motion.orientation_xyzw)

    @override
    def notes(self, end: float) -> Iterator[str]:
        return chain.from_iterable(actor.notes(end) for actor in self._actors)

    def time_marks(self, end: float) -> Iterator[TimeMark]:
        """Yield the marks of commands until a sim time in s, and of lost readings."""
        for actor in self._actors:
            for mark in (*actor.controls.time_marks(end), *actor.sensing.time_marks()):
                yield replace(mark, words=f"'{actor.name}': {mark.words}")


@contextmanager
def _of_actor(index: int, name: str) -> Iterator[None]:
    """Let errors of command sources name the robot."""
    try:
        yield
    except (ScriptError, BadSource) as error:
        error.actor, error.args = index, (f"'{name}': {error.args[0]}",)
        raise
