"""The audit of claims after a run: parts of the scenario that checked nothing, because they never came about.

The rules are in `world/claims.py`. Each assertion yields the findings about itself. A run that a broken expectation
ended has only notes on events that it missed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Final, NamedTuple, Self

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import MOVED_M, Rest, Window
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, field, replace
from sim_action.core.yaml_document import KeyPath
from sim_action.scenario.model import Expectation, Scenario
from sim_action.state.command import JointTargets
from sim_action.state.timeline import is_late
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import World
from sim_action.world.claims import IN_RANGE, ClaimFinding, JudgedRun, nothing_in_range
from sim_action.world.robot_reach import is_untouched
from sim_action.world.scene import Scene

_MIN_COMMAND: Final = 1e-6  # m/s, rad/s, N and N m: a smaller command keeps a robot at rest
_ROUNDING: Final = 1e-4  # in any unit: a robot that has settled differs from its start by less
_MIN_TARGET: Final = 2e-3  # rad and m: a position nearer to the start is no command to move
_SHORT_S: Final = 0.5  # s: a robot may not have moved yet when a shorter run ends


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of the robot since t = 0: True for its base, and for its joints, after they moved."""

    rest: Rest
    base: bool = False
    joints: bool = False

    def after(self, trace: Trace) -> Self:
        """Return the motion after the moments of `trace`."""
        if (self.base and self.joints) or not len(trace):
            return self
        base = self.base or bool(self.rest.base_moved(trace).any())
        return replace(self, base=base, joints=self.joints or bool(self.rest.joints_moved(trace).any()))


@dataclass(slots=True)
class CommandLog:
    """The commands of a run so far."""

    positions: dict[str, float]  # joint -> its position at the start, in rad or m
    wheels: frozenset[str]  # the joints of the drive
    drives: bool = False  # True if a twist or a target for a wheel was given
    moves_base: bool = False  # True if a twist was given that is not zero
    moves_joints: bool = False  # True if a joint got a velocity that is not zero, or a position away from its start
    efforts: dict[str, float] = field(default_factory=dict)  # joint -> the greatest effort that it got, in N m or N
    wrench: float = 0.0  # the greatest force in N, or torque in N m, that a link got
    fastest: float = 0.0  # the greatest linear speed of a twist, in m/s

    @property
    def are_zero(self) -> bool:
        """True if no command was other than zero."""
        return not (self.moves_base or self.moves_joints or _is_motion(self.wrench, *self.efforts.values()))

    def add(self, command: Twist | JointTargets) -> None:
        """Add a command."""
        if isinstance(command, Twist):
            self.drives = True
            self.fastest = max(self.fastest, math.hypot(*command.linear_xyz))
            self.moves_base = self.moves_base or _is_motion(*command.linear_xyz, *command.angular_xyz)
            return
        self.drives = self.drives or not self.wheels.isdisjoint(command.names())
        self.moves_joints = self.moves_joints or self._moves(command)
        for name, effort in command.effort.items():
            self.efforts[name] = max(self.efforts.get(name, 0.0), abs(effort))
        for wrench in command.wrenches or ():
            self.wrench = max(self.wrench, math.hypot(*wrench.force_xyz), math.hypot(*wrench.torque_xyz))

    def _moves(self, targets: JointTargets) -> bool:
        if _is_motion(*targets.velocity.values()):
            return True
        aims = (targets.position, *(extreme for motion in targets.motions for extreme in motion.extremes))
        return any(
            abs(at - self.positions.get(name, at)) > _MIN_TARGET for positions in aims for name, at in positions.items()
        )


def _is_motion(*values: float) -> bool:
    return any(abs(value) > _MIN_COMMAND for value in values)


class Beginning(NamedTuple):
    """One monitor for each expectation before the first moment, and the moments at t = 0 and after one step."""

    monitors: Sequence[Window]
    trace: Trace


@dataclass(frozen=True, eq=False)
class RunFacts:
    """The facts of a run that the rules need."""

    end: float  # sim time of the end, in s
    motion: Motion
    commands: CommandLog
    trace: Trace  # the stored trace of the run
    unmet: Sequence[Sequence[str]]  # for each expectation, the premises that never held
    verdicts: Sequence[Verdict]  # one verdict for each expectation
    monitors: Sequence[Window]  # one monitor for each expectation
    begin: Beginning
    bodies_moved: bool = False  # True if a body of the world moved
    # index of each command source whose commands all came too late -> when the first one was due, in s; infinite if all
    # were lost
    undelivered: Mapping[int, float] = field(default_factory=dict)
    why_silent: str = ""  # why controllers gave no command; empty if that is not known


