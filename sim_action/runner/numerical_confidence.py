"""The numerical confidence of verdicts: repetitions of a run with half the step, another start and another engine.

Each repetition has one change. Its margin is compared with the margin of the run itself. The change leaves open an
interval around the margin: a verdict whose interval contains the limit is inconclusive, as is one that a repetition
judges otherwise. The error of a method of first order halves with the step, so the whole error is twice the difference
to half the step. With a quarter of the step, Richardson's extrapolation replaces this assumption.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from sim_action.core import units
from sim_action.core.errors import ExitCode, InvalidScenario, UsageError
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import shortened
from sim_action.engines import ENGINES, chosen
from sim_action.results.outcome import ExpectationOutcome, Measurement, Outcome, Repetition, Spread, repetition_name
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.scenario.mutation import Mutation
from sim_action.state.trace import Trace
from sim_action.state.verdict import VERBS, Verdict
from sim_action.world import MAX_PHYSICS_RATE_HZ

_MAX_ENDING: Final = 1_000
_TURN: Final = math.radians(1)
_SHIFT_M: Final = 1e-3 / math.sqrt(2)
_FIRST_ORDER: Final = 2.0
_ROUNDING: Final = 1e-9  # differences below this share of the greatest value are rounding
_LEAST_RATIO: Final = 2**0.25  # the least ratio of two differences that shows a convergence: for an order of 1/4
# Motions diverge if they differ by this share of their range; smaller ranges in m or rad count as this one.
_DIVERGENT: Final = 0.5
_LEAST_RANGE: Final = 0.1


@dataclass(frozen=True, slots=True)
class _Cause:
    """A change of a repetition."""

    doing: str  # the change in a sentence, such as "halving the step"
    factor: float = 1.0  # the error that the change leaves open, in its differences
    rate: int = 1  # the factor of the rate of the physics
    # key of the start of the robot -> the amount that is added
    moved: Mapping[str, float] = field(default_factory=dict)
    engine: str | None = None  # None: the engine of the run

    def changed(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the change."""
        # All rates that divide the rate of the physics divide its multiples, too.
        physics = scenario.physics.model_copy(update={"rate": self.rate * scenario.physics.rate})
        pose = scenario.robot.pose
        moved = pose.model_copy(update={key: getattr(pose, key) + value for key, value in self.moved.items()})
        # A keyframe still states what the scenario does not.
        moved.model_fields_set.intersection_update(pose.model_fields_set)
        robot = scenario.robot.model_copy(update={"pose": moved})
        backend = self.engine or scenario.backend
        return scenario.model_copy(update={"physics": physics, "robot": robot, "backend": backend})


_HALF: Final = "half the step"
_QUARTER: Final = "a quarter of the step"
_CAUSES: Final[Mapping[str, _Cause]] = MappingProxyType(
    {
        _HALF: _Cause("halving the step", factor=_FIRST_ORDER, rate=2),
        # The difference to a quarter of the step is 3/4 of the whole error.
        _QUARTER: _Cause("quartering the step", factor=4 / 3, rate=4),
        "the start turned by 1 deg": _Cause("turning the start by 1 deg", moved={"yaw": _TURN}),
        "the start moved by 1 mm": _Cause("moving the start by 1 mm", moved={"x": _SHIFT_M, "y": _SHIFT_M}),
    }
)


def _cause(name: str) -> _Cause:
    """Return a change by its name; the names of the engines are changes, too."""
    engines = {engine.title: _Cause(f"running it on {engine.title}", engine=key) for key, engine in ENGINES.items()}
    return _CAUSES[name] if name in _CAUSES else engines[name]


def _changes(loaded: LoadedScenario) -> Iterator[tuple[str, float, bool]]:
    """Yield the names of the changes of a run, the rate in Hz of the physics with each, and whether it is allowed."""
    for name, cause in _CAUSES.items():
        is_asked = name != _QUARTER or loaded.scenario.confidence == "full"
        if is_asked and not (cause.moved and loaded.is_fixed):
            rate = cause.rate * loaded.scenario.physics.rate
            yield name, rate, rate <= MAX_PHYSICS_RATE_HZ


def _names(loaded: LoadedScenario) -> Iterator[str]:
    """Yield the names of the changes that apply to a run. Raise UsageError if an engine is missing."""
    scenario = loaded.scenario
    yield from (name for name, _, is_allowed in _changes(loaded) if is_allowed)
    for engine in scenario.engines:
        if engine != scenario.backend:
            if scenario.robot.is_mjcf and ENGINES[engine].mjcf_problem:
                raise UsageError(ENGINES[engine].mjcf_problem)
            yield ENGINES[chosen(engine)].title


