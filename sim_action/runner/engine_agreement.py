"""The agreement of engines on a scenario: the differences of their runs at equal times, and their verdicts.

All physics steps are compared, independent of the rate of the stored traces. Limits become expectations of the last
outcome that has a verdict; differences without a limit become its measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.core.yaml_document import KeyPath
from sim_action.results.outcome import ExpectationOutcome, Measurement, Outcome
from sim_action.robot.model.joint_selection import matches_name
from sim_action.scenario.model import MAX_COMPARED_STEPS, Agreement, LoadedScenario, PoseAgreement
from sim_action.state.trace import rotation_angles
from sim_action.state.trace_storage import MotionRecord, TraceError
from sim_action.state.verdict import VERBS, Judged, Verdict

_KEY: Final = "agreement"
# In s of sim time: equal moments differ by rounding only.
_SAME_TIME_S: Final = 1e-9
_TOO_LONG: Final = (
    f"the motion in both engines was not compared: time_limit has more than {MAX_COMPARED_STEPS:,} physics steps"
)


def with_agreement(
    loaded: LoadedScenario, outcomes: tuple[Outcome, ...], motions: Sequence[Path | None]
) -> tuple[Outcome, ...]:
    """Return the outcomes of several engines, the last one with comparisons; `motions`: the file of each motion."""
    if len(outcomes) == 1:
        return (_alone(outcomes[0]),) if loaded.scenario.agreement else outcomes
    judged = [index for index, outcome in enumerate(outcomes) if outcome.has_verdict]
    if not judged or any(outcome.status == "skipped" for outcome in outcomes):
        return outcomes
    last = judged[-1]
    runs = [_Run(outcome, path) for outcome, path in zip(outcomes, motions, strict=True)]
    comparisons = [_Comparison(loaded, run, runs[last]) for index, run in enumerate(runs) if index != last]
    expectations = (*outcomes[last].expectations, *(expected for one in comparisons for expected in one.expectations()))
    notes = () if loaded.compared else (_TOO_LONG,)
    compared = outcomes[last].model_copy(
        update={
            "notes": (*outcomes[last].notes, *notes),
            "expectations": expectations,
            "measurements": tuple(measurement for one in comparisons for measurement in one.measurements()),
        }
    )
    compared = compared.model_copy(update={"status": compared.judged_status(is_varied=loaded.source.group is not None)})
    return tuple(compared if index == last else outcome for index, outcome in enumerate(outcomes))


def _alone(outcome: Outcome) -> Outcome:
    note = "agreement was not judged: the command line selects one engine"
    return outcome.model_copy(update={"notes": (*outcome.notes, note)})


@dataclass(frozen=True)
class _Run:
    """An outcome and the file of its motion."""

    outcome: Outcome
    path: Path | None

    @property
    def engine(self) -> str:
        """The engine, also if the run ended before it could name it."""
        return self.outcome.engine or self.outcome.name.rpartition("[")[2].rstrip("]")

    @cached_property
    def motion(self) -> MotionRecord | None:
        """The motion; None if there is none. User code can write anything into its file."""
        try:
            record = None if self.path is None else MotionRecord.load(self.path)
        except TraceError:
            return None
        return record if record is not None and record.is_finite else None


class _Difference(NamedTuple):
    """The largest difference of two engines in one quantity."""

    what: str  # the name of the quantity, such as "position"
    measured: float  # the difference in `unit`, at the sim time `time` in s
    unit: str
    time: float
    limit: float | None  # the allowed difference in `unit`; None: it is only measured
    judged: Judged  # the compared moments


class _Quantity(NamedTuple):
    """A quantity that is compared."""

    name: str  # the name without the engine, such as "the same position as" or "distance to"
    path: KeyPath  # the keys of its limit in the scenario
    # returns the largest difference of two motions at equal times; None if no moment can be compared
    largest: Callable[[MotionRecord, MotionRecord], _Difference | None]


@dataclass(frozen=True)
class _Comparison:
    """A comparison of one run, `last`, with the run of another engine."""

    loaded: LoadedScenario
    other: _Run
    last: _Run

    def expectations(self) -> Iterator[ExpectationOutcome]:
        """Yield the comparison of verdicts, and one for each limit."""
        yield self._expectation(f"the same verdicts as {self.other.engine}", (_KEY,), self._verdicts())
        if self._asked is None or not self.other.outcome.has_verdict:
            return
        for quantity in _limited(self._asked, self.loaded):
            verdict = self._verdict(self._largest(quantity))
            yield self._expectation(f"{quantity.name} {self.other.engine}", quantity.path, verdict)

    def measurements(self) -> Iterator[Measurement]:
        """Yield the differences without a limit."""
        if self._motions is None or not self.other.outcome.has_verdict:
            return
        for quantity in _unlimited(self._asked, self._motions[0]):
            difference = self._largest(quantity)
            if difference is not None:
                yield Measurement(
                    name=f"{quantity.name} {self.other.engine}",
                    measured=difference.measured,
                    unit=difference.unit,
                    time=difference.time,
                    message=self._message(difference),
                )

    @property
    def _asked(self) -> Agreement | None:
        return self.loaded.scenario.agreement

    @cached_property
    def _motions(self) -> tuple[MotionRecord, MotionRecord] | None:
        """The motions at their common moments; None if they cannot be compared."""
        ours, theirs = self.last.motion, self.other.motion
        if ours is None or theirs is None or not _are_alike(ours, theirs):
            return None
        ours, theirs = at_the_same_times(ours, theirs)
        return (ours, theirs) if len(ours) else None

    def _largest(self, quantity: _Quantity) -> _Difference | None:
        return None if self._motions is None else quantity.largest(*self._motions)

    def _expectation(self, name: str, path: KeyPath, verdict: Verdict) -> ExpectationOutcome:
        return ExpectationOutcome(
            name=name,
            assertion=_KEY,
            severity="warning" if self._asked is None else "error",
            location=self.loaded.document.location(path),
            verdict=verdict,
            unexercised=self.loaded.scenario.unexercised or "error",
        )

    def _verdicts(self) -> Verdict:
        different = list(self._different_verdicts())
        message = "; ".join(different) or f"judged as in {self.other.engine}"
        return Verdict(not different, None, None, None, "", None, message)

    def _different_verdicts(self) -> Iterator[str]:
        last, other = self.last.outcome, self.other.outcome
        if not other.has_verdict:
            yield f"{self.other.engine} gave no verdict"
            return
        for ours, theirs in zip(last.expectations, other.expectations, strict=True):
            verdicts = [(ours.verdict.status, self.last.engine), (theirs.verdict.status, self.other.engine)]
            better, worse = sorted(verdicts, key=lambda pair: tuple(VERBS).index(pair[0]))
            if better[0] != worse[0]:
                yield f"'{ours.name}' {VERBS[better[0]]} in {better[1]} and {VERBS[worse[0]]} in {worse[1]}"

    def _verdict(self, difference: _Difference | None) -> Verdict:
        """Return the verdict at the moment of the largest difference."""
        if difference is None or difference.limit is None:
            message = f"never checked: the run has no moment in common with that of {self.other.engine}"
            return Verdict(False, message=message, judged=Judged())
        margin = difference.limit - difference.measured
        message = f"{self._message(difference)}; allowed: {units.display(difference.limit, difference.unit)}"
        return Verdict(
            margin >= 0,
            difference.measured,
            difference.limit,
            margin,
            difference.unit,
            difference.time,
            message,
            judged=difference.judged,
        )

    def _message(self, difference: _Difference) -> str:
        measured, engine = units.display(difference.measured, difference.unit), self.other.engine
        return (
            f"{difference.what} differs from {engine} by at most {measured}, at {difference.time:.2f} s{self._ending}"
        )

    @cached_property
    def _ending(self) -> str:
        """The end of the comparison, if one run is longer; empty if both end at the same time."""
        runs = [run for run in (self.last, self.other) if run.motion is not None]
        first, then = sorted((float(run.motion.time[-1]), run.engine) for run in runs if run.motion is not None)
        if then[0] - first[0] <= _SAME_TIME_S:
            return ""
        return f" (compared until {first[0]:.4g} s, where the run in {first[1]} ended; {then[1]} ran {then[0]:.4g} s)"


def _limited(asked: Agreement, loaded: LoadedScenario) -> Iterator[_Quantity]:
    """Yield the quantities that have a limit."""
    if asked.position is not None:
        yield _Quantity(
            "the same position as", (_KEY, "position"), _distance(_Measure("position", "m", asked.position))
        )
    if asked.yaw is not None:
        yield _Quantity("the same yaw as", (_KEY, "yaw"), _yaw(_Measure("yaw", "rad", asked.yaw)))
    for name, written in asked.joints.items():
        title = f"the same position of {'joints' if '*' in name else 'joint'} '{name}' as"
        yield _Quantity(title, (_KEY, "joints", name), _joints(name, written))
    for name, limits in asked.links.items():
        yield from _of_poses(limits, ("links", name), f"link '{name}'")
    arrivals = {body.name: body.appears or 0.0 for body in loaded.scenario.world.objects}
    for name, limits in asked.bodies.items():
        yield from _of_poses(limits, ("bodies", name), f"body '{name}'", arrivals.get(name, 0.0))


def _of_poses(limits: PoseAgreement, place: tuple[str, str], what: str, since: float = 0.0) -> Iterator[_Quantity]:
    """Yield the quantities of one link or body; `place`: its group and name."""
    if limits.position is not None:
        measure = _Measure(f"position of {what}", "m", limits.position, since)
        yield _Quantity(f"the same {measure.what} as", (_KEY, *place, "position"), _distance(measure, place))
    if limits.orientation is not None:
        measure = _Measure(f"orientation of {what}", "rad", limits.orientation, since)
        yield _Quantity(f"the same {measure.what} as", (_KEY, *place, "orientation"), _angle(measure, place))


def _unlimited(asked: Agreement | None, motion: MotionRecord) -> Iterator[_Quantity]:
    """Yield the quantities that are measured for information: of the base, or of the joints if the base is fixed."""
    if motion.bolted:
        kinds = (("rad", "turning"), ("m", "sliding")) if asked is None or not asked.joints else ()
        for unit, kind in kinds:
            if unit in motion.units.values():
                yield _Quantity(f"difference of {kind} joints to", (_KEY,), _joints("*", None, unit))
        return
    if asked is None or asked.position is None:
        yield _Quantity("distance to", (_KEY,), _distance(_Measure("position", "m")))
    if asked is None or asked.yaw is None:
        yield _Quantity("difference in yaw to", (_KEY,), _yaw(_Measure("yaw", "rad")))


class _Measure(NamedTuple):
    """The name, the unit and the limit of a difference; moments before `since`, in s, do not count."""

    what: str
    unit: str
    limit: float | None = None
    since: float = 0.0

    def largest(self, time: FloatArray, apart: FloatArray) -> _Difference | None:
        """Return the largest of the differences (T,); None if there is none."""
        first = int(np.searchsorted(time, self.since - _SAME_TIME_S))
        if first >= len(time):
            return None
        worst = first + int(apart[first:].argmax())
        judged = Judged(len(time) - first, float(time[first]), float(time[-1]))
        return _Difference(self.what, float(apart[worst]), self.unit, float(time[worst]), self.limit, judged)


_Largest = Callable[[MotionRecord, MotionRecord], _Difference | None]


def _distance(measure: _Measure, place: tuple[str, str] | None = None) -> _Largest:
    def largest(ours: MotionRecord, theirs: MotionRecord) -> _Difference | None:
        apart = _poses(ours, place)[:, :3] - _poses(theirs, place)[:, :3]
        return measure.largest(ours.time, np.sqrt(np.square(apart).sum(axis=1)))

    return largest


def _angle(measure: _Measure, place: tuple[str, str]) -> _Largest:
    def largest(ours: MotionRecord, theirs: MotionRecord) -> _Difference | None:
        return measure.largest(ours.time, rotation_angles(_poses(ours, place)[:, 3:], _poses(theirs, place)[:, 3:]))

    return largest


def _yaw(measure: _Measure) -> _Largest:
    def largest(ours: MotionRecord, theirs: MotionRecord) -> _Difference | None:
        return measure.largest(ours.time, np.abs(np.remainder(ours.yaw - theirs.yaw + np.pi, 2 * np.pi) - np.pi))

    return largest


def _joints(pattern: str, written: float | str | None, unit: str | None = None) -> _Largest:
    """Return the comparison of the joints that a pattern matches, or of those with a unit: the worst one counts."""
    limit = None if written is None else units.parse(written, units.ANGLE, units.LENGTH)

    def largest(ours: MotionRecord, theirs: MotionRecord) -> _Difference | None:
        differences = [
            _Measure(f"position of joint '{name}'", ours.units[name], limit).largest(
                ours.time, np.abs(positions - theirs.joints[name])
            )
            for name, positions in ours.joints.items()
            if matches_name(pattern, name) and unit in (None, ours.units[name])
        ]
        return max(
            (difference for difference in differences if difference is not None),
            key=lambda difference: difference.measured,
            default=None,
        )

    return largest


def _poses(motion: MotionRecord, place: tuple[str, str] | None) -> FloatArray:
    """Return the poses (T, 7) of a link or body, or of the base."""
    if place is None:
        return motion.base
    group, name = place
    return (motion.links if group == "links" else motion.bodies)[name]


def _are_alike(ours: MotionRecord, theirs: MotionRecord) -> bool:
    """Return True if two motions are of the same joints, links and bodies."""
    groups = ("joints", "links", "bodies")
    return ours.units == theirs.units and all(
        getattr(ours, group).keys() == getattr(theirs, group).keys() for group in groups
    )


def at_the_same_times(first: MotionRecord, second: MotionRecord) -> tuple[MotionRecord, MotionRecord]:
    """Return the moments that both motions have; both start at 0, and one may end earlier."""
    if not len(first) or not len(second):
        return first.rows(np.empty(0, np.intp)), second.rows(np.empty(0, np.intp))
    indices = np.searchsorted(second.time, first.time - _SAME_TIME_S)
    inside = np.minimum(indices, len(second) - 1)
    same = np.abs(second.time[inside] - first.time) <= _SAME_TIME_S
    return first.rows(np.flatnonzero(same)), second.rows(inside[same])