def audit_run(scenario: Scenario, scene: Scene, facts: RunFacts) -> Iterator[ClaimFinding]:
    """Yield the findings of all rules about a run."""
    places = [("expect", index, expected.assertion.key) for index, expected in enumerate(scenario.expect)]
    for place, premises in zip(places, facts.unmet, strict=True):
        yield from (_unmet(premise).below(place) for premise in premises)
    standstills = list[ClaimFinding]()
    facts_of = zip(
        places, scenario.expect, facts.verdicts, facts.unmet, facts.monitors, facts.begin.monitors, strict=True
    )
    for place, expected, verdict, unmet, monitor, opened in facts_of:
        log, limit = facts.commands, scenario.time_limit
        run = JudgedRun(scene, facts.trace, verdict, bool(unmet), log.efforts, log.wrench, log.fastest, limit)
        for finding in (*_judged_once(scenario, expected, verdict, facts.end), *expected.assertion.run_claims(run)):
            yield finding.below(place)
        yield from (finding.below(place) for finding in _decided_at_start(expected, run, opened, facts.begin.trace))
        if verdict.status == "passed":
            yield from (finding.below(place[:2]) for finding in _of_parts(expected, run, monitor))
        if verdict.status == "passed":
            standstills += (finding.below(place) for finding in _standstills(expected.assertion, run))
    # All links before all objects.
    yield from sorted(standstills, key=lambda finding: finding.rule)
    yield from _untouched_patches(scenario, scene, facts)
    yield from _undelivered(facts)
    unused = [] if facts.undelivered else list(_unused_drive(scenario, scene, facts))
    yield from unused
    if not unused and facts.commands.are_zero and not facts.undelivered:
        yield from _nothing_drives(scenario, scene, facts)
    if (standstill := _never_moved(scene, facts)) is not None:
        yield ClaimFinding("never-moved", ("commands",), standstill)
    for path, message in unreached_events(scenario, facts.end):
        yield ClaimFinding("event-never-began", path, message)


def _unmet(premise: str) -> ClaimFinding:
    """Return the finding on a premise that never held."""
    if premise.endswith(IN_RANGE):
        return nothing_in_range(premise.removesuffix(IN_RANGE))
    message = f"the premise '{premise}' never held, so the implication checked nothing; drive until it holds"
    return ClaimFinding("premise-never-held", (), message)


def _of_parts(expected: Expectation, run: JudgedRun, window: Window) -> Iterator[ClaimFinding]:
    """Yield the findings of the parts of a combined assertion, each with its own verdict."""
    negated = list(expected.assertion.negated_leaves())
    for (place, leaf), monitor in zip(expected.assertion.placed_leaves(), window.leaves, strict=False):
        if leaf is not expected.assertion:
            verdict = replace(monitor.verdict().counted(window.steps), goal=leaf.is_goal)
            is_negated = any(leaf is other for other in negated)
            part = replace(run, verdict=verdict, is_part=True, is_negated=is_negated)
            yield from (finding.below(place) for finding in leaf.run_claims(part))


def _untouched_patches(scenario: Scenario, scene: Scene, facts: RunFacts) -> Iterator[ClaimFinding]:
    for index, patch in enumerate(() if facts.bodies_moved else scenario.world.patches):
        if is_untouched(scene, facts.trace, patch):
            message = "nothing was ever on this patch, so its friction had no effect; drive over it, or remove it"
            yield ClaimFinding("no-effect", ("world", "patches", index), message)


def _judged_once(scenario: Scenario, expected: Expectation, verdict: Verdict, end: float) -> Iterator[ClaimFinding]:
    """Yield an invariant that was judged at one moment, although its window and the run have more."""
    judged, step = verdict.judged, 1 / scenario.physics.rate
    if verdict.goal or expected.severity != "error" or not expected.assertion.is_over_time:
        return
    if judged is None or judged.moments != 1 or min(expected.before, end) < 2 * step:
        return
    if expected.before - expected.after >= 2 * step:
        message = f"was judged at one moment only, at {judged.first or 0.0:.2f} s; {expected.assertion.more_moments}"
        yield ClaimFinding("judged-once", (), message)


def _decided_at_start(expected: Expectation, run: JudgedRun, opened: Window, early: Trace) -> Iterator[ClaimFinding]:
    """Yield a formula, or a goal of the user's, that came true at the first moments, before anything moved."""
    if run.verdict.status != "passed" or (expected.assertion.is_over_time and not run.verdict.goal):
        return
    monitor = opened.observe(early).monitor
    margin = None if expected.assertion.is_over_time else monitor.verdict().margin
    nearly = margin is not None and margin > -_ROUNDING
    if monitor.is_decided if monitor.state is State.HOLDS else nearly and monitor.state is State.PENDING:
        message = "was already true at t = 0, before anything moved, and no later moment counts"
        use = "write 'always', an interval that begins later, or 'after'"
        yield ClaimFinding("judged-once", (), f"{message}; {use}")


def _standstills(assertion: Assertion, run: JudgedRun) -> Collection[ClaimFinding]:
    """Return the findings that what the assertion judges never moved: the first one of each rule."""
    findings = dict[str, ClaimFinding]()
    for leaf in assertion.leaves():
        if (finding := leaf.standstill(run)) is not None:
            findings.setdefault(finding.rule, finding)
    return findings.values()


