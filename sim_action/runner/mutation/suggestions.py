"""Suggestions: expectations that pass in the original run, and that would have noticed a mutant that survived.

Each candidate is made of the original run. Runs of the original and of the mutant with all candidates choose some of
them. Runs with one candidate alone then decide: together, candidates may prolong a run.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Final

import numpy as np
import yaml

from sim_action.core.errors import InvalidScenario
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, replace
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.runner.mutation.judgement import LEAST_ANGLE, LEAST_DISTANCE_M, notices
from sim_action.runner.mutation.mutant import Original
from sim_action.scenario.loading import Libraries, checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.mutation import Mutation

MOST_TRIALS: Final = 3  # the number of candidates that are run alone, for each survivor

MOST_RUNS: Final = 1 + 2 * MOST_TRIALS
"""The number of runs for one survivor: one with all candidates, then each alone with and without the mutant."""

_TOLERANCE_M: Final = 0.1
_TOLERANCE_RAD: Final = 0.087
_CLEARANCES_M: Final = (0.2, 0.1, 0.05)
# The time in s that a robot may take longer, and the factor by which it may be faster.
_LATER_S: Final = 0.25
_FASTER: Final = 1.2
# Added to the speed of a joint, in rad/s or m/s.
_LEAST_SPEED: Final = 0.1
_MOST_POINTS: Final = 12
_MOST_JOINTS: Final = 3
_DIGITS: Final = 2
Entry = str | Mapping[str, object]  # an entry of `expect`, as YAML has it


@dataclass(frozen=True, eq=False)
class Candidates:
    """Expectations that may notice what the scenario does not."""

    entries: Sequence[Entry]  # as a scenario has them
    loaded: LoadedScenario  # the original scenario with all of them after its own expectations
    own: int  # the number of its own expectations

    def added_to(self, mutant: LoadedScenario) -> LoadedScenario:
        """Return a mutant of the scenario with the candidates."""
        more = self.loaded.scenario.expect[self.own :]
        scenario = mutant.scenario
        return replace(mutant, scenario=scenario.model_copy(update={"expect": (*scenario.expect, *more)}))

    def alone(self, place: int, run: LoadedScenario) -> LoadedScenario:
        """Return the original scenario, or a mutant of it, with one of the candidates."""
        scenario = run.scenario
        expect = (*scenario.expect[: self.own], self.loaded.scenario.expect[self.own + place])
        return replace(run, scenario=scenario.model_copy(update={"expect": expect}))

    def noticing(self, original: Outcome, mutant: Outcome) -> list[int]:
        """Return the places of the candidates that passed in the original run and noticed the mutant."""
        # A run without a verdict has none of them.
        pairs = zip(self._of(original), self._of(mutant), strict=False)
        return [place for place, pair in enumerate(pairs) if notices(*pair)]

    def text(self, place: int) -> str:
        """Return a candidate as YAML."""
        return entry_text(self.entries[place])

    def _of(self, outcome: Outcome) -> Sequence[ExpectationOutcome]:
        return outcome.expectations[self.own :] if outcome.has_verdict else ()


@dataclass(slots=True)
class Search:
    """The search for the suggestion of one survivor."""

    offer: Candidates
    mutant: LoadedScenario
    places: list[int]  # of the candidates that are left, the simplest first
    suggestion: str = ""  # as YAML, once a candidate alone has passed the original run and noticed the mutant; or empty

    @property
    def pair(self) -> tuple[LoadedScenario, LoadedScenario]:
        """The original run and the mutant's run, with the next candidate alone."""
        return self.offer.alone(self.places[0], self.offer.loaded), self.offer.alone(self.places[0], self.mutant)

    def decide(self, original: Outcome, mutant: Outcome) -> None:
        """Take the outcomes of the pair."""
        place = self.places.pop(0)
        if self.offer.noticing(original, mutant):
            self.suggestion = self.offer.text(place)
            self.places = []


