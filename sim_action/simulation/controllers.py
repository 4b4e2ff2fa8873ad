"""The controllers of all command sources: each runs at its own rate, and each joint obeys one of them."""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from copy import deepcopy
from functools import lru_cache
from itertools import chain, repeat
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from sim_action.commands import ClosedLoop, CommandSource, Controller, OpenLoop
from sim_action.core import units
from sim_action.core.errors import BadSource, ScriptError, SourceProblem
from sim_action.core.geometry import Twist
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.drives import DriveMotion
from sim_action.scenario.model import Scenario
from sim_action.scenario.mutation import UNTOUCHED, Seams
from sim_action.sensors import MountedSensor
from sim_action.simulation.run_audit import CommandLog
from sim_action.state.command import Answer, Command, JointTargets, LinkWrench, commands_of, without_joints
from sim_action.state.observation import Observation
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Transcript
from sim_action.state.transmission import Line
from sim_action.world.claims import LOGGED_ERROR, NOT_REPRODUCIBLE, NOT_SIMULATED
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.scenario.events import Event
    from sim_action.state.joint_motion import JointMotion

Look = Callable[[int], Observation]  # returns the observation of the present step; called only if a controller needs it
CommandListener = Callable[[float, Command], None]  # receives every command, with the sim time in s
NO_WHEELS: Final = "a controller sent a twist, but the wheels of the robot are unknown; name them in robot.drive"
_RECORDED_HZ: Final = 40.0  # recordings hold the targets of motions at about this rate

# A change of a target is a step from this on, in rad or m, or per s: smaller ones are rounding of logs.
_LEAST_STEP: Final = 1e-3

TWO_WAYS: Final = "a controller sent, at the same tick, a twist and a target for joint"


@dataclass(frozen=True, slots=True)
class _Source:
    """A command source during the run."""

    index: int  # its index in `commands:`
    controller: Controller
    period: int  # physics steps between two ticks
    # its commands that are on their way; None if all take effect at once
    line: Line[tuple[int, tuple[Twist | JointTargets, ...]]] | None = None
    moved: set[str] = field(default_factory=set)  # the joints that it has commanded so far
    # link -> the wrenches on it that are in effect
    wrenches: dict[str, tuple[LinkWrench, ...]] = field(default_factory=dict)
    due: Sequence[int] | None = None  # the rising physics steps at which its controller is called; None: at every tick
    origin: int = 0  # the physics step at which it starts, from which its ticks count
    # joint -> "position", "velocity" or "effort": what it commanded last; kept if events may stop it
    kinds: dict[str, str] = field(default_factory=dict)

    @property
    def zero(self) -> int:
        """The physics step from which the times of its motions count."""
        return self.origin if isinstance(self.controller, OpenLoop) or self.controller.is_timed else 0


def _until_due(source: _Source, step: int) -> int:
    due, step = source.due or (), step - source.origin
    following = bisect_right(due, step)
    return due[following] - step if following < len(due) else sys.maxsize


class _Followed(NamedTuple):
    """A motion with its delay in s, and the sim time in s until which it is known."""

    motion: JointMotion
    delay_s: float
    until_s: float


class TargetStep(NamedTuple):
    """A step of a target of the kind position or velocity: its start and end in s, which rows of a log may part."""

    start: float
    end: float
    kind: str

    def title(self, joint: str) -> str:
        """Return what happened to the target of a joint."""
        if self.end > self.start:
            rows = f"between two rows, {self.start:.2f} s to {self.end:.2f} s,"
            return f"a jump of the {self.kind} target of '{joint}' {rows}"
        return f"a step of the {self.kind} target of '{joint}' at {self.start:.2f} s"


