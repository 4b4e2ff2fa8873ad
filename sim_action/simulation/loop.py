"""The loop of a run: controllers give targets, the engine steps, and the monitors see every step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, closing
from itertools import repeat
from typing import TYPE_CHECKING, Final

import numpy as np

from sim_action.assertions.monitors.windows import MOVED_M, Rest
from sim_action.core.errors import ControllersFinished, RunError
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field, replace
from sim_action.drives import Drive
from sim_action.engines import ENGINES, chosen
from sim_action.engines.engine import Engine
from sim_action.engines.observers import presences
from sim_action.robot.model.findings import announced, unannounced
from sim_action.scenario.model import Expectation, Scenario
from sim_action.scenario.mutation import UNTOUCHED, Seams
from sim_action.simulation.accuracy import AccuracyWatch, links_with_springs
from sim_action.simulation.controllers import Controls, padded
from sim_action.simulation.guards import NO_BODIES, Guard, Watchdog, last_speed
from sim_action.simulation.panel import End, Panel
from sim_action.simulation.recorder import RunRecorder, moving_bodies
from sim_action.simulation.run_audit import Beginning, Motion, RunFacts, audit_run, unreached_events
from sim_action.simulation.sensors import Sensing
from sim_action.simulation.start_checks import (
    Spawns,
    about_links,
    about_model_of_drive,
    about_robot,
    about_settling,
    drive_of,
    noted_drive,
    opened_on_top,
    raised_to_stand,
    refuse_bad_start,
)
from sim_action.state.observation import Observation
from sim_action.state.timeline import TimeMark, in_order, nearest_causes, waits
from sim_action.state.trace import Digest, Trace
from sim_action.state.trace_records import BodyRecord, Channels
from sim_action.state.verdict import Verdict
from sim_action.world.claims import LOGGED_ERROR, NOT_REPRODUCIBLE, NOT_SIMULATED, ClaimFinding
from sim_action.world.physics import GROUND
from sim_action.world.robot_reach import reached_patches
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.simulation.actors import Actors
    from sim_action.simulation.events import RunEvents

Progress = Callable[[float], None]  # receives the sim time in s during the run

# The speed limit for a robot at rest, in m/s and rad/s, at the end of a settling period.
_REST_SPEED: Final = 5e-3
_SETTLE_PERIOD_S: Final = 0.1
_AHEAD: Final = 0.2  # the share of the time of a run by which it goes on to see by how much its goals are met
_POSITION_UNITS: Final = frozenset({"rad", "m"})  # of the positions of joints


@dataclass(frozen=True, eq=False)
class SimulationRun:
    """The result of a run that has verdicts."""

    trace: Trace  # the trace at `Scenario.trace_rate`, from t = 0 to the end
    verdicts: tuple[Verdict, ...]  # one verdict for each expectation, in their order
    end: End
    digest: str  # SHA-256 of the state at full rate, and of the messages that nodes sent
    travelled: float  # the distance in m between the first and last position of the base, on the ground plane
    wall_time: float  # the duration of the loop in s, without loading and settling
    engine: str
    notes: tuple[str, ...]  # assumptions and observations, for people
    model_notes: tuple[str, ...] = ()  # notes on the robot model that every report shows
    # of the audit of claims after the run, except findings that the scenario allows
    findings: tuple[ClaimFinding, ...] = ()
    # name of each event -> the sim times in s at which it happened
    events: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def sim_time(self) -> float:
        """The sim time at the end, in s."""
        return float(self.trace.time[-1])


def simulate(
    scenario: Scenario, scene: Scene, progress: Progress, footage: RunRecorder | None = None, seams: Seams = UNTOUCHED
) -> SimulationRun:
    """Run a scenario to its end. Raise RunError where there can be no verdict.

    `footage`: the recorder, which also keeps data of a failed run; default: the trace only. `seams`: where a mutation
    acts on the run.
    """
    footage = footage or RunRecorder(scenario)
    if scenario.faults:
        # Few scenarios state faults.
        from sim_action.simulation.faults import FaultSeams

        seams = FaultSeams(scenario.faults, scene, seams)
    scene = seams.scene(scene)
    drive = drive_of(scenario, scene)
    # A drive may assume a stiffness of tyres.
    springs = links_with_springs(scene.model)
    scene = drive.prepared(scene) if drive else scene
    if scene.actors:
        from sim_action.simulation.actors import prepared  # few worlds have other robots

        scene = prepared(scenario, scene)
    channels = _judged_channels(scenario, scene)
    paths = Channels(contacts=any(body.path for body in scene.world.objects))
    watched = channels | footage.channels(scene.world) | paths
    engine = ENGINES[chosen(scenario.backend)].load()
    backend, notes = opened_on_top(scene, lambda scene: engine(scene, watched))
    try:
        at = backend.observe(0, contacts=False).pose
        can_clash = bool(scene.actors) or any(body.mass is not None for body in scene.world.objects)
        clashes = backend.clashes() if can_clash else ()
        notes += refuse_bad_start(scene, at, backend.overlaps(), clashes, scenario.allow)
        loop = _Loop(scenario, scene, drive, backend, channels, footage=footage, springs=springs, seams=seams)
        run = loop.run(progress)
        return replace(run, notes=(*run.notes, *notes))
    finally:
        backend.close()


def _judged_channels(scenario: Scenario, scene: Scene) -> Channels:
    """Return the channels of all assertions. A class of the user's may read any body, and any sensor but cameras."""
    of_events = (part.channels | part.truth_channels for part in scenario.conditions)
    channels = Channels.all_of((*(expected.channels for expected in scenario.expect), *of_events))
    # A formula cannot say which of its names are links.
    compared = scenario.agreement.bodies if scenario.agreement is not None else ()
    objects = channels.objects.intersection((*scenario.world.names, *scene.frames))
    objects |= scene.actors.keys() & compared
    channels = replace(channels, objects=objects)
    if not any(assertion.python_file for assertion in scenario.assertions):
        return channels
    sensors = (mounted.name for mounted in scenario.sensors if not mounted.sensor.is_picture)
    return channels | Channels(bodies=frozenset(moving_bodies(scenario.world)), sensors=frozenset(sensors))


