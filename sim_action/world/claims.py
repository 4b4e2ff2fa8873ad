"""The audit of claims: rules against scenarios that pass although nothing was checked.

An error is a claim that cannot fail in any world, and refuses the scenario. A warning is a claim that cannot fail in
this scenario, and is shown in every report. Each finding carries the name of its rule. The key `allow` of a scenario
lists rules whose findings are accepted; `allow` of an expectation accepts only findings on it.

Assertions and command sources yield the findings about themselves, from `Setting` and from `JudgedRun`. They are
collected in `scenario/checks.py`, and after a run in `simulation/run_audit.py`, with the rules about whole scenarios.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any, Final, Literal, Self

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import Document, KeyPath, SpecProblems
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import GRAVITY, Physics, World
from sim_action.world.physics import FELT_SHARE
from sim_action.world.scene import Scene


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: the level of its findings, and their summary for the documents."""

    level: Literal["error", "warning"]
    summary: str
    over_variations: bool = False  # True if a finding counts only if all variations of a scenario have it


SINGLE_ROW: Final = "single-row-golden"  # the rule against golden files without a motion
NOT_SIMULATED: Final = "not-simulated"  # the rule about parts of launch files and world files that are not simulated

NOT_REPRODUCIBLE: Final = "not-reproducible"
"""The rule about runs whose nodes could not be kept in lock-step with sim time."""

LOGGED_ERROR: Final = "logged-error"  # the rule about errors that nodes log
NODE_FAILED: Final = "node-failed"  # the rule about nodes of a rostest that fail although its methods pass
LOW_GATE: Final = "low-gate"  # the rule about gates that pass although most of their runs fail

INCOMPLETE_WORLD: Final = "incomplete-world"
"""The rule about files of a world that cannot be used, so that an obstacle is missing."""

OVERLAPPING_BODIES: Final = "overlapping-bodies"  # the rule about bodies with a mass that begin inside others

