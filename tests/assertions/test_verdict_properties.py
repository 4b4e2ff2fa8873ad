"""A pass means that something was checked: properties of every assertion, on random traces.

The tables `LIMITS` and `GOALS` say how to tighten each assertion; a new one has them in its own test file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort, Energy
from sim_action.assertions.follow_path import FollowPath, PathEnd
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.legs import SupportMargin
from sim_action.assertions.matches import Matches
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.object import Moved, ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import FinalPose, Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.workspace import Workspace
from sim_action.state.golden_trajectory import Golden
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, SensorRecord
from sim_action.state.verdict import Verdict
from tests.assertions.limits import FAR, Extreme, Limit, of_own_tests
from tests.assertions.test_cuts import EIGHT, MOVABLE, RATE, SPECS, STEPS, random_trace
from tests.soak import examples
from tests.traces import WHEELS, monitor, scene

SCENE: Final = scene()
LEFT: Final = WHEELS[0]
seeds = st.integers(0, 2**32 - 1)
steps = st.integers(0, STEPS)


@st.composite
def windows(draw: st.DrawFn) -> tuple[float, float]:
    """Begin and end of a window in s, which may lie beyond the trace."""
    after = draw(st.just(0) | st.integers(0, STEPS + 5))
    length = draw(st.none() | st.integers(1, STEPS))
    return after / RATE, math.inf if length is None else (after + length) / RATE


def judged(
    spec: Assertion, seen: Trace, window: tuple[float, float] = (0.0, math.inf), *, acted_on: bool = False, **keys: Any
) -> Verdict:
    """The verdict of an expectation on a run."""
    opened = spec.opened(replace(SCENE, acted_on=acted_on, **keys), MOVABLE)
    return Window(opened, *window).observe(seen).verdict()


@examples(300)
@given(st.sampled_from(SPECS), seeds, windows(), st.booleans(), st.sampled_from([None, 0.01]))
def test_what_passes_was_judged_inside_its_window(
    spec: Assertion, seed: int, window: tuple[float, float], acted_on: bool, span: float | None
) -> None:
    if spec.hold_time or not (spec.is_goal and spec.has_truth):
        span = None
    opened = spec.opened(replace(SCENE, acted_on=acted_on), MOVABLE, span)
    verdict = Window(opened, *window).observe(random_trace(seed)).verdict()
    assert verdict.judged is not None
    if verdict.passed:
        assert verdict.judged.moments >= 1
        assert verdict.judged.first is not None
        assert verdict.judged.last is not None
        after, before = window
        assert after - TIME_EPSILON_S <= verdict.judged.first <= verdict.judged.last <= before + TIME_EPSILON_S


def lower(of: Callable[[float], Assertion]) -> Limit:
    return Limit(of, -FAR, least=True)


LIMITS: Final[dict[str, list[Limit]]] = {
    "travel": [Limit(lambda m: Travel(at_most=m))],
    "path_length": [Limit(lambda m: PathLength(at_most=m))],
    "final_pose": [Limit(lambda m: FinalPose(x=0.3, y=0.3, tolerance=m))],
    "contact": [
        Limit(lambda n: Touch.model_validate({"with": "wall", "at_most": n})),
        Limit(lambda n: Touch.model_validate({"with": "wall", "impulse": {"at_most": n}})),
    ],
    "upright": [Limit(lambda a: Upright(max_tilt=a))],
    "max_speed": [Limit(lambda v: MaxSpeed(linear=v)), Limit(lambda w: MaxSpeed(angular=w))],
    "stay_within": [
        Limit(lambda m: StayWithin(x=(-2 * FAR, m))),
        lower(lambda m: StayWithin(y=(m, 2 * FAR))),
        Limit(lambda m: StayWithin(z=(-2 * FAR, m))),
    ],
    "clearance": [Limit(lambda m: Clearance(at_least=m), loose=1e-9, least=True)],
    "follow_path": [
        Limit(lambda m: FollowPath(path=EIGHT, max_error=m)),
        Limit(lambda m: FollowPath(path=EIGHT, rms=m)),
    ],
    "odometry_error": [
        Limit(lambda m: OdometryError(position=m)),
        Limit(lambda a: OdometryError(yaw=a)),
        Limit(lambda share: OdometryError(drift=share)),
    ],
    "sensor": [
        Limit(lambda m: SensorReading(name="scan", reading="ranges", which="max", at_most=m)),
        lower(lambda m: SensorReading(name="scan", reading="ranges", which="mean", at_least=m)),
    ],
    "joint": [Limit(lambda a: JointReading(name=LEFT, at_most=a))],
    "joint_within": [
        Limit(lambda a: JointWithin(position={LEFT: (-2 * FAR, a)})),
        lower(lambda v: JointWithin(velocity={LEFT: (v, 2 * FAR)})),
        Limit(lambda n: JointWithin(effort={LEFT: (-2 * FAR, n)})),
    ],
    "effort": [Limit(lambda n: Effort(at_most=n)), Limit(lambda n: Effort(joints=(LEFT,), rms_at_most=n))],
    "energy": [Limit(lambda j: Energy(at_most=j)), Limit(lambda j: Energy(at_most=j, braking="costs", joints=(LEFT,)))],
    "support_margin": [lower(lambda m: SupportMargin(links=("wheel_*", "caster_back_link"), at_least=m))],
    "object": [
        Limit(lambda m: ObjectAssertion(name="cube", moved=Moved(at_most=m))),
        lower(lambda m: ObjectAssertion(name="cube", stay_within=StayWithin(y=(m, 2 * FAR)))),
    ],
    "stl": [
        Limit(lambda v: Stl(formula=f"always speed < {v:.12f} m/s")),
        Limit(lambda m: Stl(formula=f"always[0 s, 50 ms] travel < {m:.12f} m")),
    ],
    "all_of": [Limit(lambda m: AllOf(parts=(Travel(at_most=m), StayWithin(z=(-2 * FAR, 2 * FAR)))))],
    "any_of": [Limit(lambda m: AnyOf(parts=(Travel(at_most=m), StayWithin(z=(FAR, 2 * FAR)))))],
    "not": [Limit(lambda m: Negation(part=Travel(at_least=m)))],
}
"""Assertion -> itself with limits; a limit beyond the measured extreme breaks it."""

NO_LIMITS: Final[Mapping[str, str]] = {
    "reach": "a goal",
    "settled": "a goal",
    "stops_before": "a goal, and a touch breaks it",
    "at_once": "a goal",
    "no_collision": "has no limit: test_a_contact_that_is_not_allowed_breaks_no_collision",
    "self_collision": "has no limit: tests/assertions/test_no_collision.py",
    "matches": "needs a file: test_a_tolerance_below_the_largest_error_breaks_a_golden_trajectory",
    "grasped": "a goal",
    "feet_on_ground": "its limits are whole numbers: tests/assertions/test_legs.py",
    "assertion": "is code of the user",
}


def travelled(seen: Trace) -> float:
    x, y, _ = MOVABLE.pose.position_xyz
    return float(np.hypot(seen.base_position_xyz[:, 0] - x, seen.base_position_xyz[:, 1] - y).max())


def arc_length(seen: Trace) -> float:
    places = np.vstack((MOVABLE.pose.position_xyz, seen.base_position_xyz))
    return sum(math.dist(one, other) for one, other in pairwise(places))


def distance_to(x: float, y: float) -> Callable[[Trace], float]:
    return lambda seen: min(math.dist((x, y), place) for place in seen.base_position_xyz[:, :2].tolist())


def least_clearance(seen: Trace) -> float:
    record: ClearanceRecord = seen.clearances[Clearance(at_most=0.2).watch]
    return float(record.distance.min()) if len(record) else math.inf


def reading(name: str, column: str, of: Callable[[Any], float]) -> Callable[[Trace], float]:
    def extreme(seen: Trace) -> float:
        record: SensorRecord = seen.sensors[name]
        return float(of(record.columns[column]))

    return extreme


def greatest_force(seen: Trace) -> float:
    """The greatest mean over a window of 50 ms."""
    sums = np.zeros(STEPS + 1)
    for contact in seen.contacts:
        if contact.body == "wall":
            sums[round(contact.time * RATE)] += contact.force
    window = round(0.05 * RATE)
    return max(float(sums[max(0, end - window) : end].sum()) / window for end in range(1, STEPS + 2))


def path_end(seen: Trace) -> float:
    return distance_to(EIGHT[-1].x, EIGHT[-1].y)(seen)


def near_left(seen: Trace) -> float:
    return float(np.abs(seen.joint_position[:, 0] - 1.0).min())


def cube_places(seen: Trace) -> list[list[float]]:
    return [place for place in seen.objects["cube"].position_xyz.tolist() if math.isfinite(place[0])]


def cube_nearest(seen: Trace) -> float:
    return min(math.dist((0.3, 0.3), place[:2]) for place in cube_places(seen))


def cube_moved(seen: Trace) -> float:
    first, *later = cube_places(seen)
    return max(math.dist(first, place) for place in later)


def lasted(seen: Trace) -> float:
    return float(seen.time[-1])


GOALS: Final[dict[str, list[Extreme]]] = {
    "travel": [Extreme(lambda m: Travel(at_least=m), travelled)],
    "path_length": [Extreme(lambda m: PathLength(at_least=m), arc_length)],
    "reach": [Extreme(lambda m: Reach(x=0.3, y=0.3, tolerance=m), distance_to(0.3, 0.3), least=True)],
    "settled": [
        Extreme(lambda s: Settled.model_validate({"for": s, "speed": FAR, "turn_rate": FAR}), lasted),
        Extreme(
            lambda v: Settled.model_validate({"for": 1 / RATE, "speed": v, "turn_rate": FAR}),
            lambda seen: float(seen.speed.min()),
            least=True,
        ),
    ],
    "final_pose": [Extreme(lambda m: FinalPose(x=0.3, y=0.3, tolerance=m), distance_to(0.3, 0.3), least=True)],
    "contact": [
        Extreme(lambda n: Touch.model_validate({"with": "wall", "at_least": n}), greatest_force),
        Extreme(
            lambda i: Touch.model_validate({"with": "wall", "impulse": {"at_least": i}}),
            lambda seen: greatest_force(seen) * 0.05,
        ),
        Extreme(lambda s: Touch.model_validate({"with": "wall", "for": s}), lasted),
    ],
    "stops_before": [
        Extreme(
            lambda s: StopsBefore.model_validate(
                {"body": "wall", "gap": (0.1, 0.4), "speed": FAR, "turn_rate": FAR, "for": s}
            ),
            lasted,
        )
    ],
    "clearance": [Extreme(lambda m: Clearance(at_most=m), least_clearance, least=True)],
    "follow_path": [Extreme(lambda m: FollowPath(path=EIGHT, end=PathEnd(tolerance=m)), path_end, least=True)],
    "sensor": [
        Extreme(
            lambda m: SensorReading(name="scan", reading="ranges", which="max", at_least=m, once=True),
            reading("scan", "ranges", np.max),
        ),
        Extreme(
            lambda m: SensorReading(name="scan", reading="ranges", which="min", at_most=m, once=True),
            reading("scan", "ranges", np.min),
            least=True,
        ),
    ],
    "joint": [
        Extreme(lambda a: JointReading(name=LEFT, at_least=a), lambda seen: float(seen.joint_position[:, 0].max())),
        Extreme(lambda a: JointReading(name=LEFT, near=1.0, tolerance=a), near_left, least=True),
    ],
    "object": [
        Extreme(
            lambda m: ObjectAssertion(name="cube", reach=Reach(x=0.3, y=0.3, tolerance=m)), cube_nearest, least=True
        ),
        Extreme(lambda m: ObjectAssertion(name="cube", moved=Moved(at_least=m)), cube_moved),
    ],
    "stl": [Extreme(lambda a: Stl(formula=f"eventually tilt > {a:.12f} rad"), lambda seen: float(seen.tilt.max()))],
    "any_of": [Extreme(lambda m: AnyOf(parts=(Travel(at_least=m), Reach(x=FAR, y=FAR))), travelled)],
    "all_of": [Extreme(lambda m: AllOf(parts=(Travel(at_least=m), Travel(at_most=FAR))), travelled)],
    "at_once": [Extreme(lambda m: AtOnce(parts=(Travel(at_least=m), Travel(at_most=FAR))), travelled)],
    "not": [Extreme(lambda a: Negation(part=Upright(max_tilt=a)), lambda seen: float(seen.tilt.max()))],
}
"""Assertion -> itself as a goal; a limit beyond the extreme of the whole run is never met."""

NO_GOALS: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        ("no_collision", "self_collision", "upright", "max_speed", "stay_within", "matches", "odometry_error"),
        "invariant",
    ),
    **dict.fromkeys(("joint_within", "effort", "energy", "feet_on_ground", "support_margin"), "invariant"),
    "grasped": "tests/assertions/test_grasped.py: no random trace has a grip",
    "assertion": "is code of the user",
}


LIMITS.update(of_own_tests("LIMITS", {*LIMITS, *NO_LIMITS}))
GOALS.update(of_own_tests("GOALS", {*GOALS, *NO_GOALS}))


def test_no_assertion_is_missing() -> None:
    for table, exceptions in ((LIMITS, NO_LIMITS), (GOALS, NO_GOALS)):
        assert not set(table) & set(exceptions)
        assert {*table, *exceptions} == set(ASSERTIONS)
    assert all(LIMITS.get(key) or GOALS.get(key) for key in set(ASSERTIONS) - {*NO_LIMITS, *NO_GOALS})
    assert all(limit.of(FAR).key == key for key, limits in LIMITS.items() for limit in limits)
    assert all(goal.of(FAR).key == key for key, goals in GOALS.items() for goal in goals)


def each(table: Mapping[str, list[Any]]) -> list[Any]:
    return [pytest.param(one, id=f"{key}-{n}") for key, entries in table.items() for n, one in enumerate(entries)]


def beyond(value: float, *, up: bool) -> float:
    margin = 1e-6 * max(1.0, abs(value))
    return value + margin if up else value - margin


@pytest.mark.parametrize("limit", each(LIMITS))
@examples(8)
@given(seed=seeds, window=windows())
def test_a_limit_beyond_the_measured_extreme_breaks_an_invariant(
    limit: Limit, seed: int, window: tuple[float, float]
) -> None:
    seen = random_trace(seed)
    loose = limit.of(limit.loose)
    told = judged(loose, seen, window)
    assume(told.passed and told.measured is not None)
    assert told.measured is not None
    tight = beyond(told.measured, up=limit.least)
    assume(tight > 0 or limit.loose < 0 or limit.of is LIMITS["joint"][0].of)
    assert judged(limit.of(tight), seen, window).status == "failed"


@pytest.mark.parametrize("goal", each(GOALS))
@examples(8)
@given(seed=seeds, window=windows(), acted_on=st.booleans())
def test_a_goal_beyond_the_extreme_of_the_whole_run_is_never_met(
    goal: Extreme, seed: int, window: tuple[float, float], acted_on: bool
) -> None:
    seen = random_trace(seed)
    value = goal.extreme(seen)
    limit = beyond(value, up=not goal.least) if math.isfinite(value) else FAR
    assume(limit > 0)
    assert not judged(goal.of(limit), seen, window, acted_on=acted_on).passed


MAY_RECOVER: Final[tuple[type[Assertion], ...]] = (FinalPose,)
"""These are judged at the end: a later moment may be better."""


def may_recover(spec: Assertion) -> bool:
    """Return True for an assertion that is judged at the end, as the root mean square of an error."""
    if isinstance(spec, Negation) and isinstance(spec.part, AllOf):
        return True  # of a goal and an invariant: the invariant may break later
    if isinstance(spec, AnyOf | AllOf | Negation):
        return any(may_recover(part) for _, part in spec.placed_parts)
    rms = getattr(spec, "rms", None) or getattr(spec, "rms_at_most", None)
    # An inner 'eventually' that the end of the run cuts off may still come true.
    return bool(rms) or isinstance(spec, MAY_RECOVER) or (isinstance(spec, Stl) and "eventually" in spec.formula)


INVARIANTS: Final[list[Assertion]] = [
    *(spec for spec in SPECS if monitor(spec).state is State.HOLDS and not may_recover(spec)),
    Stl(formula="always (speed < 1.5)"),
    Stl(formula="always[20 ms, 150 ms] (tilt < 1 or travel < 20 cm)"),
]


@examples(300)
@given(st.sampled_from(INVARIANTS), seeds, windows(), steps, st.booleans())
def test_a_longer_run_turns_no_failed_invariant_into_a_pass(
    spec: Assertion, seed: int, window: tuple[float, float], cut: int, acted_on: bool
) -> None:
    seen = random_trace(seed)
    short = judged(spec, first_steps(seen, cut), window, acted_on=acted_on)
    if short.status == "failed":
        assert judged(spec, seen, window, acted_on=acted_on).status == "failed"


def first_steps(seen: Trace, count: int) -> Trace:
    end = float(seen.time[count - 1]) if count else -1.0
    return seen.between(-math.inf, end)


def assert_fails_with_a_margin(part: Assertion, seen: Trace, *, acted_on: bool, **keys: Any) -> None:
    told = judged(Negation(part=part), seen, acted_on=acted_on, **keys)
    assert told.status == "failed"
    assert told.margin is not None
    assert told.margin <= 0


@pytest.mark.parametrize("limit", each(LIMITS))
@examples(4)
@given(seed=seeds, acted_on=st.booleans())
def test_the_negation_of_a_limit_that_holds_has_a_margin(limit: Limit, seed: int, acted_on: bool) -> None:
    part = limit.of(limit.loose)
    seen = random_trace(seed)
    assume(monitor(part, MOVABLE).observe(seen).verdict().passed)
    assert_fails_with_a_margin(part, seen, acted_on=acted_on)


@pytest.mark.parametrize("goal", each(GOALS))
@examples(4)
@given(seed=seeds, acted_on=st.booleans())
def test_the_negation_of_a_goal_that_is_met_has_a_margin(goal: Extreme, seed: int, acted_on: bool) -> None:
    seen = random_trace(seed)
    value = goal.extreme(seen)
    assume(0 < value < FAR)
    part = goal.of(value * 40 if goal.least else value / 40)
    assume(monitor(part, MOVABLE).observe(seen).verdict().passed)
    assert_fails_with_a_margin(part, seen, acted_on=acted_on)


@examples(10)
@given(seeds, st.booleans())
def test_the_negation_of_no_collision_has_a_margin(seed: int, acted_on: bool) -> None:
    assert_fails_with_a_margin(NoCollision(allow=("wall", "ball")), random_trace(seed), acted_on=acted_on)


@examples(30)
@given(seeds, windows())
def test_a_contact_that_is_not_allowed_breaks_no_collision(seed: int, window: tuple[float, float]) -> None:
    seen = random_trace(seed)
    after, before = window[0] - TIME_EPSILON_S, window[1] + TIME_EPSILON_S
    touches = [contact for contact in seen.contacts if after <= contact.time <= before]
    assert judged(NoCollision(), seen, window).status != ("passed" if touches else "failed")
    assert judged(NoCollision(allow=("wall", "ball")), seen, window).status != "failed"


@examples(20)
@given(seeds)
def test_a_tolerance_below_the_largest_error_breaks_a_golden_trajectory(tmp_path_factory: Any, seed: int) -> None:
    folder: Path = tmp_path_factory.mktemp("golden")
    where: dict[str, Any] = {"workspace": Workspace(folder, folder), "file": "s.sim.yml"}
    loose = Matches.model_validate({"trace": "x.csv", "position": FAR})
    whole = Trace.concatenate((Trace.of_observation(MOVABLE), random_trace(1)))
    Golden.of_trace(loose.form_in(replace(SCENE, **where)), whole, loose.rate).write(folder / loose.trace)
    told = judged(loose, random_trace(seed), **where)
    assert told.passed
    assert told.measured is not None
    assert_fails_with_a_margin(loose, random_trace(seed), acted_on=True, **where)
    # Rows of a golden file are rounded, so smaller tolerances are refused.
    assume(told.measured > 3e-4)
    tight = Matches.model_validate({"trace": "x.csv", "position": beyond(told.measured, up=False)})
    assert judged(tight, random_trace(seed), **where).status == "failed"