def with_repetitions(loaded: LoadedScenario) -> tuple[LoadedScenario, ...]:
    """Return a run whose confidence is asked for, and its repetitions. Raise InvalidScenario."""
    if loaded.source.gate is not None:
        message = "a gate already judges many runs; remove 'confidence' or 'gate'"
        raise InvalidScenario([loaded.document.problem(("confidence",), message)])
    try:
        names = list(_names(loaded))
    except UsageError as error:
        raise InvalidScenario([loaded.document.problem(("engines",), str(error))]) from None
    return tuple(repetition(loaded, name) for name in ("", *names))


def repetition(loaded: LoadedScenario, name: str) -> LoadedScenario:
    """Return the repetition of a run with a change; empty: the run itself, which runs on after a failure."""
    loaded = replace(loaded, mutation=Mutation(looks_ahead=True), repetition=name)
    if not name:
        return loaded
    scenario = _cause(name).changed(loaded.scenario)
    named = scenario.model_copy(update={"name": repetition_name(scenario.name, name)})
    return replace(loaded, scenario=named, compared=False)


def divergence(ours: Trace | None, repetitions: Mapping[str, Trace | None]) -> tuple[Measurement, ...]:
    """Return the first moment at which the motions of a run and of a repetition have nothing in common, if any.

    `repetitions`: by change. Another engine does not count: it has another model of contacts. A start that is turned
    or moved turns or moves the whole motion, so motions are seen from their start.
    """
    pairs = [(name, trace) for name, trace in repetitions.items() if name in _CAUSES and trace is not None]
    several = [(parted, name) for name, trace in pairs if ours is not None and (parted := _parted(ours, trace))]
    if not several:
        return ()
    (at, what, share), name = min(several)
    message = (
        f"chaotic, or at a tipping point: {_CAUSES[name].doing} changes {what} by up to {100 * share:.0f} % of its "
        f"range; places and times after {at:.2f} s are those of this run alone"
    )
    return (Measurement(name="divergence of the motion", measured=share, time=at, message=message),)


def _parted(ours: Trace, theirs: Trace) -> tuple[float, str, float] | None:
    """Return the first time in s at which a quantity diverges, its name, and its largest difference as a share."""
    count = min(len(ours), len(theirs))
    same = np.abs(ours.time[:count] - theirs.time[:count]) < TIME_EPSILON_S
    parted = []
    for (what, mine), (_, others) in zip(_motion(ours), _motion(theirs), strict=True):
        apart = np.linalg.norm(mine[:count][same] - others[:count][same], axis=1)
        apart /= max(float(np.linalg.norm(np.ptp(mine, axis=0))), _LEAST_RANGE)
        if len(apart) and apart.max() > _DIVERGENT:
            at = ours.time[:count][same][np.argmax(apart > _DIVERGENT)]
            parted.append((float(at), what, float(apart.max())))
    return min(parted, default=None)


def _motion(trace: Trace) -> Iterator[tuple[str, FloatArray]]:
    """Yield the quantities of a motion, (T, N) each: position and heading seen from the start, and the joints."""
    heading = trace.yaw[0]
    moved = trace.base_position_xyz - trace.base_position_xyz[0]
    cosine, sine = np.cos(heading), np.sin(heading)
    yield "the position", moved @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    yield "the heading", np.unwrap(trace.yaw)[:, None] - heading
    yield from (
        (f"joint {name}", column[:, None])
        for name, column in zip(trace.joint_names, trace.joint_position.T, strict=True)
    )


def with_confidence(
    loaded: LoadedScenario, outcome: Outcome, runs: Mapping[str, Outcome], measurements: Sequence[Measurement] = ()
) -> Outcome:
    """Return the outcome of a run with the confidence of its verdicts; `runs`: change -> outcome of its repetition."""
    repetitions = tuple(_repetition(cause, run) for cause, run in runs.items())
    left_out = (
        f"no repetition with {name}: a physics rate of {rate:g} Hz is more than is allowed"
        for name, rate, is_allowed in _changes(loaded)
        if not is_allowed
    )
    endings = (f"with {one.cause}: {one.ending}" for one in repetitions if one.status in ("error", "skipped"))
    outcome = outcome.model_copy(
        update={
            "repetitions": repetitions,
            "measurements": (*outcome.measurements, *measurements),
            "wall_time": outcome.wall_time + sum(run.wall_time for run in runs.values()),
            "notes": (*outcome.notes, *left_out, *endings),
        }
    )
    if not outcome.has_verdict:
        return outcome
    # The call did not come to some of them, or sim-action has a fault: that says nothing about the run.
    for other in runs.values():
        if other.status == "skipped" or other.exit_code in (ExitCode.INTERRUPTED, ExitCode.INTERNAL):
            return other.model_copy(update={"name": outcome.name, "repetitions": repetitions})
    ended = outcome.sim_time or 0.0
    pairs = enumerate(outcome.expectations)
    judged = tuple(_judged(loaded, place, expected, runs, ended) for place, expected in pairs)
    outcome = outcome.model_copy(update={"expectations": judged})
    return outcome.model_copy(update={"status": outcome.judged_status(is_varied=loaded.source.group is not None)})


