"""The audit of claims after a run: parts of the scenario that checked nothing, because they never came about.

The rules are in `world/claims.py`. Each assertion yields the findings about itself. A run that a broken expectation
ended has only notes on events that it missed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Final, Self

from sim_action.assertions import Assertion
from sim_action.assertions.temporal_logic.becoming import Rest
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, field, replace
from sim_action.core.yaml_document import KeyPath
from sim_action.scenario.model import Expectation, Scenario
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import World
from sim_action.world.claims import ClaimFinding, JudgedRun
from sim_action.world.scene import Scene

# m/s, rad/s, N and N m: a smaller command is that of a robot at rest.
_MIN_COMMAND: Final = 1e-6
# rad and m: a position nearer to the start is no command to move.
_MIN_TARGET: Final = 2e-3
# s: a robot may not have moved yet when a shorter run ends.
_SHORT_S: Final = 0.5


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
    """The commands of a run so far.

    Attributes:
        positions: joint -> its position at the start, in rad or m.
        wheels: the joints of the drive.
        drives: True if a twist or a target for a wheel was given.
        moves_base: True if a twist was given that is not zero.
        moves_joints: True if a joint got a velocity that is not zero, or a position away from its start.
        gives_efforts: True if a joint got an effort that is not zero, or a link a wrench.
    """

    positions: dict[str, float]
    wheels: frozenset[str]
    drives: bool = False
    moves_base: bool = False
    moves_joints: bool = False
    gives_efforts: bool = False

    @property
    def are_zero(self) -> bool:
        """True if no command was other than zero."""
        return not (self.moves_base or self.moves_joints or self.gives_efforts)

    def add(self, command: Twist | JointTargets) -> None:
        """Add a command."""
        if isinstance(command, Twist):
            self.drives = True
            self.moves_base = self.moves_base or _is_motion(*command.linear_xyz, *command.angular_xyz)
            return
        self.drives = self.drives or not self.wheels.isdisjoint(command.names())
        self.moves_joints = self.moves_joints or self._moves(command)
        self.gives_efforts = self.gives_efforts or _is_motion(*command.effort.values())
        if command.wrenches:
            pressing = (number for each in command.wrenches for number in (*each.force_xyz, *each.torque_xyz))
            self.gives_efforts = self.gives_efforts or _is_motion(*pressing)

    def _moves(self, targets: JointTargets) -> bool:
        if _is_motion(*targets.velocity.values()):
            return True
        aims = (targets.position, *(extreme for motion in targets.motions for extreme in motion.extremes))
        return any(
            abs(at - self.positions.get(name, at)) > _MIN_TARGET for positions in aims for name, at in positions.items()
        )


def _is_motion(*values: float) -> bool:
    return any(abs(value) > _MIN_COMMAND for value in values)


@dataclass(frozen=True, eq=False)
class RunFacts:
    """The facts of a run that the rules need.

    Attributes:
        end: sim time of the end, in s.
        trace: the stored trace of the run.
        unmet: for each expectation, the premises that never held.
        verdicts: one verdict for each expectation.
        undelivered: index of each command source whose commands all came too late -> when the first one was due, in s;
            infinite if all were lost.
        why_silent: why controllers gave no command; empty if that is not known.
    """

    end: float
    motion: Motion
    commands: CommandLog
    trace: Trace
    unmet: Sequence[Sequence[str]]
    verdicts: Sequence[Verdict]
    undelivered: Mapping[int, float] = field(default_factory=dict)
    why_silent: str = ""


def audit_run(scenario: Scenario, scene: Scene, facts: RunFacts) -> Iterator[ClaimFinding]:
    """Yield the findings of all rules about a run."""
    places = [("expect", index, expected.assertion.key) for index, expected in enumerate(scenario.expect)]
    for place, premises in zip(places, facts.unmet, strict=True):
        for premise in premises:
            message = f"the premise '{premise}' never held, so the implication checked nothing; drive until it holds"
            yield ClaimFinding("premise-never-held", place, message)
    standstills = list[ClaimFinding]()
    for place, expected, verdict, unmet in zip(places, scenario.expect, facts.verdicts, facts.unmet, strict=True):
        run = JudgedRun(scene, facts.trace, verdict, bool(unmet), facts.commands.gives_efforts)
        for finding in (*_judged_once(scenario, expected, verdict, facts.end), *expected.assertion.run_claims(run)):
            yield finding.below(place)
        if verdict.status == "passed":
            standstills += (finding.below(place) for finding in _standstills(expected.assertion, run))
    # All links before all objects.
    yield from sorted(standstills, key=lambda finding: finding.rule)
    yield from _undelivered(facts)
    unused = [] if facts.undelivered else list(_unused_drive(scenario, scene, facts))
    yield from unused
    if not unused and facts.commands.are_zero:
        yield from _silent_controllers(scenario, facts)
    if (standstill := _never_moved(scene, facts)) is not None:
        yield ClaimFinding("never-moved", ("commands",), standstill)
    for path, message in unreached_events(scenario, facts.end):
        yield ClaimFinding("event-never-began", path, message)


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


def _silent_controllers(scenario: Scenario, facts: RunFacts) -> Iterator[ClaimFinding]:
    heard = (source for index, source in enumerate(scenario.commands) if index not in facts.undelivered)
    controllers = [source for source in heard if not source.is_written]
    if controllers:
        who = "the controller" if len(controllers) == 1 else "the controllers"
        reason = facts.why_silent or "check that it started, or run for longer"
        message = f"{who} gave no command other than zero in the whole run; {reason}"
        yield ClaimFinding("silent-controller", ("commands",), message)


def _never_moved(scene: Scene, facts: RunFacts) -> str | None:
    """Return the problem of a robot that did not move although it was commanded to, else None."""
    commands, motion = facts.commands, facts.motion
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
        if begins >= end:
            yield path, f"{what}: it is due at {begins:g} s, but the run ended at {end:.4g} s"


def _events(world: World) -> Iterator[tuple[KeyPath, str, float]]:
    for index, body in enumerate(world.objects):
        path: KeyPath = ("world", "objects", index)
        if body.appears is not None:
            yield (*path, "appears"), f"body '{body.name}' never appeared", body.appears
        if body.path:
            yield (*path, "path"), f"the path of body '{body.name}' never began", body.path[0].at
    for index, disturbance in enumerate(world.disturbances):
        yield ("world", "disturbances", index), f"world.disturbances[{index}] never began", disturbance.at