def candidates(
    original: Original, permissions: Permissions, libraries: Libraries, joints: Collection[str] = ()
) -> Candidates | None:
    """Return the candidates that are valid in the scenario, if any; `joints`: joints that moved most differently."""
    entries = list(_entries(original, joints))
    for kept in (entries, [entry for entry in entries if _with(original, [entry], permissions, libraries) is not None]):
        if kept and (loaded := _with(original, kept, permissions, libraries)) is not None:
            return Candidates(kept, loaded, len(original.scenario.expect))
    return None


def _with(
    original: Original, entries: Sequence[Entry], permissions: Permissions, libraries: Libraries
) -> LoadedScenario | None:
    """Return the original scenario with more expectations; None if it is invalid with them."""
    source = original.loaded.source
    data = source.document.data
    assert isinstance(data, dict)  # the loader has looked
    own = data["expect"] if isinstance(data["expect"], tuple) else (data["expect"],)
    document = replace(source.document, data={**data, "expect": (*own, *entries)})
    try:
        loaded = checked(replace(source, document=document), permissions, libraries)
    except InvalidScenario:
        return None
    ours = original.scenario
    scenario = ours.model_copy(update={"expect": loaded.scenario.expect})
    return replace(original.loaded, scenario=scenario, mutation=Mutation())


def _entries(original: Original, joints: Collection[str]) -> Iterator[Entry]:
    """Yield all candidates, the simplest first."""
    places, trace = original.trace.base_position_xyz, original.trace
    drives = float(np.ptp(places, axis=0).max()) >= LEAST_DISTANCE_M
    turns = float(trace.yaw_error_to(float(trace.yaw[0])).max()) >= LEAST_ANGLE
    objects = original.scenario.world.objects
    if objects:
        yield "no_collision"
    if not (drives or turns):
        yield from _of_joints(original, joints)
    yield {"stay_within": {axis: _bounds(places[:, column]) for column, axis in enumerate("xy")}}
    x, y, z = (round(value, _DIGITS) + 0.0 for value in places[-1].tolist())
    yield {"final_pose": {"x": x, "y": y, "tolerance": _TOLERANCE_M}}
    yield {"final_pose": {"x": x, "y": y, "yaw": _degrees(float(trace.yaw[-1])), "tolerance": _TOLERANCE_M}}
    if objects:
        yield from ({"clearance": {"at_least": distance}} for distance in _CLEARANCES_M)
    points = _corners(original.way_xy)
    if len(points) > 1:
        yield {"follow_path": {"path": tuple(points), "max_error": _TOLERANCE_M}}
    if drives:
        away = trace.planar_distance_to(x, y)
        yield {"reach": {"x": x, "y": y, "tolerance": _TOLERANCE_M}, "before": _before(original, away, _TOLERANCE_M)}
        yield {"max_speed": {"linear": round(_FASTER * float(trace.speed.max()) + 0.01, _DIGITS)}}
    if turns:
        yield {"max_speed": {"angular": round(_FASTER * float(trace.turn_rate.max()) + 0.01, _DIGITS)}}
    if drives or turns:
        yield _halfway(original)
    yield {"stay_within": {"z": _bounds(places[:, 2])}}
    yield {"final_pose": {"z": z, "tolerance": _TOLERANCE_M}}


def _halfway(original: Original) -> Entry:
    """Return the pose at half of the time, with a deadline: for a robot that only turns, or that returns."""
    row = len(original.trace) // 2
    x, y = (round(value, _DIGITS) + 0.0 for value in original.way_xy[row].tolist())
    yaw = float(original.trace.yaw[row])
    off = original.trace.planar_distance_to(x, y) / _TOLERANCE_M
    turned = original.trace.yaw_error_to(yaw) / _TOLERANCE_RAD
    before = _before(original, np.maximum(off, turned), 1.0)
    return {"reach": {"x": x, "y": y, "yaw": _degrees(yaw), "tolerance": _TOLERANCE_M}, "before": before}


def _degrees(angle: float) -> str:
    return f"{round(math.degrees(angle))} deg"