def _repetition(cause: str, outcome: Outcome) -> Repetition:
    return Repetition(
        cause=cause,
        status=outcome.status,
        ending=shortened(outcome.ending, _MAX_ENDING),
        sim_time=outcome.sim_time,
        wall_time=outcome.wall_time,
        engine=outcome.engine,
        digest=outcome.digest,
        replay=outcome.replay,
    )


def _judged(
    loaded: LoadedScenario, place: int, expected: ExpectationOutcome, runs: Mapping[str, Outcome], ended: float
) -> ExpectationOutcome:
    """Return an expectation with what the repetitions say about it; `ended`: its sim time in s."""
    verdict = expected.verdict
    if verdict.cut_off or verdict.status == "not_exercised":
        return expected
    end = min(loaded.scenario.expect[place].before, loaded.scenario.time_limit if verdict.goal else ended)
    compared = [_Compared(cause, verdict, run, place, end) for cause, run in runs.items()]
    spreads = tuple(_with_order([one.spread for one in compared], compared))
    open_ones = [(one, spread) for one, spread in zip(compared, spreads, strict=True) if not spread.is_decided]
    # A quarter of the step has the reason of half the step.
    repeated = {_QUARTER} if any(one.cause == _HALF for one, _ in open_ones) else set[str]()
    reasons = [one.words(spread) for one, spread in open_ones if one.cause not in repeated]
    changed: dict[str, object] = {"spreads": spreads, "inconclusive": loaded.scenario.inconclusive}
    if reasons:
        message = f"{_result(open_ones[0][0])}, but {'; '.join(reasons)} ({verdict.message})"
        # A failure that is open stays one where open verdicts are accepted.
        is_kept = verdict.status == "failed" and loaded.scenario.inconclusive == "warn"
        open_one = replace(verdict, message=message)
        changed["verdict"] = open_one if is_kept else replace(open_one, passed=False, inconclusive="numerical")
    return expected.model_copy(update=changed)


def _result(compared: _Compared) -> str:
    passed, values = compared.ours.passed, compared.values
    verb = "passes" if passed else "fails"
    if values is None or compared.is_count:
        return verb
    margin = units.display(abs(values[1]), compared.unit)
    if not compared.is_by_time:
        return f"{verb} by {margin}"
    return f"passes with {margin} left" if passed else f"fails {margin} before the end"


class _Compared:
    """An expectation in the run and in one repetition."""

    def __init__(self, cause: str, verdict: Verdict, run: Outcome, place: int, end: float) -> None:
        """Compare a verdict with that at a place of `run`; `end`: the sim time in s until which it is judged."""
        self.cause, self.ours = cause, verdict
        self._ending = shortened(run.ending, _MAX_ENDING)
        self.theirs = run.expectations[place].verdict if run.has_verdict else None  # None: the repetition has none
        verdicts = (verdict,) if self.theirs is None else (verdict, self.theirs)
        pair = _pair(map(_values, verdicts)) if len({run_verdict.unit for run_verdict in verdicts}) == 1 else None
        times = _pair(_time_left(run_verdict, end) for run_verdict in verdicts)
        has_extremes = pair is not None and all(run_verdict.extreme is not None for run_verdict in verdicts)
        # The moments of decision are compared if their interval is wider than the interval of the extreme margins.
        self.is_by_time = times is not None and not (has_extremes and _openness(pair) > _openness(times))
        self.unit = "s" if self.is_by_time else verdict.unit
        # The measured value and the margin of the run and of the repetition; None: they are not comparable.
        compared = times if self.is_by_time else pair
        self.values: _Values | None = compared and compared[0]
        self.others: _Values | None = compared and compared[1]

    @property
    def is_count(self) -> bool:
        """True if the values are whole numbers, so that only another verdict says something."""
        several = [value for pair in (self.values, self.others) if pair is not None for value in pair]
        return self.unit == "contacts" or (not self.unit and all(value.is_integer() for value in several))

    @property
    def difference(self) -> float | None:
        """The margin of the repetition minus the margin of the run; None if they cannot be compared."""
        return None if self.values is None or self.others is None else self.others[1] - self.values[1]

    @property
    def spread(self) -> Spread:
        """The spread, from this repetition alone."""
        if self.theirs is None:
            return Spread(cause=self.cause, is_decided=False)
        measured, margin = self.others or (self.theirs.measured, self.theirs.margin)
        spread = Spread(cause=self.cause, status=self.theirs.status, measured=measured, margin=margin, unit=self.unit)
        alike = self.theirs.status == self.ours.status
        if self.difference is None or self.is_count:
            return spread.model_copy(update={"is_decided": alike})
        return self.within(spread, _cause(self.cause).factor * abs(self.difference))

    def within(self, spread: Spread, error: float) -> Spread:
        """Return the spread with the bounds that an error of the margin gives."""
        assert self.values is not None
        assert self.theirs is not None
        margin = self.values[1]
        decided = self.theirs.status == self.ours.status and (abs(margin) > error or error == 0)
        return spread.model_copy(update={"low": margin - error, "high": margin + error, "is_decided": decided})

    def words(self, spread: Spread) -> str:
        """Return the reason why the repetition leaves the verdict open."""
        doing = _cause(self.cause).doing
        if self.theirs is None:
            return f"with {self.cause} there is no verdict: {self._ending}"
        if self.difference is None or self.is_count:
            message = shortened(self.theirs.message, _MAX_ENDING)
            return f"with {self.cause} it {VERBS[self.theirs.status]}: {message}; it jumps between these runs"
        moved = f"{doing} moves it by {units.display(abs(self.difference), self.unit)}"
        error = 0.0 if spread.high is None or self.values is None else spread.high - self.values[1]
        if error > abs(self.difference) and self.theirs.status == self.ours.status:
            moved += f", so the error may be {units.display(error, self.unit)}"
        return f"{moved} ({spread.note})" if spread.note else moved