_SUMMARIES: Final[Mapping[Literal["error", "warning"], Mapping[str, str]]] = {
    "error": {
        "bare-angle": "an angle, or an angular speed, without a unit that is more than one turn (a second): probably "
        "in degrees",
        "unreachable-limit": "a limit that no run can exceed, such as a tilt of 180 deg, a position beyond the stop of "
        "a joint, a reading that its sensor cannot have, a speed at which the run already counts as unstable "
        "(`physics.max_speed`); a formula, an `any_of` or a `not` that is always true or always false",
        "unreachable-target": "a place of `reach`, `final_pose` or `follow_path` that is farther away than the link "
        "can reach",
        "warnings-only": "a scenario in which every expectation has `severity: warning`",
        SINGLE_ROW: "a golden file with one row: no motion is compared",
        "no-collision-shape": "`no_collision`, `clearance`, `contact` or `stops_before` on a robot without a collision "
        "shape: the engine sees no contact and no distance",
        "fixed-base": "an assertion about the motion of a fixed base, such as `travel`, or `matches` without `joints`, "
        "or of a link that no joint moves in its frame; a comparison of `stl`, or a `clearance`, between parts that "
        "never move; a limit of `agreement` for such a base or a link fixed to it",
        LOW_GATE: "a gate that passes although most of its runs fail: a rate, or the share of a quantile, below 50 %",
        INCOMPLETE_WORLD: "a model or a mesh of a world file that is not found or cannot be used: an obstacle is "
        "missing",
        OVERLAPPING_BODIES: "a body with a mass that begins inside another one or the ground: the engine throws it out",
    },
    "warning": {
        "shapeless-links": "such an assertion where moving links have a visual shape but no collision shape",
        "nothing-to-touch": "`no_collision` where there is nothing that the robot may not touch during the check; "
        "`no_collision` or `clearance` where all objects are below the ground or above the robot",
        "limit-beyond-range": "a minimum distance of `sensor` that is greater than its sensor's range; a `max_error` "
        "of `follow_path` that is longer than its path; a limit, a tolerance, or a place in `not` or `any_of`, to "
        "which no run comes in its time limit, even if the robot runs away: at 1.5 times the speed at which its wheels "
        "and motors reach their limits, or at 5 times that of its commands if its wheels have no limits",
        "segment-beyond-run": "a command segment or point that is longer or later than the run: probably in "
        "milliseconds",
        "premise-never-held": "an implication (`a implies b`, or `always (not a or b)`) whose premise never held, in "
        "any variation",
        "drive-never-commanded": "a drive that no command source and no sensor used",
        "judged-once": "an invariant that was judged at one moment, although the run has more; a formula, or a goal of "
        "a class of yours, that was already decided at t = 0",
        "nothing-in-range": "an invariant of `sensor`, or a formula, whose ranges or depths were all infinite",
        "never-touched": "an upper limit of `contact`, or a `force` of `stl`, on a body that the robot did not touch; "
        "of the `force` of a contact sensor that felt nothing; of `feet_on_ground` without a foot on the ground; in "
        "any variation",
        "partly-compared": "a `follow_path` without `end`, or a `matches`, that saw less than 75 % of its path or "
        "golden trajectory",
        "golden-at-rest": "a golden file in which nothing that `matches` compares ever moves",
        "nothing-acts": "a run in which nothing was commanded, pushed or moved, and no expectation asks for a robot at "
        "rest",
        "no-effect": "a part that has no effect: a disturbance of zero, waypoints where the robot stands, a patch that "
        "nothing ever touched, a noisy sensor that nothing reads",
        "silent-controller": "a controller (script, process, replay, ROS nodes) that gave no command other than zero, "
        "unless an expectation asks for a robot at rest; a wrench of zero",
        "command-never-arrived": "a command source with `latency`, `jitter` or `dropouts` whose commands all came too "
        "late or never",
        "never-moved": "a robot that was commanded to move, and never moved",
        "link-never-moved": "an assertion on a `link` that held, although the link never moved in its frame, in any "
        "variation",
        "object-never-moved": "an `upright`, `stay_within` or `not: {reach: ...}` of `object` that held, although the "
        "object never moved, in any variation",
        NOT_SIMULATED: "a part of a world file that is not simulated; a part of a launch file, where `allow_losses` is "
        "true",
        NOT_REPRODUCIBLE: "ROS nodes that could not be kept in lock-step with sim time, so that another run may "
        "differ: a node that is never quiet or acts by the wall clock, or `pace: realtime`",
        LOGGED_ERROR: "a ROS 2 node that logged at the level ERROR or FATAL",
        NODE_FAILED: "a rostest whose methods passed although a node ended with an error, or a callback of the test "
        "raised",
        "event-never-began": "a disturbance, a wrench, a body or a path that is due after the end of the run",
    },
}
_OVER_VARIATIONS: Final = ("premise-never-held", "never-touched", "link-never-moved", "object-never-moved")
RULES: Final[Mapping[str, Rule]] = {
    name: Rule(level, summary, name in _OVER_VARIATIONS)
    for level, rows in _SUMMARIES.items()
    for name, summary in rows.items()
}


@dataclass(frozen=True, slots=True)
class ClaimFinding:
    """A finding of a rule: what was found, and what to change."""

    rule: str
    path: KeyPath  # the keys that lead to the place, in a part of a scenario or in the scenario
    message: str

    def below(self, path: KeyPath) -> Self:
        """Return the finding of a part of a scenario that stands at the keys `path`."""
        return replace(self, path=(*path, *self.path))

    @property
    def is_error(self) -> bool:
        """Return True if the finding refuses the scenario."""
        return RULES[self.rule].level == "error"

    def warning(self, document: Document) -> AuditWarning:
        """Return the finding as reports show it."""
        return AuditWarning(rule=self.rule, message=self.message, location=document.location(self.path))