class _Motions:
    """Motions of position targets; `active`: motions that have not ended; `steps`: joint -> steps of its targets."""

    def __init__(self, beginnings: Mapping[str, float], rate: float, on_command: CommandListener) -> None:
        """`beginnings`: the positions in rad (or m) of the joints at t = 0."""
        self.steps: dict[str, list[TargetStep]] = {}
        # Joint -> its last velocity target without a position.
        self._velocities: dict[str, float] = {}
        self._rate, self._on_command, self._command_stride = rate, on_command, max(1, round(rate / _RECORDED_HZ))
        self.active: list[_Followed] = []
        # Joint -> its last position target, the velocity of this target, and its physics step.
        self._last = {name: (position, 0.0, 0) for name, position in beginnings.items()}

    def take(self, command: JointTargets, step: int, *, sent: int, until: float) -> None:
        """Let joints follow the motions of a command, from a physics step on, and let its other joints leave theirs."""
        if self.active:
            active = [followed.motion for followed in self.active]
            if until == math.inf and command.motions and all(map(active.__contains__, command.motions)):
                return
            self.leave(set(command.names()))
        delay = (step - sent) / self._rate
        self.active += [_Followed(motion, delay, until) for motion in command.motions]
        for motion in command.motions:
            for name, curve in zip(motion.names, motion.curves, strict=True):
                for start, end in curve.sudden:
                    self.steps.setdefault(name, []).append(TargetStep(start + delay, end + delay, "position"))
        for name, position in command.position.items():
            self._note_step(name, position, command.velocity.get(name, 0.0), step)
        for name, velocity in command.velocity.items():
            if name not in command.position and abs(velocity - self._velocities.get(name, 0.0)) > _LEAST_STEP:
                self._velocities[name] = velocity
                self._add_step(name, step, "velocity")

    def drive(self, rows: Sequence[JointTargets], step: int, *, steps_speed: bool) -> None:
        """Note steps of the angles, and if asked of the speeds, in the targets of a drive from a physics step on."""
        for at, row in enumerate(rows, start=step):
            for name, position in row.position.items():
                before, _, when = self._last.get(name, (position, 0.0, at))
                self._note_step(name, position, (position - before) * self._rate / max(1, at - when), at)
            for name, velocity in row.velocity.items() if steps_speed else ():
                if abs(velocity - self._velocities.get(name, 0.0)) > _LEAST_STEP:
                    self._velocities[name] = velocity
                    self._add_step(name, at, "velocity")

    def rows(self, step: int, steps: int) -> list[JointTargets]:
        """Return the targets of the following steps, along the active motions."""
        moments = np.arange(step, step + steps + 1) / self._rate
        names: list[str] = []
        tables: list[tuple[FloatArray, FloatArray]] = []
        for motion, delay, until in self.active:
            *table, stepped = motion.targets(np.minimum(moments, until) - delay, 1 / self._rate)
            for row, column in np.argwhere(stepped).tolist():
                self._add_step(motion.names[column], step + row, "position")
            names += motion.names
            tables.append((table[0], table[1]))
        positions, velocities = (np.hstack(group).tolist() for group in zip(*tables, strict=True))
        for name, position, velocity in zip(names, positions[0], velocities[0], strict=True):
            self._note_step(name, position, velocity, step)
        for name, position, velocity in zip(names, positions[-1], velocities[-1], strict=True):
            self._last[name] = position, velocity, step + steps - 1
        # Without calls for each joint: this is done at every physics step.
        rows = [
            JointTargets(dict(zip(names, position, strict=True)), dict(zip(names, velocity, strict=True)))
            for position, velocity in zip(positions, velocities, strict=True)
        ]
        for index in range(-step % self._command_stride, steps, self._command_stride):
            self._on_command((step + index) / self._rate, rows[index])
        start = step / self._rate
        self.active = [followed for followed in self.active if start - followed.delay_s < followed.motion.end]
        return rows

    def left(self, names: Collection[str]) -> dict[str, float]:
        """Let joints leave their motions, and return their last position targets."""
        self.leave(set(names))
        return {name: self._last[name][0] for name in names}

    def leave(self, names: Collection[str]) -> None:
        """Let joints leave their motions."""
        self.active = [
            followed._replace(motion=motion)
            for followed in self.active
            for motion in without_joints((followed.motion,), names)
        ]

    def _note_step(self, name: str, position: float, velocity: float, step: int) -> None:
        """Keep the position target of a joint, and note if it is a step."""
        before, speed, when = self._last.get(name, (position, 0.0, step))
        if abs(position - before - speed * (step - when) / self._rate) > _LEAST_STEP:
            self._add_step(name, step, "position")
        self._last[name] = position, velocity, step

    def _add_step(self, name: str, step: int, kind: str) -> None:
        self.steps.setdefault(name, []).append(TargetStep(step / self._rate, step / self._rate, kind))