class _Loop:
    """One run; the step count is its clock."""

    def __init__(
        self,
        scenario: Scenario,
        scene: Scene,
        drive: Drive | None,
        backend: Engine,
        channels: Channels,
        *,
        footage: RunRecorder,
        springs: frozenset[str],
        seams: Seams,
    ) -> None:
        self._seams = seams
        self._springs = springs
        self._footage = footage
        self._scenario = scenario
        self._scene = scene
        self._drive = drive
        self._backend = backend
        self._placed = backend.observe(0, contacts=False)
        self._judged = channels
        self._watchdog = Watchdog.of(scene, self._placed)
        self._guards: list[Guard] = [self._watchdog]
        self._body_poses: FloatArray | None = None
        motion = seams.motion(drive.open(scene.model, scenario.physics.rate, scene.world.weight) if drive else None)
        self._motion, noted = motion, noted_drive(scenario, scene, drive)
        self._notes = [*unannounced(scene.model.findings), *backend.notes, *about_robot(scenario, scene, noted)]
        about_model = (*about_model_of_drive(scenario, scene, noted, motion), *about_links(scenario, scene))
        self._model_notes = (*announced(scene.model.findings), *backend.model_notes, *about_model)
        self._arrivals = Spawns.of(scenario)
        self._events: RunEvents | None = None
        # The events that start or stop command sources at the present step.
        self._switching: list[int] = []
        # The moments that the conditions of events have seen already.
        self._seen: list[Trace] = []
        self._last_step = scenario.steps(scenario.time_limit)
        self._step = 0
        self._actors: Actors | None = None
        # The first one; all moments of a run that looks ahead.
        self._moments: list[Trace] = []
        with ExitStack() as opened:
            controls = Controls(scenario, scene, self._motion, footage.command, seams)
            self._controls = opened.enter_context(closing(controls))
            heard = self._controls.are_watching
            more, judged = self._controls.sensors, channels.sensors
            self._sensing = Sensing(
                scenario, scene, backend, heard=heard, judged=judged, more=more, seams=seams, logs=footage.readings
            )
            if scene.actors:
                from sim_action.simulation.actors import Actors  # few worlds have other robots

                self._actors = Actors(scenario, scene, backend, judged=channels.objects, filmed=footage.is_filmed)
                opened.enter_context(closing(self._actors))
            self._opened = opened.pop_all()

    def run(self, progress: Progress) -> SimulationRun:
        with self._opened:
            run = self._run(progress)
        return replace(run, notes=(*self._all_notes(run.sim_time), *run.notes), model_notes=self._model_notes)

    def _run(self, progress: Progress) -> SimulationRun:
        footage = self._footage
        self._settle()
        start = self._backend.observe(0, contacts=self._judged.contacts)
        opening: tuple[Trace, ...] = (self._first_moment(start),)
        self._open_events(start, opening[0])
        placed = self._placed_bodies()
        self._guards += self._guards_from(start, placed)
        raised = raised_to_stand(self._scene, self._placed.pose)
        settled = about_settling(self._scene, self._placed.pose, start.pose)
        self._notes += [note for note in (raised, *settled) if note is not None]
        panel = Panel.open(self._scenario, self._scene, start, runs_on=self._seams.runs_on)
        digest = Digest()
        motion = Motion(Rest.of(self._scene, start))
        begin = Beginning(panel.monitors, opening[0])
        footage.begin(start, placed, opening[0])
        started, earlier = time.perf_counter(), panel
        while panel.end is None:
            trace, failure = self._advance(panel.next_period(earlier), progress)
            earlier = panel = self._after_events(panel)
            if len(trace):
                panel, seen = panel.observe_until_end(Trace.concatenate((*opening, trace)) if opening else trace)
                if opening:
                    # The recorder has the moment at t = 0 already.
                    begin = begin._replace(trace=seen.first(min(2, len(seen))))
                    seen, opening = seen.rows(slice(len(opening), None)), ()
                digest.add(seen)
                motion = motion.after(seen)
                touching = self._backend.touching()
                for guard in self._guards:
                    guard.judged(seen, touching)
                is_last = panel.end is not None or failure is not None
                if len(seen):
                    stored, bodies = self._sensing.stored(seen), self._body_poses
                    footage.add(stored, judged=seen.sensors, is_last=is_last, bodies=bodies)
            panel = self._without_later_events(panel)
            if failure is not None or panel.end is not None:
                self._end_footage(panel.time if panel.end else self._step / self._scenario.physics.rate)
            if isinstance(failure, ControllersFinished):
                break
            if failure is not None and panel.end is None:
                raise failure
        # User code may have replaced the clock.
        wall_time = max(0.0, time.perf_counter() - started)
        kept = footage.trace()
        assert kept is not None
        for transcript in (record for controls in self._all_controls for record in controls.transcripts):
            digest.add_transcript(transcript, panel.time)
        audited = self._audited(panel, begin, motion, kept, placed)
        findings = (*audited, *self._source_findings(), *self._missed_events(panel))
        # Before the verdicts: for these the run may go on.
        notes = self._notes_of_end(panel, {finding.message for finding in findings})
        return SimulationRun(
            trace=kept,
            verdicts=self._verdicts(panel, start, progress),
            end=panel.end or "controllers finished",
            digest=digest.hexdigest(),
            travelled=float(kept.planar_distance_to(*start.pose.position_xyz[:2])[-1]),
            wall_time=wall_time,
            engine=self._backend.version,
            notes=notes,
            findings=findings,
            events={} if self._events is None else self._events.times(panel.time),
        )

    def _verdicts(self, panel: Panel, start: Observation, progress: Progress) -> tuple[Verdict, ...]:
        """Return the verdicts of a run that has ended; with their extreme margins if the run looks ahead."""
        verdicts = tuple(map(self._explained, panel.verdicts(), self._scenario.expect, repeat(panel.time)))
        if not self._seams.looks_ahead:
            return verdicts
        if panel.end == "goals met":
            # An error after the end has no part in the verdict.
            self._advance(_AHEAD * panel.time, progress)
        ahead = Trace.concatenate([moments for moments in self._moments if len(moments)])
        seen = ahead.between(-math.inf, panel.time)
        return tuple(
            verdict.with_extreme(expected.signals(self._scene, start, ahead if verdict.goal else seen))
            for verdict, expected in zip(verdicts, self._scenario.expect, strict=True)
        )

    def _end_footage(self, end: float) -> None:
        self._footage.marks = self._marks(end)
        if self._actors:
            self._footage.actors = self._actors.film(end)

    def _marks(self, end: float) -> tuple[TimeMark, ...]:
        """Return the marks of the timeline of the run until a sim time in s."""
        of_actors = self._actors.time_marks(end) if self._actors else ()
        own = (*self._scenario.time_marks(), *self._controls.time_marks(end), *self._sensing.time_marks(), *of_actors)
        if self._events is not None:
            own = (*self._events.time_marks(end), *own)
        trace = self._footage.trace() if self._scene.world.patches else None
        return in_order((*own, *(() if trace is None else reached_patches(self._scene, trace))), end)

    def _explained(self, verdict: Verdict, expected: Expectation, end: float) -> Verdict:
        """Return a verdict whose message names what may have decided it: steps of targets, or marks until `end` s."""
        causes = [*self._decisive_step(verdict, expected.assertion.step_memory_s)]
        if not verdict.passed and not verdict.cut_off:
            decided = end if verdict.goal or verdict.time is None else verdict.time
            causes += [mark.title for mark in nearest_causes(self._footage.marks, decided)]
        return replace(verdict, message="; ".join((verdict.message, *causes))) if causes else verdict

    def _decisive_step(self, verdict: Verdict, memory: float) -> Iterator[str]:
        """Yield the last step of a target within a time in s before the decision."""
        # A step of a target decides no position.
        if not memory or verdict.time is None or verdict.unit in _POSITION_UNITS:
            return
        steps = self._controls.steps
        # A sum over all joints is about none of them.
        joints = [verdict.joint] if verdict.joint else sorted(steps)
        causes = [(step, joint) for joint in joints for step in steps.get(joint, ())]
        if within := [
            cause for cause in causes if cause[0].end >= verdict.time - memory and cause[0].start <= verdict.time
        ]:
            step, joint = max(within)
            yield f"{step.title(joint)} adds to it"

    def _audited(
        self, panel: Panel, begin: Beginning, motion: Motion, kept: Trace, placed: FloatArray
    ) -> tuple[ClaimFinding, ...]:
        """Return the findings of the audit; none if a broken expectation ended the run early."""
        if panel.end == "expectation failed":
            return ()
        unmet = [monitor.unmet_premises for monitor in panel.monitors]
        undelivered = self._controls.undelivered(panel.time)
        why_silent = self._controls.why_silent() if self._controls.log.are_zero else ""
        moved = bool(np.abs(self._placed_bodies()[:, :3] - placed[:, :3]).max(initial=0.0) > MOVED_M)
        facts = RunFacts(
            *(panel.time, motion, self._controls.log, kept, unmet, panel.verdicts(), panel.monitors, begin),
            *(moved, undelivered, why_silent),
        )
        findings = audit_run(self._scenario, self._scene, facts)
        return tuple(finding for finding in findings if not self._scenario.accepts(finding))

    def _source_findings(self) -> Iterator[ClaimFinding]:
        """Yield what command sources lost, what may make another run differ, and what programs logged."""
        places = [(), *(("world", "actors", index) for index in range(len(self._all_controls) - 1))]
        findings = [
            ClaimFinding(rule, (*place, "commands"), message)
            for place, controls in zip(places, self._all_controls, strict=True)
            for rule, message in controls.findings
        ]
        order = (NOT_SIMULATED, NOT_REPRODUCIBLE, LOGGED_ERROR)
        for finding in sorted(findings, key=lambda finding: order.index(finding.rule)):
            # The source itself decides which losses are allowed.
            if finding.rule == NOT_SIMULATED or not self._scenario.accepts(finding):
                yield finding

    def _open_events(self, start: Observation, opening: Trace) -> None:
        if self._scenario.events:
            from sim_action.simulation.events import RunEvents  # few scenarios have events

            self._events = RunEvents(self._scenario, self._scene, start, opening)

    def _after_events(self, panel: Panel) -> Panel:
        """Return the panel after what happened in the last period."""
        return panel if self._events is None else panel.following(self._scenario, self._events.end)

    def _without_later_events(self, panel: Panel) -> Panel:
        """Forget events after the end of the run, as far as the last period went on after it; return the panel."""
        if self._events is None or panel.end is None:
            return panel
        self._scenario = self._footage.scenario = self._events.scenario_until(panel.time)
        self._scene = replace(self._scene, world=self._scenario.world)
        return self._after_events(panel)

    def _missed_events(self, panel: Panel) -> Iterator[ClaimFinding]:
        if self._events is not None and panel.end != "expectation failed":
            for finding in self._events.findings(panel.time):
                if not self._scenario.accepts(finding):
                    yield finding

    def _notes_of_end(self, panel: Panel, reported: Collection[str]) -> tuple[str, ...]:
        """Return notes on the whole run, without the messages that findings have `reported`."""
        missed = (message for _, message in unreached_events(self._scenario, panel.time))
        of_guards = (note for guard in self._guards for note in guard.notes(panel.time))
        of_end = () if self._events is None else self._events.note_of_end(panel)
        return (*(message for message in missed if message not in reported), *of_guards, *of_end)

    def _all_notes(self, end: float) -> tuple[str, ...]:
        of_drive = self._motion.notes if self._motion else ()
        return (*self._notes, *self._seams.notes, *of_drive, *self._controls.notes(end), *self._sensing.notes)

    @property
    def _all_controls(self) -> tuple[Controls, ...]:
        return (self._controls, *(self._actors.controls if self._actors else ()))

    def _settle(self) -> None:
        """Let all robots come to rest before t = 0, with braked wheels and held joints."""
        limit = self._scenario.physics.settle
        remaining, period = self._scenario.steps(limit), self._scenario.steps(_SETTLE_PERIOD_S)
        brake = [self._controls.at_rest]
        if self._actors:
            brake = [replace(brake[0], actors=self._actors.at_rest)]
        speed = 0.0
        while remaining > 0:
            steps = min(period, remaining)
            self._backend.advance(-remaining, padded(brake, steps))
            remaining -= steps
            trace, failure = self._watchdog.watch(self._backend.collect())
            self._backend.collect_bodies()
            others = self._actors.settled() if self._actors else 0.0
            if failure is not None:
                raise failure
            speed = max(last_speed(trace), others)
            if speed < _REST_SPEED:
                return
        if limit:
            who = "not all robots were" if self._actors else "the robot was not"
            self._notes.append(f"{who} at rest after {limit:g} s of settling: {speed:.2g} m/s or rad/s at t = 0")

    def _advance(self, period: float, progress: Progress) -> tuple[Trace, RunError | None]:
        """Return the moments of the next period in s, and the error that ended it early."""
        end, rate = min(self._last_step, self._step + max(1, self._scenario.steps(period))), self._scenario.physics.rate
        failure: RunError | None = None
        has_faults = bool(self._scenario.faults)
        try:
            while self._step < end:
                until = end
                if self._events is not None:
                    until = self._events_until(self._events, end)
                    end = min(end, self._last_step)
                self._sensing.read(self._step)
                until = self._arrivals.next(self._step, self._sensing.next_tick(self._step, until))
                until = self._seams.until(self._step, until) if has_faults else until
                until = self._actors.plan(self._step, until) if self._actors else until
                planned = self._controls.plan(self._step, until, self._sensing.look)
                if has_faults:
                    planned = self._seams.targets(self._step, planned, self._sensing.look)
                if self._actors:
                    planned = self._actors.added_to(planned, self._step)
                self._backend.advance(self._step, planned)
                self._step += len(planned)
                self._arrivals.refuse_blocked(self._step, rate, self._backend)
                progress(self._step / rate)
        except RunError as error:
            failure = error
        trace = self._collected()
        if self._events is not None:
            self._events.judge(trace)
            trace = Trace.concatenate((*self._seen, trace))
            self._seen = []
        if self._scene.world.objects:
            self._body_poses = self._backend.collect_bodies()
        for guard in self._guards:
            trace, missed = guard.watch(trace, NO_BODIES if self._body_poses is None else self._body_poses)
            # A later guard sees only the moments that the earlier ones have left: its error comes first.
            failure = missed or failure
        if self._seams.looks_ahead:
            self._moments.append(trace)
        return trace, failure

    def _collected(self) -> Trace:
        """Return the moments since the last call, with the readings of sensors."""
        trace = self._backend.collect()
        readings = self._sensing.collect()
        trace = self._actors.seen_with(trace) if self._actors else trace
        return replace(trace, sensors=readings) if readings else trace

    def _events_until(self, events: RunEvents, end: int) -> int:
        """Let due events happen from the next step on; return the step up to which the run may go on."""
        for index in self._switching:
            self._controls.switch(self._scenario.events[index], self._step)
            if self._actors:
                self._actors.switch(index, self._step)
        self._switching = []
        if events.watches and self._step:
            self._seen.append(self._collected())
            events.judge(self._seen[-1])
        happening = events.happening(self._step)
        if not happening:
            return min(end, events.next_due(self._step, end))
        step, rate = self._step + 1, self._scenario.physics.rate
        self._scenario = self._footage.scenario = events.scenario
        self._scene = replace(self._scene, world=self._scenario.world)
        self._backend.follow(self._scene.world, step / rate)
        self._seams.follow(self._scenario.faults)
        for guard in self._guards:
            guard.follow(self._scene)
        self._switching = happening
        actions = (action for index in happening for action in self._scenario.events[index].actions)
        self._arrivals.add(step, [action.appear for action in actions if action.appear])
        if not waits(events.end):
            self._last_step = min(self._last_step, self._scenario.steps(events.end))
        return step

    def _placed_bodies(self) -> FloatArray:
        bodies = self._scene.world.objects
        poses = [self._backend.body_pose(body.name) for body in bodies if body.mass is not None]
        return np.array([(*pose.position_xyz, *pose.orientation_xyzw) for pose in poses]).reshape(-1, 7)

    def _first_moment(self, start: Observation) -> Trace:
        """Return the moment at t = 0 as monitors see it: invariants are judged from there on."""
        contacts = tuple(contact for contact in start.contacts if self._judged.ground or contact.body != GROUND)
        objects = {name: self._first_pose(name) for name in sorted(self._judged.objects)}
        touches = self._backend.link_contacts(0) if self._judged.link_contacts else {}
        self._moments = [
            replace(Trace.of_observation(start), contacts=contacts, objects=objects, link_contacts=touches)
        ]
        return self._moments[0]

    def _first_pose(self, body: str) -> BodyRecord:
        if (frame := self._scene.frames.get(body)) is None:
            pose = self._backend.body_pose(body)
        else:
            robot, link = frame
            pose = self._backend.actors[robot].link_pose(link)
        record = BodyRecord(np.zeros(1), np.array([pose.position_xyz]), np.array([pose.orientation_xyzw]))
        first, _ = presences(self._scene.world, self._scene.physics.rate).get(body, (0.0, 0.0))
        return record.within(first)

    def _guards_from(self, start: Observation, placed: FloatArray) -> Iterator[Guard]:
        """Yield the guards of a run that starts with this observation and these poses of bodies."""
        scene, objects = self._scene, self._scene.world.objects
        if objects or self._actors:
            from sim_action.simulation.tunnelling import Tunnelling  # an empty world does without it

            tunnelling = Tunnelling(scene, start, placed, solid_terrain=self._backend.solid_terrain)
            yield tunnelling
            if self._actors:
                self._actors.begin(placed, tunnelling)
                yield self._actors
        is_crossed = any(body.path for body in objects)
        if is_crossed:
            # Few worlds have bodies on paths.
            from sim_action.simulation.bodies_on_paths import Crossings, Pinning

            yield Pinning(scene, start.twist.linear_xyz)
        yield AccuracyWatch(scene, self._drive, self._springs)
        if is_crossed:
            yield Crossings(scene)