class AuditWarning(FrozenModel):
    """A part of the scenario that checked nothing in this run, found by a rule of the audit of claims.

    Attributes:
        rule: the name of the rule, which `allow` in the scenario accepts.
        message: what was found, and what to change.
        location: the place in the scenario file.
    """

    rule: str
    message: str
    location: Location

    def __str__(self) -> str:
        return f"{self.message} [{self.rule}]"

    @property
    def is_over_variations(self) -> bool:
        """True if it counts only if all variations of a scenario have it. Other versions may have other rules."""
        return self.rule in RULES and RULES[self.rule].over_variations


def allowed_rules(data: Mapping[str, Any]) -> frozenset[str]:
    """Return the rules that the data of a scenario or an expectation allows, before it is validated."""
    stated = data.get("allow")
    return frozenset(name for name in stated if isinstance(name, str)) if isinstance(stated, tuple) else frozenset()


def unknown_rules(allow: Sequence[str], path: KeyPath = ()) -> SpecProblems:
    """Yield the names in `allow`, below the keys `path`, that are no rules."""
    for index, name in enumerate(allow):
        if name not in RULES:
            yield (*path, "allow", index), f"'{name}' is not a rule{did_you_mean(name, RULES)}"


Findings = Iterator[ClaimFinding]

# No robot is so many times faster than its wheels at their limits, or than the commands if its wheels have no limits.
_FASTER_THAN_LIMIT: Final = 1.5
_FASTER_THAN_COMMANDS: Final = 5.0


@dataclass(frozen=True, slots=True)
class Setting:
    """The scenario around an assertion or a command source, as far as its file says it."""

    world: World
    physics: Physics
    time_limit: float  # of the scenario, in s
    end: float  # sim time in s at which the assertion is checked last, or at which a command can act last
    end_key: str = "time_limit"  # the key of the scenario that states this end for commands


@dataclass(frozen=True, slots=True, eq=False)
class JudgedRun:
    """A finished run, and its verdict on one expectation."""

    scene: Scene
    trace: Trace  # the stored trace of the run
    verdict: Verdict
    lacks_premise: bool = False  # True if a premise of the expectation never held
    # joint -> the greatest effort that was commanded, in N m or N
    efforts: Mapping[str, float] = field(default_factory=dict)
    wrench: float = 0.0  # the greatest force in N, or torque in N m, that was commanded on a link
    fastest: float = 0.0  # the greatest linear speed that was commanded, in m/s
    time_limit: float = 0.0  # of the scenario, in s
    is_part: bool = False  # True if the verdict is about a part of an expectation that passed
    is_negated: bool = False  # True if that part must not hold

    @property
    def top_speed(self) -> float:
        """The speed in m/s that the base never has, not even if it runs away; infinite if it is not known."""
        limit, moves = self.scene.mobility.fastest, (bool(body.path) for body in self.scene.world.objects)
        is_driven = self.scene.actors or any(moves) or any(body.surface_velocity for body in self.scene.world.objects)
        if is_driven or self.is_pushed(()) or (math.isinf(limit) and not self.fastest):
            return math.inf
        observed = float(self.trace.speed.max(initial=0.0))
        if math.isinf(limit):
            return _FASTER_THAN_COMMANDS * max(self.fastest, observed)
        return _FASTER_THAN_LIMIT * max(limit, observed)

    @property
    def far(self) -> float:
        """The distance in m that the base never drives in the time limit, at its top speed."""
        return self.top_speed * self.time_limit

    def beyond_drive(self, distance: float, use: str, path: KeyPath = ()) -> Findings:
        """Yield a distance in m to which no run comes, not even one in which the robot runs away."""
        if distance > self.far:
            yield self.never_so_far(use, path)

    def never_so_far(self, use: str, path: KeyPath = ()) -> ClaimFinding:
        """Return the finding on a limit or a place that is farther away than `far`."""
        most = units.display(self.far, "m")
        message = f"no run comes so far: a robot that runs away drives less than {most} in the time limit"
        return ClaimFinding("limit-beyond-range", path, f"{message}; {use}")

    def is_pushed(self, joints: Collection[str]) -> bool:
        """Return True if a force that is not negligible acted on the robot, or an effort on one of the joints."""
        mass = self.scene.model.mass
        by_name, end = self.scene.model.joints_by_name, float(self.trace.time[-1])
        return (
            self.wrench > FELT_SHARE * mass * GRAVITY
            or any(self.efforts.get(name, 0.0) > FELT_SHARE * (by_name[name].max_effort or 0.0) for name in joints)
            or any(pushed.body is None and pushed.at < end for pushed in self.scene.world.disturbances)
        )