class Controls:
    """The open command sources of a scenario, and the drive that turns their twists into joint targets.

    `log`: the facts about their commands so far.
    """

    def __init__(
        self,
        scenario: Scenario,
        scene: Scene,
        motion: DriveMotion | None,
        on_command: CommandListener = lambda _time, _command: None,
        seams: Seams = UNTOUCHED,
    ) -> None:
        """Open the sources. Raise ScriptError after closing the open ones."""
        self.log = CommandLog(scene.joint_positions, motion.joints if motion else frozenset())
        self._rate = scenario.physics.rate
        self._on_command = on_command
        self._seams = seams
        self._motion = motion
        self._motions = _Motions(scene.joint_positions, self._rate, on_command)
        self._steps_wheels = scene.mobility.acceleration > GRAVITY
        self._twist: Twist | None = None
        # The twist that the wheels have reached; they keep their targets.
        self._reached: tuple[float, ...] = ()
        self._owners: dict[str, _Source] = {}
        self._driver: _Source | None = None
        codes = [source.code for source in scenario.commands]
        scenes = [replace(scene, namesake=codes[:index].count(code)) for index, code in enumerate(codes)]
        with ExitStack() as closing:
            self._sources = [
                _source(index, source, seams.controller(_opened(index, source, seen, closing)), scenario, scene)
                for index, (source, seen) in enumerate(zip(scenario.commands, scenes, strict=True))
            ]
            self._closing = closing.pop_all()
        self._late = [(source, source.line) for source in self._sources if source.line is not None]
        self._has_events = bool(scenario.events)
        waiting = {place for event in scenario.events for place in event.starts}
        # The sources that no event has stopped, and that no event is still to start.
        self._active = [source for source in self._sources if source.index not in waiting]
        self._halt: JointTargets | None = None
        self._specs, self._past_marks = scenario.commands, list[TimeMark]()
        self._look_together = len(self._closed) > 1

    @property
    def are_watching(self) -> bool:
        """True if any controller reads sensors."""
        return any(live.senses for live in self._closed)

    @property
    def _closed(self) -> list[ClosedLoop]:
        return [source.controller for source in self._sources if isinstance(source.controller, ClosedLoop)]

    @property
    def sensors(self) -> tuple[MountedSensor, ...]:
        """The sensors that the controllers add to the scenario."""
        return tuple(mounted for live in self._closed for mounted in live.sensors)

    @property
    def steps(self) -> Mapping[str, Sequence[TargetStep]]:
        """Joint -> the steps of its target."""
        return self._motions.steps

    @property
    def at_rest(self) -> JointTargets:
        """The targets that hold the robot while it settles before t = 0: wheels braked, joints held."""
        targets = self._motion.targets(Twist(), 1)[0] if self._motion else JointTargets()
        for source in self._sources:
            if isinstance(source.controller, OpenLoop):
                targets = targets.updated_by(source.controller.holding)
        return self._seams.at_rest(targets)

    def notes(self, end: float) -> tuple[str, ...]:
        """Return the notes of the controllers for people, after a run that ended at a sim time in s."""
        lossy = ((source.index, line) for source, line in self._late if line.lost)
        lost = (f"{line.lost} of {line.sent} commands of commands[{index}] were lost" for index, line in lossy)
        controllers = [source.controller for source in self._sources]
        own = (live.notes(end) if isinstance(live, OpenLoop) else live.notes for live in controllers)
        return (*chain.from_iterable(own), *lost)

    def time_marks(self, end: float) -> Iterator[TimeMark]:
        """Yield the marks of the sources until a sim time in s, and of the first commands that were lost."""
        yield from self._past_marks
        for source in self._active:
            yield from self._marks(source, end)
        for source, line in self._late:
            yield from line.time_marks(f"commands[{source.index}]")

    def _marks(self, source: _Source, end: float) -> Iterator[TimeMark]:
        spec, name = self._specs[source.index], f"commands[{source.index}]"
        return spec.marks_between(source.controller, name, source.origin / self._rate, end)

    def undelivered(self, end: float) -> dict[int, float]:
        """Return the index of each source without a command before a sim time in s -> the first arrival, or inf."""
        last = end * self._rate - units.STEP_EPSILON
        late = ((source, line) for source, line in self._late if line.first_sent < last <= line.first_arrival)
        return {source.index: line.first_arrival / self._rate for source, line in late}

    @property
    def findings(self) -> Iterator[tuple[str, str]]:
        """The parts of files that were not run, why another run may differ, and logged errors: rules and messages."""
        for live in self._closed:
            yield from ((NOT_SIMULATED, loss) for loss in live.losses)
            yield from ((NOT_REPRODUCIBLE, f"the run is not reproducible: {why}") for why in live.not_reproducible)
            yield from ((LOGGED_ERROR, message) for message in live.logged_errors)

    @property
    def transcripts(self) -> tuple[Transcript, ...]:
        """The messages that controllers received from programs of the user."""
        return tuple(live.transcript for live in self._closed if live.transcript is not None)

    def why_silent(self) -> str:
        """Return why controllers have given no command, as far as they know."""
        return "; ".join(why for live in self._closed if (why := live.why_silent()))

    def close(self) -> None:
        """Close the sources after the run, and end the programs that they started."""
        self._closing.close()

    def switch(self, event: Event, step: int) -> None:
        """Let the sources that an event starts or stops do so at a physics step."""
        for action, place in zip(event.actions, event.places, strict=True):
            if place is None or not (action.start or action.stop):
                continue
            # Keep the marks of a source that an event ends at a physics step.
            end = step / self._rate
            for source in self._active:
                for mark in self._marks(source, end) if source.index == place else ():
                    if mark.time < end:
                        self._past_marks.append(replace(mark, until=min(end, mark.until or end)))
            if action.start:
                # A source that is at work begins again.
                self._motions.leave(self._sources[place].moved)
                if isinstance(controller := self._sources[place].controller, ClosedLoop):
                    controller.begin()
                others = [source for source in self._active if source.index != place]
                source = replace(self._sources[place], origin=step)
                self._active = sorted((*others, source), key=lambda source: source.index)
            else:
                self._stop(place)

    def _stop(self, index: int) -> None:
        """Let a source end: what it commanded stops, and others may move its joints."""
        source = next((source for source in self._active if source.index == index), None)
        if source is None:
            return
        self._active.remove(source)
        if source.line is not None:
            source.line.drop()
        joints = set(source.moved)
        if self._driver is not None and self._driver.index == index and self._motion is not None:
            self._driver, self._twist, self._reached = None, Twist(), ()
            joints -= self._motion.joints
        for joint in source.moved:
            self._owners.pop(joint, None)
        source.moved.clear()
        kinds = {name: source.kinds[name] for name in sorted(joints) if name in source.kinds}
        held = self._motions.left([name for name, kind in kinds.items() if kind == "position"])
        turning, pressed = ({name: 0.0 for name in kinds if kinds[name] == kind} for kind in ("velocity", "effort"))
        presses = bool(source.wrenches)
        source.wrenches.clear()
        halt = JointTargets(held, turning, pressed, wrenches=self._pressed(source, ()) if presses else None)
        self._halt = halt if self._halt is None else self._halt.updated_by(halt)

    def plan(self, step: int, end: int, look: Look) -> list[JointTargets | None]:
        """Return the targets until the next tick, late command, or `end`; None keeps the last. Raise ScriptError."""
        asked = self._ask(step, look)
        if self._halt is not None:
            asked, self._halt = self._halt if asked is None else self._halt.updated_by(asked), None
        steps = end - step
        for source in self._active:
            # Without a call, because this is done at every tick of every run.
            period, since = source.period, step - source.origin
            steps = min(steps, period - since % period if source.due is None else _until_due(source, step))
        if self._late:
            lines = [source.line for source in self._active if source.line is not None]
            steps = int(min([steps, *(line.next_step - step for line in lines)]))
        planned = self._driven(step, steps)
        if self._motions.active and (followed := self._motions.rows(step, steps)):
            pairs = zip(followed, planned, strict=False)
            planned = [*(row.updated_by(wheels) for row, wheels in pairs), *followed[len(planned) :]]
        if asked is not None:
            planned = [asked.updated_by(planned[0]) if planned else asked, *planned[1:]]
        return padded(planned, steps)

    def _driven(self, step: int, steps: int) -> list[JointTargets]:
        """Return the wheel targets of the present twist; nothing after the wheels have reached it."""
        if self._motion is None or self._twist is None:
            return []
        # A copy: a script may change the vectors of its twist later.
        twist = (*self._twist.linear_xyz, *self._twist.angular_xyz)
        if twist == self._reached:
            return []
        planned = self._motion.targets(self._twist, steps)
        # Wheels cannot grip when they speed up faster than they would fall: such a ramp is a step.
        if self._steps_wheels or planned[0].position:
            self._motions.drive(planned, step, steps_speed=self._steps_wheels)
        self._reached = twist if len(planned) < steps else ()
        return planned

    def _ask(self, step: int, look: Look) -> JointTargets | None:
        """Apply the commands of this step, and return the joint targets among them."""
        targets: JointTargets | None = None
        look_once = lru_cache(maxsize=1)(look) if self._look_together else look
        for source in self._active:
            since = step - source.origin
            is_due = since % source.period == 0 if source.due is None else _until_due(source, step - 1) == 1
            if not is_due and (source.line is None or source.line.next_step > step):
                continue
            try:
                for sent, command in self._commands(source, step, look_once, is_due=is_due):
                    targets = self._taken(source, command, targets, step=step, sent=sent)
                    applied = command
                    if targets is not None and isinstance(command, JointTargets) and command.wrenches is not None:
                        applied = replace(command, wrenches=targets.wrenches)
                    self._on_command(step / self._rate, applied)
            except ScriptError as error:
                error.source, error.time = source.index, step / self._rate
                raise
        return targets

    def _taken(
        self, source: _Source, command: Twist | JointTargets, targets: JointTargets | None, *, step: int, sent: int
    ) -> JointTargets | None:
        """Apply a command, and return the joint targets of this tick so far."""
        self.log.add(command)
        if not isinstance(command, JointTargets):
            if self._motion is None:
                raise ScriptError(NO_WHEELS)
            driver = self._driver = self._driver or source
            if driver.index != source.index:
                raise _both(driver, source, "drive the base; only one command source can do so")
            self._claim(source, self._motion.joints)
            self._twist = command
            return targets
        self._claim(source, set(command.names()))
        if self._has_events:
            source.kinds.update(command.kinds)
        # What arrives late, or not at all, is known until the next tick only.
        is_sampled = source.line is not None and isinstance(source.controller, OpenLoop)
        until = (step + source.period) / self._rate if is_sampled else math.inf
        self._motions.take(command, step, sent=sent - source.zero, until=until)
        if command.wrenches is not None:
            command = replace(command, wrenches=self._pressed(source, command.wrenches))
        targets = targets.updated_by(command) if targets else command
        if self._motion and not self._motion.joints.isdisjoint(command.names()):
            # A source that commands the wheel joints takes them over from the drive.
            targets, self._twist, self._reached = self._motion.released.updated_by(targets), None, ()
        return targets

    def _pressed(self, source: _Source, wrenches: tuple[LinkWrench, ...]) -> tuple[LinkWrench, ...]:
        for link in dict.fromkeys(wrench.link for wrench in wrenches):
            source.wrenches[link] = tuple(wrench for wrench in wrenches if wrench.link == link)
        return tuple(
            link_wrench for source in self._sources for held in source.wrenches.values() for link_wrench in held
        )

    def _commands(
        self, source: _Source, step: int, look: Look, *, is_due: bool
    ) -> Iterable[tuple[int, Twist | JointTargets]]:
        """Return the commands that take effect at this step, with the step at which the source sent them."""
        asked = self._asked(source, step, look) if is_due else ()
        if source.line is None:
            return zip(repeat(step), asked)
        if asked:
            # A script may change its command later.
            source.line.send(step, (step, deepcopy(asked)))
        return [(sent, command) for sent, commands in source.line.arrived(step) for command in commands]

    def _asked(self, source: _Source, step: int, look: Look) -> tuple[Twist | JointTargets, ...]:
        """Return the commands of a source at its tick; its wrenches are together in one JointTargets."""
        if isinstance(source.controller, OpenLoop):
            answer = source.controller.command((step - source.origin) / self._rate)
        else:
            seen = look(step)
            seen = replace(seen, time=seen.time - source.zero / self._rate) if source.zero else seen
            answer = source.controller.command(seen)
        if type(answer) is Twist:
            # Most ticks of a robot that drives.
            return (answer,)
        commands = _with_wrenches_together(commands_of(answer))
        self._refuse_two_ways(commands)
        return commands

    def _refuse_two_ways(self, commands: tuple[Command, ...]) -> None:
        """Raise ScriptError for a twist together with targets for the wheels that it turns."""
        # A single command cannot conflict.
        if self._motion is None or len(commands) < 2 or not any(isinstance(command, Twist) for command in commands):
            return
        named = {name for command in commands if isinstance(command, JointTargets) for name in command.names()}
        if wheels := self._motion.joints & named:
            raise ScriptError(f"{TWO_WAYS} '{min(wheels)}', which the drive moves; send only one of them")

    def _claim(self, source: _Source, joints: set[str] | frozenset[str]) -> None:
        """Assign the joints to the source. Raise ScriptError if another source moves one of them."""
        if source.moved.issuperset(joints):
            return
        for joint in sorted(joints):
            owner = self._owners.setdefault(joint, source)
            if owner.index != source.index:
                raise _both(owner, source, f"move joint '{joint}'; command sources must move different joints")
        source.moved.update(joints)


