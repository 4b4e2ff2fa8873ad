"""The audit of claims: rules against scenarios that pass although nothing was checked.

An error is a claim that cannot fail in any world, and refuses the scenario. A warning is a claim that cannot fail in
this scenario, and is shown in every report. Each finding carries the name of its rule. The key `allow` of a scenario
lists rules whose findings are accepted. Findings after a run are in `simulation/run_audit.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Literal

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import PathError
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.core.yaml_errors import SpecProblems
from sim_action.world import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.assertions import Assertion
    from sim_action.scenario.model import Agreement, Scenario
    from sim_action.state.golden_trajectory import Golden


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: the level of its findings, and their summary for the documents.

    Attributes:
        over_variations: True if a finding counts only if all variations of a scenario have it.
    """

    level: Literal["error", "warning"]
    summary: str
    over_variations: bool = False


SINGLE_ROW: Final = "single-row-golden"
"""The rule against golden files without a motion."""

NOT_SIMULATED: Final = "not-simulated"
"""The rule about parts of launch files and world files that are not simulated."""

NOT_REPRODUCIBLE: Final = "not-reproducible"
"""The rule about runs whose nodes could not be kept in lock-step with sim time."""

LOGGED_ERROR: Final = "logged-error"
"""The rule about errors that nodes log."""

INCOMPLETE_WORLD: Final = "incomplete-world"
"""The rule about files of a world that cannot be used, so that an obstacle is missing."""

RULES: Final[Mapping[str, Rule]] = MappingProxyType(
    {
        "bare-angle": Rule("error", "an angle without a unit that is more than one turn: probably in degrees"),
        "unreachable-limit": Rule(
            "error",
            "a limit that no run can exceed, such as a tilt of 180 deg, a speed at which the run already counts as "
            "unstable (`physics.max_speed`), or a comparison that is always true",
        ),
        "unreachable-target": Rule(
            "error", "a place of `reach`, `final_pose` or `follow_path` that is farther away than the link can reach"
        ),
        "warnings-only": Rule("error", "a scenario in which every expectation has `severity: warning`"),
        SINGLE_ROW: Rule("error", "a golden file with one row: no motion is compared"),
        "no-collision-shape": Rule(
            "error",
            "`no_collision`, `clearance`, `contact` or `stops_before` on a robot without a collision shape: "
            "the engine sees no contact and no distance",
        ),
        "fixed-base": Rule(
            "error",
            "an assertion about the motion of a fixed base, such as `travel`, or `matches` without `joints`, or of a "
            "link that no joint moves in its frame; a comparison of `stl`, or a `clearance`, between parts that never "
            "move; a limit of `agreement` for such a base or a link fixed to it",
        ),
        "shapeless-links": Rule(
            "warning", "such an assertion where moving links have a visual shape but no collision shape"
        ),
        "nothing-to-touch": Rule(
            "warning", "`no_collision` where there is nothing that the robot may not touch during the check"
        ),
        "limit-beyond-range": Rule("warning", "a minimum distance of `sensor` that is greater than its sensor's range"),
        "segment-beyond-run": Rule(
            "warning", "a command segment or point that is longer or later than the run: probably in milliseconds"
        ),
        "premise-never-held": Rule(
            "warning", "an implication (`a implies b`) whose premise never held, in any variation", over_variations=True
        ),
        "drive-never-commanded": Rule("warning", "a drive that no command source and no sensor used"),
        "judged-once": Rule("warning", "an invariant that was judged at one moment, although the run has more"),
        "nothing-in-range": Rule("warning", "an invariant of `sensor` whose ranges or depths were all infinite"),
        "never-touched": Rule(
            "warning",
            "an upper limit of `contact`, or a `force` of `stl`, on a body that the robot did not touch, or of "
            "`feet_on_ground` without a foot on the ground, in any variation",
            over_variations=True,
        ),
        "silent-controller": Rule(
            "warning",
            "a controller (script, process, replay, ROS nodes) that gave no command other than zero; a wrench of zero",
        ),
        "command-never-arrived": Rule(
            "warning",
            "a command source with `latency`, `jitter` or `dropouts` whose commands all came too late or never",
        ),
        "never-moved": Rule("warning", "a robot that was commanded to move, and never moved"),
        "link-never-moved": Rule(
            "warning",
            "an assertion on a `link` that held, although the link never moved in its frame, in any variation",
            over_variations=True,
        ),
        "object-never-moved": Rule(
            "warning",
            "an `upright` or `stay_within` of `object` that held, although the object never moved, in any variation",
            over_variations=True,
        ),
        NOT_SIMULATED: Rule(
            "warning",
            "a part of a world file that is not simulated; a part of a launch file, where `allow_losses` is true",
        ),
        NOT_REPRODUCIBLE: Rule(
            "warning",
            "ROS nodes that could not be kept in lock-step with sim time, so that another run may differ: "
            "a node that is never quiet or acts by the wall clock, or `pace: realtime`",
        ),
        LOGGED_ERROR: Rule("warning", "a ROS 2 node that logged at the level ERROR or FATAL"),
        INCOMPLETE_WORLD: Rule(
            "error", "a model or a mesh of a world file that is not found or cannot be used: an obstacle is missing"
        ),
        "event-never-began": Rule(
            "warning", "a disturbance, a wrench, a body or a path that is due after the end of the run"
        ),
    }
)