def _half_a_turn(_: Setting) -> float:
    return math.pi


@dataclass(frozen=True, slots=True)
class Ceiling:
    """The greatest value that a quantity has in any run: a limit that is not below it checks nothing."""

    key: str  # of the limit; an inner key is written with a dot
    unit: str  # the SI unit of the limit
    why: str  # the reason as a clause
    most: Callable[[Setting], float] = _half_a_turn  # returns the value

    @property
    def is_of_base(self) -> bool:
        """True if it holds only for the base, as the limits of a run do; angles end at half a turn anywhere."""
        return self.unit != "rad"

    def finding(self, part: object, setting: Setting) -> ClaimFinding | None:
        """Return the finding about the limit of a part; None if a run can exceed it."""
        names = self.key.split(".")
        value: Any = reduce(lambda inner, name: getattr(inner, name, None), names, part)
        most = self.most(setting)
        if value is None or value < most:
            return None
        why = f"{self.why}, {units.display(most, self.unit)}" if self.is_of_base else self.why
        return beyond(tuple(names), value, self.unit, why)


HEADINGS: Final = "two headings are at most 180 deg apart"  # the reason for a ceiling of a difference of headings

ORIENTATIONS: Final = "two orientations are at most 180 deg apart"
"""The reason for a ceiling of a difference of orientations."""

UNSTABLE: Final = "a run ends as unstable at physics."
"""The beginning of the reason for a ceiling that a key of `physics` states."""


def beyond(path: KeyPath, value: float, unit: str, why: str) -> ClaimFinding:
    """Return the finding on a limit that cannot be exceeded; `why` is a clause, `value` has the SI unit `unit`."""
    message = f"a limit of {units.display(value, unit)} cannot be exceeded, because {why}; give a smaller limit"
    return ClaimFinding("unreachable-limit", path, message)


IN_RANGE: Final = " sees something in range"
"""The end of the premise of a formula on the distances of a sensor, which begins with its name."""


def nothing_in_range(sensor: str) -> ClaimFinding:
    """Return the finding on distances of a sensor that were all infinite."""
    message = f"{sensor} saw nothing in range in the whole run, so no distance was compared"
    use = "let the robot come near an object, or raise the range of the sensor"
    return ClaimFinding("nothing-in-range", (), f"{message}; {use}")


COVERED_SHARE: Final = 0.75
"""The least share of a path, or of a golden trajectory, that a run compares without a warning."""

MANY_S: Final = 100.0  # from this number on, a time in s is probably one in ms


def late_points(path: KeyPath, times: Sequence[float | None], setting: Setting) -> Findings:
    """Yield the first point with a time in s after the end of the run."""
    for index, at in enumerate(times):
        if at is not None and at > setting.end:
            message = f"this point is at {at:g} s, but the run ends at {setting.end:g} s ({setting.end_key})"
            hint = f"; '{at:g} ms' meant?" if at >= MANY_S else "; move it, or remove it"
            yield ClaimFinding("segment-beyond-run", (*path, index, "at"), f"{message}{hint}")
            return