def _both(one: _Source, other: _Source, what: str) -> ScriptError:
    first, second = sorted((one.index, other.index))
    return ScriptError(f"commands.{first} and commands.{second} both {what}")


def _with_wrenches_together(commands: tuple[Command, ...]) -> tuple[Twist | JointTargets, ...]:
    if len(commands) == 1 and not isinstance(commands[0], LinkWrench):
        return (commands[0],)
    others = tuple(command for command in commands if not isinstance(command, LinkWrench))
    if len(others) == len(commands):
        return others
    wrenches = tuple(command for command in commands if isinstance(command, LinkWrench))
    return (*others, JointTargets(wrenches=wrenches))


def _source(index: int, spec: CommandSource, controller: Controller, scenario: Scenario, scene: Scene) -> _Source:
    period = scenario.steps_between_ticks(spec.tick_rate(scenario.physics.rate))
    if spec.is_perfect:
        return _Source(index, controller, period, due=controller.due if isinstance(controller, OpenLoop) else None)
    if isinstance(controller, ClosedLoop) and controller.repeats:
        controller = replace(controller, command=_without_repeats(controller.command))
    elif isinstance(controller, OpenLoop):
        repeats = bool(spec.dropouts and spec.is_written)
        controller = replace(controller, command=_with_repeats(controller.command, all_answers=repeats))
    random = scene.generator(f"transmission of commands[{index}]")
    return _Source(index, controller, period, Line(spec, scenario.physics.rate, random))