_Values = tuple[float, float]  # a measured value and its margin


def _pair(several: Iterable[_Values | None]) -> tuple[_Values, _Values] | None:
    """Return the values of the run and of a repetition; None if one of them has none."""
    first, *others = several
    return None if first is None or not others or others[0] is None else (first, others[0])


def _time_left(verdict: Verdict, end: float) -> _Values | None:
    """Return the time in s of a decision, and the time left or missed; None if the end decided it."""
    at = verdict.time
    if at is None or verdict.goal != verdict.passed or not (verdict.goal or at < end - TIME_EPSILON_S):
        return None
    return at, (1 if verdict.passed else -1) * (end - at)


def _values(verdict: Verdict) -> _Values | None:
    """Return the measured value and the margin at the extreme step; None if no margin can be compared."""
    margin, extreme, limit, measured = verdict.margin, verdict.extreme, verdict.limit, verdict.measured
    if verdict.cut_off or margin is None or not math.isfinite(margin):
        return None
    if extreme is None or limit is None or measured is None:
        return None if verdict.goal and verdict.passed else (margin if measured is None else measured, margin)
    # A value above a lower limit has a positive margin, above an upper limit a negative one.
    sign = math.copysign(1.0, (measured - limit) * margin)
    return limit + sign * extreme, extreme


def _openness(pair: tuple[_Values, _Values] | None) -> float:
    """Return the difference of two margins as a share of the first; nothing is open without them."""
    (_, margin), (_, other) = pair or ((0.0, 1.0), (0.0, 1.0))
    return abs(other - margin) / abs(margin) if margin else math.inf


def _with_order(spreads: Sequence[Spread], compared: Sequence[_Compared]) -> Iterator[Spread]:
    """Yield the spreads; with a quarter of the step, an extrapolation gives the errors of the step."""
    by_cause = {one.cause: one for one in compared}
    half, quarter = by_cause.get(_HALF), by_cause.get(_QUARTER)
    order = None if half is None or quarter is None else _extrapolated(half, quarter)
    for spread, one in zip(spreads, compared, strict=True):
        is_step = one is half or one is quarter
        if order is None or not is_step or spread.low is None:
            yield spread
        else:
            error, note = order
            yield one.within(spread.model_copy(update={"note": note}), error)


def _extrapolated(half: _Compared, quarter: _Compared) -> tuple[float, str] | None:
    """Return the error of the step by Richardson's extrapolation, and a remark; None if nothing can be compared."""
    first, both = half.difference, quarter.difference
    if first is None or both is None or half.values is None or half.unit != quarter.unit:
        return None
    second = both - first
    margin = half.values[1]
    rounding = _ROUNDING * max(1.0, abs(margin))
    if abs(second) <= rounding:
        return abs(first), f"it converges to {units.display(margin + both, half.unit)}"
    ratio = first / second
    if ratio < _LEAST_RATIO:
        return _FIRST_ORDER * max(abs(first), abs(both)), "it does not converge"
    error = first * ratio / (ratio - 1)
    at = units.display(margin + error, half.unit)
    return abs(error), f"it converges to {at} with order {math.log2(ratio):.2g}"