@dataclass(frozen=True, slots=True)
class ClaimFinding:
    """A finding of a rule at the keys `path` of a scenario: what was found, and what to change."""

    rule: str
    path: KeyPath
    message: str

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
    """Return the rules that the data of a scenario allows, before it is validated."""
    stated = data.get("allow")
    return frozenset(name for name in stated if isinstance(name, str)) if isinstance(stated, tuple) else frozenset()


def unknown_rules(allow: Sequence[str]) -> SpecProblems:
    """Yield the names in `allow` that are no rules."""
    for index, name in enumerate(allow):
        if name not in RULES:
            yield ("allow", index), f"'{name}' is not a rule{did_you_mean(name, RULES)}"


def audit_scenario(
    scenario: Scenario, expect_paths: Sequence[KeyPath], command_paths: Sequence[KeyPath]
) -> Iterator[ClaimFinding]:
    """Yield the findings that are visible without the robot model."""
    yield from _warnings_only(scenario, expect_paths)
    if scenario.agreement is not None:
        yield from _beyond_half_a_turn(scenario.agreement)
    for path, assertion in placed_leaves(scenario, expect_paths):
        yield from _unreachable_limits(path, assertion, scenario)
        if assertion.key == "no_collision":
            ends = [
                each.before for at, each in zip(expect_paths, scenario.expect, strict=True) if path[: len(at)] == at
            ]
            yield from _nothing_to_touch(path, assertion, scenario, min(scenario.time_limit, *ends))
        elif assertion.key == "sensor":
            yield from _beyond_range(path, assertion, scenario)
    for path, source in zip(command_paths, scenario.commands, strict=True):
        yield from _late_segments(path, source, scenario)
        wrench = getattr(source, "wrench", None)
        if wrench is not None and not any((*(wrench.force or ()), *(wrench.torque or ()))):
            message = "the force and the torque are zero, so the wrench does nothing; change them, or remove it"
            yield ClaimFinding("silent-controller", (*path, "wrench"), message)


def audit_scene(scene: Scene, scenario: Scenario, expect_paths: Sequence[KeyPath]) -> Iterator[ClaimFinding]:
    """Yield the findings that depend on other files."""
    for path, assertion in placed_leaves(scenario, expect_paths):
        if assertion.key == "matches" and not scene.workspace.updates_golden:
            yield from _single_row(path, assertion, scene)


def _warnings_only(scenario: Scenario, expect_paths: Sequence[KeyPath]) -> Iterator[ClaimFinding]:
    soft = all(expectation.severity == "warning" for expectation in scenario.expect)
    if soft and scenario.agreement is None and expect_paths:
        message = "every expectation has severity: warning, so this scenario cannot fail; remove it from one of them"
        yield ClaimFinding("warnings-only", (*expect_paths[0], "severity"), message)


def placed_leaves(scenario: Scenario, expect_paths: Sequence[KeyPath]) -> Iterator[tuple[KeyPath, Any]]:
    """Yield all assertions that judge the robot, with the paths of their values."""
    for path, expectation in zip(expect_paths, scenario.expect, strict=True):
        yield from _placed(expectation.assertion, path)