def _with_repeats(command: Callable[[Any], Answer], *, all_answers: bool) -> Callable[[Any], Answer]:
    """Return a controller that repeats a motion, or its last answer, instead of None, so that the end of it arrives."""
    last: Answer = None

    def kept(moment: Any) -> Answer:
        nonlocal last
        answer = command(moment)
        last = last if answer is None else answer
        return last if all_answers or (isinstance(last, JointTargets) and last.motions) else answer

    return kept


def _without_repeats(command: Callable[[Observation], Answer]) -> Callable[[Observation], Answer]:
    """Return a controller whose answer is None until there is a new command, so that each is sent once."""
    last: Answer = None

    def new(seen: Observation) -> Answer:
        nonlocal last
        before, last = last, command(seen)
        return None if last is before else last

    return new


def _opened(index: int, source: CommandSource, scene: Scene, closing: ExitStack) -> Controller:
    try:
        controller = source.open(scene)
    except SourceProblem as error:
        raise BadSource(index, error.key, str(error)) from None
    except ScriptError as error:
        error.source = index
        raise
    if isinstance(controller, ClosedLoop):
        closing.callback(controller.close)
    return controller


def padded(targets: list[JointTargets], steps: int) -> list[JointTargets | None]:
    """Return one entry per step; None keeps the last target."""
    return [*targets, *[None] * (steps - len(targets))]