def _before(original: Original, away: FloatArray, tolerance: float) -> float:
    reached = float(original.trace.time[int(np.argmax(away <= tolerance))])
    return round(reached + _LATER_S, _DIGITS)


def _of_joints(original: Original, changed: Collection[str]) -> Iterator[Entry]:
    """Yield entries for ranges, last positions and speeds of the joints that moved most, and of changed ones."""
    names, velocities = original.trace.joint_names, original.trace.joint_velocity
    positions = original.trace.joint_position
    ways = np.ptp(positions, axis=0).round(_DIGITS).tolist()
    most = sorted(range(len(ways)), key=lambda column: -ways[column])[:_MOST_JOINTS]
    moved = [column for column in most if ways[column] > _TOLERANCE_RAD]
    others = [column for column, name in enumerate(names) if name in changed and column not in moved]
    ranges = {names[column]: _bounds(positions[:, column]) for column in moved}
    if ranges:
        yield {"joint_within": {"position": ranges}}
    for column in moved:
        name, position = names[column], round(float(positions[-1, column]), _DIGITS)
        before = _before(original, np.abs(positions[:, column] - position), _TOLERANCE_RAD)
        yield {"joint": {"name": name, "near": position, "tolerance": _TOLERANCE_RAD}, "before": before}
    for column in others:
        yield {"joint_within": {"position": {names[column]: _bounds(positions[:, column])}}}
    for column in (*moved, *others):
        fastest = round(_FASTER * float(np.abs(velocities[:, column]).max()) + _LEAST_SPEED, _DIGITS)
        yield {"joint_within": {"velocity": {names[column]: (-fastest, fastest)}}}


def _bounds(values: FloatArray) -> tuple[float, float]:
    lower, upper = float(values.min()) - _TOLERANCE_M, float(values.max()) + _TOLERANCE_M
    return math.floor(lower * 100) / 100, math.ceil(upper * 100) / 100


def _corners(way_xy: FloatArray) -> list[dict[str, float]]:
    """Return the points of a path that is never farther than half the tolerance from the way (Douglas and Peucker)."""
    kept = {0, len(way_xy) - 1}
    waiting = [(0, len(way_xy) - 1)]
    while waiting and len(kept) < _MOST_POINTS:
        first, last = waiting.pop(0)
        if last - first < 2:
            continue
        away = _distances(way_xy[first + 1 : last], way_xy[first], way_xy[last])
        index = first + 1 + int(np.argmax(away))
        if away.max() > _TOLERANCE_M / 2:
            kept.add(index)
            waiting += [(first, index), (index, last)]
    points = [tuple(round(value, _DIGITS) + 0.0 for value in way_xy[index].tolist()) for index in sorted(kept)]
    several = [point for place, point in enumerate(points) if place == 0 or point != points[place - 1]]
    return [{"x": x, "y": y} for x, y in several]


def _distances(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distances of points from a straight line between two others, in m."""
    way = end - start
    length = float(way @ way)
    shares = np.clip((points - start) @ way / length, 0.0, 1.0) if length else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - start - shares[:, None] * way, axis=1), dtype=np.float64)


def entry_text(entry: Entry) -> str:
    """Return an entry of `expect` as YAML to paste."""
    if isinstance(entry, str):
        return f"- {entry}"
    return "- " + "\n  ".join(f"{key}: {_flow(value)}" for key, value in entry.items())


def _flow(value: object) -> str:
    """Return a value in YAML's flow style, on one line."""
    listed = yaml.safe_dump(
        [_plain(value)], default_flow_style=True, sort_keys=False, width=math.inf, allow_unicode=True
    )
    return listed.strip()[1:-1]


def _plain(value: object) -> object:
    """Return a value with short numbers, and lists in place of tuples."""
    if isinstance(value, Mapping):
        return {key: _plain(nested) for key, nested in value.items()}
    if isinstance(value, tuple):
        return list(map(_plain, value))
    if isinstance(value, float):
        short = float(f"{value:g}")
        return int(short) if short.is_integer() else short
    return value