def _placed(assertion: Assertion, path: KeyPath) -> Iterator[tuple[KeyPath, Assertion]]:
    path = (*path, assertion.key)
    placed_parts = getattr(assertion, "placed_parts", None)
    if placed_parts is None:
        yield path, assertion
        return
    for place, part in placed_parts:
        yield from _placed(part, (*path, *place))


_HEADING: Final = "two headings are at most 180 deg apart"
_TURN: Final = "two orientations are at most 180 deg apart"
_UNSTABLE: Final = "a run ends as unstable at physics."
_FASTEST: Final = "no path is longer at physics.max_speed until time_limit"


def _beyond_half_a_turn(agreement: Agreement) -> Iterator[ClaimFinding]:
    """Yield angles of `agreement` that no two runs exceed."""
    if agreement.yaw is not None and agreement.yaw >= math.pi:
        yield beyond(("agreement", "yaw"), agreement.yaw, "rad", _HEADING)
    for group, named in (("links", agreement.links), ("bodies", agreement.bodies)):
        for name, limits in named.items():
            if limits.orientation is not None and limits.orientation >= math.pi:
                yield beyond(("agreement", group, name, "orientation"), limits.orientation, "rad", _TURN)


# Assertion, field, unit, the value that no run exceeds, and the reason.
_BOUNDS: Final[tuple[tuple[str, str, str, Callable[[Scenario], float], str], ...]] = (
    ("upright", "max_tilt", "rad", lambda _: math.pi, "a tilt is at most 180 deg"),
    ("max_speed", "linear", "m/s", lambda at: at.physics.max_speed, f"{_UNSTABLE}max_speed"),
    ("max_speed", "angular", "rad/s", lambda at: at.physics.max_turn_rate, f"{_UNSTABLE}max_turn_rate"),
    ("travel", "at_most", "m", lambda at: at.physics.max_distance, f"{_UNSTABLE}max_distance"),
    ("path_length", "at_most", "m", lambda at: at.physics.max_speed * at.time_limit, _FASTEST),
    ("final_pose", "yaw_tolerance", "rad", lambda _: math.pi, _HEADING),
    ("reach", "yaw_tolerance", "rad", lambda _: math.pi, _HEADING),
    *((key, "orientation.tolerance", "rad", lambda _: math.pi, _TURN) for key in ("reach", "final_pose")),
    ("matches", "yaw", "rad", lambda _: math.pi, _HEADING),
    ("odometry_error", "yaw", "rad", lambda _: math.pi, _HEADING),
)


def _unreachable_limits(path: KeyPath, assertion: Any, scenario: Scenario) -> Iterator[ClaimFinding]:
    is_object = assertion.key == "object"
    if is_object:
        path, assertion = (*path, assertion.part.key), assertion.part
    for key, field, unit, most, why in _BOUNDS:
        # Only the base has the limits of a run.
        if assertion.key != key or not (unit == "rad" or (assertion.watches_base and not is_object)):
            continue
        names = field.split(".")
        value = reduce(lambda part, name: getattr(part, name, None), names, assertion)
        if value is not None and value >= (bound := most(scenario)):
            yield beyond((*path, *names), value, unit, f"{why}" if unit == "rad" else _at(why, bound, unit))
    if assertion.key == "stl":
        from sim_action.scenario.formula_claims import audit_formula

        yield from audit_formula(path, assertion, scenario.physics)


def _at(why: str, bound: float, unit: str) -> str:
    return f"{why}, {units.display(bound, unit)}"


def beyond(path: KeyPath, value: float, unit: str, why: str) -> ClaimFinding:
    """Return the finding on a limit that cannot be exceeded; `why` is a clause, `value` has the SI unit `unit`."""
    message = f"a limit of {units.display(value, unit)} cannot be exceeded, because {why}; give a smaller limit"
    return ClaimFinding("unreachable-limit", path, message)