def _undelivered(facts: RunFacts) -> Iterator[ClaimFinding]:
    for index, first in facts.undelivered.items():
        message = f"no command of commands[{index}] took effect"
        if math.isinf(first):
            reason = "all were lost; lower 'dropouts', or run for longer"
        else:
            due = f"the first one was due at {first:.4g} s, but the run ended at {facts.end:.4g} s"
            reason = f"{due}; lower 'latency', 'jitter' or 'dropouts', or run for longer"
        yield ClaimFinding("command-never-arrived", ("commands", index), f"{message}: {reason}")


def _unused_drive(scenario: Scenario, scene: Scene, facts: RunFacts) -> Iterator[ClaimFinding]:
    if facts.commands.drives or any(mounted.sensor.reads_wheels for mounted in scenario.sensors):
        return
    if scenario.robot.drive is not None:
        reason = facts.why_silent or "add a command source that gives twists, or remove robot.drive"
        yield ClaimFinding("drive-never-commanded", ("robot", "drive"), f"no command used the drive; {reason}")
    elif any(source.gives_twists(scene) for source in scenario.commands):
        message = "no command source ever gave a twist, so the drive was not used"
        yield ClaimFinding("drive-never-commanded", ("commands",), message)


def _nothing_drives(scenario: Scenario, scene: Scene, facts: RunFacts) -> Iterator[ClaimFinding]:
    """Yield controllers that gave no command, or else a run in which nothing acted, unless a robot at rest is asked."""
    leaves = scenario.assertions
    controllers = [source for source in scenario.commands if not source.is_written]
    if controllers and not any(leaf.limits_motion(scene) for leaf in leaves):
        who = "the controller" if len(controllers) == 1 else "the controllers"
        reason = facts.why_silent or "check that it started, or run for longer"
        message = f"{who} gave no command other than zero in the whole run; {reason}"
        yield ClaimFinding("silent-controller", ("commands",), message)
    world = scenario.world
    is_alone = (
        not world.disturbances
        and not facts.bodies_moved
        and not any(body.path or body.surface_velocity for body in world.objects)
        and not any(actor.commands for actor in world.actors)
    )
    moved = facts.motion.base or facts.motion.joints
    if not controllers and is_alone and not moved and not any(leaf.judges_rest(scene) for leaf in leaves):
        message = "nothing acted on the robot, and nothing moved: no command was other than zero"
        yield ClaimFinding("nothing-acts", ("commands",), f"{message}; add 'commands', or expect a robot at rest")


def _never_moved(scene: Scene, facts: RunFacts) -> str | None:
    """Return the problem of a robot that did not move although it was commanded to, else None."""
    commands, motion = facts.commands, facts.motion
    # A goal on a distance shorter than the least motion is met without it.
    goals = [verdict for verdict in facts.verdicts if verdict.passed and verdict.goal and verdict.unit == "m"]
    if any(verdict.limit is not None and verdict.limit < MOVED_M for verdict in goals):
        return None
    least = "by 1 mm or 0.1 deg"
    if commands.moves_base and not scene.bolted and not motion.base:
        message = (
            f"the robot was commanded to drive, but its base never moved {least}; check wheels, friction and limits"
        )
    elif (commands.moves_base or commands.moves_joints) and not motion.base and not motion.joints:
        message = f"the robot was commanded to move, but nothing moved {least}; check joints, limits and efforts"
    else:
        return None
    if facts.end >= _SHORT_S:
        return message
    met = ": its goals were met at once" if any(verdict.goal for verdict in facts.verdicts) else ""
    return f"the run ended at {facts.end:.2f} s, before the robot could move{met}; run for longer"


def unreached_events(scenario: Scenario, end: float) -> Iterator[tuple[KeyPath, str]]:
    """Yield the keys and a message of each event of the world and wrench that is due after the end of a run (in s)."""
    wrenches = (
        (("commands", index), f"the wrench of commands.{index} never began", source.begins[1])
        for index, source in enumerate(scenario.commands)
        if source.begins[1]
    )
    faults = (
        (("faults", index), f"faults[{index}] never began", fault.at) for index, fault in enumerate(scenario.faults)
    )
    for path, what, begins in (*_events(scenario.world), *wrenches, *faults):
        # An event that has not happened has a finding of its own.
        if is_late(begins, end):
            yield path, f"{what}: it is due at {begins:g} s, but the run ended at {end:.4g} s"


def _events(world: World) -> Iterator[tuple[KeyPath, str, float]]:
    for index, body in enumerate(world.objects):
        path: KeyPath = ("world", "objects", index)
        if body.appears is not None:
            yield (*path, "appears"), f"body '{body.name}' never appeared", body.appears
        if body.path and not body.pace:
            yield (*path, "path"), f"the path of body '{body.name}' never began", body.path[0].at
    for index, patch in enumerate(world.patches):
        if patch.appears is not None:
            yield ("world", "patches", index, "appears"), f"world.patches[{index}] never appeared", patch.appears
    for index, disturbance in enumerate(world.disturbances):
        yield ("world", "disturbances", index), f"world.disturbances[{index}] never began", disturbance.at