def _nothing_to_touch(path: KeyPath, assertion: Any, scenario: Scenario, end: float) -> Iterator[ClaimFinding]:
    bodies = scenario.world.objects
    touchable = [body for body in bodies if body.name not in (*assertion.allow, GROUND)]
    if all(body.appears is not None and body.appears >= end for body in touchable):
        found = (
            f"every object that may not be touched appears only after the check, which ends at {end:g} s"
            if touchable
            else "allow names every object of the world"
            if bodies
            else "the world has no objects, and the ground never counts"
        )
        message = f"{found}, so the robot cannot touch anything; add an object to world.objects, or remove no_collision"
        yield ClaimFinding("nothing-to-touch", path, message)


def _beyond_range(path: KeyPath, assertion: Any, scenario: Scenario) -> Iterator[ClaimFinding]:
    """Yield a minimum distance that is greater than the range of its sensor."""
    sensors = [mounted.sensor for mounted in scenario.sensors if mounted.name == assertion.name]
    field = {"ranges": "range", "depth": "far"}.get(assertion.reading)
    if not sensors or field is None or assertion.at_least is None or assertion.once or assertion.which == "max":
        return
    far, least = getattr(sensors[0], field, math.inf), units.parse(assertion.at_least, units.LENGTH)
    if least > far:
        sees, wanted = units.display(far, "m"), units.display(least, "m")
        message = f"{assertion.name} sees {sees} far, so nothing between {sees} and {wanted} is noticed"
        yield ClaimFinding("limit-beyond-range", (*path, "at_least"), f"{message}; raise its '{field}'")


def _late_segments(path: KeyPath, source: Any, scenario: Scenario) -> Iterator[ClaimFinding]:
    start, limit = 0.0, scenario.time_limit
    for index, segment in enumerate(getattr(source, "twist", ())):
        below: KeyPath = (*path, "twist", index)
        if start >= limit:
            message = f"this segment begins at {start:g} s, but the run ends at {limit:g} s (time_limit)"
            yield ClaimFinding("segment-beyond-run", below, f"{message}; shorten the segments before it, or remove it")
            return
        if segment.duration is None:
            return
        if segment.duration > limit:
            message = f"this segment lasts {segment.duration:g} s, but the run ends at {limit:g} s (time_limit)"
            hint = f"; '{segment.duration:g} ms' meant?" if segment.duration >= _MANY_S else ""
            yield ClaimFinding("segment-beyond-run", (*below, "for"), f"{message}{hint}")
            return
        start += segment.duration
    times = [getattr(point, "at", None) for point in getattr(source, "points", ())]
    if times:
        yield from late_points((*path, "joints"), times, scenario)


def late_points(path: KeyPath, times: Sequence[float | None], scenario: Scenario) -> Iterator[ClaimFinding]:
    """Yield the first point with a time in s after the end of the run; without a goal, the run ends at its duration."""
    limit, key = scenario.time_limit, "time_limit"
    goals = any(expected.assertion.is_goal for expected in scenario.expect)
    if scenario.duration is not None and not goals:
        windows = (
            (each.after + each.assertion.horizon, each.before if math.isfinite(each.before) else 0.0)
            for each in scenario.expect
        )
        limit, key = min((limit, key), (max(scenario.duration, *(max(each) for each in windows)), "duration"))
    for index, at in enumerate(times):
        if at is not None and at > limit:
            message = f"this point is at {at:g} s, but the run ends at {limit:g} s ({key})"
            hint = f"; '{at:g} ms' meant?" if at >= _MANY_S else "; move it, or remove it"
            yield ClaimFinding("segment-beyond-run", (*path, index, "at"), f"{message}{hint}")
            return


# From this number on, a time in s is probably one in ms.
_MANY_S: Final = 100.0


def _single_row(path: KeyPath, assertion: Any, scene: Scene) -> Iterator[ClaimFinding]:
    from sim_action.state.golden_trajectory import GoldenError

    try:
        golden = assertion.golden_in(scene)
    except (GoldenError, PathError, ValueError):
        return  # reported by the assertion itself
    if len(golden.rows) < 2:
        yield ClaimFinding(SINGLE_ROW, (*path, "trace"), single_row(assertion.file_in(scene), golden))


def single_row(name: str, golden: Golden) -> str:
    """Return the problem of a golden file with one row."""
    when = f"at {golden.time[0]:g} s"
    return f"{name} has one row, {when}, so it compares no motion; record a longer run or window"
