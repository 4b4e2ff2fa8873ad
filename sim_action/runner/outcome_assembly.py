"""The final outcomes of a call: of scenarios that cannot run, and of runs that have ended.

Most outcomes are final when their run has ended. With `--repeat` an outcome combines several runs. With several engines
the outcomes of one scenario are compared.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode
from sim_action.core.records import dataclass, replace
from sim_action.results.artifacts import stored_file
from sim_action.results.journal import Event, Finished, Listener, Planned, Record, RunEnded
from sim_action.results.outcome import Failure, Outcome, Repeats
from sim_action.runner.child_outcome import TOO_SLOW, unjudged
from sim_action.runner.run_plan import Plan, motion_file
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.sharing import share_parts
from sim_action.scenario.source import Refused
from sim_action.state.trace import Divergence, Trace, first_divergence
from sim_action.state.trace_storage import TraceError, load_trace
from sim_action.state.verdict import Verdict


def planned_outcomes(plans: Sequence[Plan], of_patterns: Sequence[Outcome]) -> list[Planned]:
    """Return the outcomes that a call will have, in order; last those `of_patterns` without a scenario."""
    outcomes = [Outcome.of_refused(plan) if isinstance(plan, Refused) else originals(plan) for plan in plans]
    every = (outcome for one in outcomes for outcome in ([one] if isinstance(one, Outcome) else map(unjudged, one)))
    planned: list[Planned] = []
    for outcome in (*every, *of_patterns):
        planned.append(share_parts(Planned.of(outcome), planned[-1] if planned else None))
    return planned


def originals(plan: tuple[LoadedScenario, ...]) -> tuple[LoadedScenario, ...]:
    """Return the runs of a plan that have an outcome in the results: one for each engine."""
    return tuple(run for run in plan if not run.repetition)


@dataclass(frozen=True, slots=True)
class _Scenario:
    """One scenario that runs."""

    runs: tuple[LoadedScenario, ...]  # its runs, one for each engine
    place: int  # the index of its first outcome in the results
    indices: tuple[int, ...]  # the indices of these runs among all runs
    turns: int  # the number of runs for each of them, with all repetitions
    changes: tuple[str, ...]  # the changes of the repetitions that show the confidence of each run

    @property
    def places(self) -> range:
        """The places of its outcomes."""
        return range(self.place, self.place + len(self.runs))

    @property
    def is_compared(self) -> bool:
        """True if its runs on several engines are compared, or should be."""
        return len(self.runs) > 1 or self.runs[0].scenario.agreement is not None


class OutcomeAssembly:
    """A listener that passes events on, and adds `Finished` for each outcome that becomes final."""

    def __init__(self, plans: Sequence[Plan], repeat: int, folder: Path, motions: Path | None, emit: Listener) -> None:
        """Take the plan of a call.

        Args:
            plans: the scenarios, in the order of the results.
            repeat: the number of runs for each scenario and engine.
            folder: the output folder.
            motions: the folder for the motion of runs that are compared.
            emit: receives the events.
        """
        self.repeat, self._folder, self._motions, self._emit = repeat, folder, motions, emit
        self._scenarios: dict[int, _Scenario] = {}
        self._refused: dict[int, Refused] = {}
        self._ended: dict[int, dict[int, Outcome]] = {}
        self._keys: dict[int, dict[int, str | None]] = {}
        # All runs of these places have ended, and their outcomes are final.
        self._final: set[int] = set()
        self.places: list[int] = []  # for each run, the index of its outcome in the results
        self.first_turns: list[int] = []  # for each run, the number of runs before it with the same place
        place = 0
        for plan in plans:
            if isinstance(plan, Refused):
                self._refused[place] = plan
                place += 1
                continue
            runs = originals(plan)
            several = len(plan) // len(runs)
            first = len(self.places)
            indices = tuple(range(first, first + len(plan), several))
            changes = tuple(run.repetition for run in plan[1:several])
            scenario = _Scenario(runs, place, indices, repeat * several, changes)
            self._scenarios |= dict.fromkeys(scenario.places, scenario)
            self.places += [place for place in scenario.places for _ in range(several)]
            self.first_turns += [*range(several)] * len(runs)
            place += len(runs)
        self._count = place

    def begin(self, of_patterns: Sequence[Outcome]) -> None:
        """Report the outcomes that need no run; `of_patterns`: outcomes of patterns that match no scenario."""
        for place, refused in self._refused.items():
            self._emit(Finished(place, Outcome.of_refused(refused)))
        for place, outcome in enumerate(of_patterns, start=self._count):
            self._emit(Finished(place, outcome))

    def __call__(self, event: Event) -> None:
        """Pass an event on, and report the outcomes that become final by it."""
        if not isinstance(event, RunEnded):
            self._emit(event)
            return
        scenario = self._scenarios[event.place]
        if scenario.changes:
            # The records of all runs with one place have one name.
            name = scenario.runs[event.place - scenario.place].scenario.name
            event = replace(event, outcome=event.outcome.model_copy(update={"name": name}))
        if scenario.turns > 1 or scenario.is_compared:
            self._emit(replace(event, is_one_of_several=True))
            self._take(event.place, event.turn, event.outcome, event.key)
        else:
            # A final outcome is in the journal before the terminal reports its run.
            self._take(event.place, event.turn, event.outcome, event.key)
            self._emit(event)

    @property
    def scenarios(self) -> Iterator[range]:
        """Yield the places of each scenario that runs, one for each engine."""
        return (scenario.places for place, scenario in self._scenarios.items() if place == scenario.place)

    def is_compared(self, place: int) -> bool:
        """Return True if the outcome at a place depends on runs at other places."""
        return self._scenarios[place].is_compared

    def take_over(self, records: Iterable[Record]) -> None:
        """Report outcomes of an earlier call: final ones, and outcomes of single repetitions."""
        for record in records:
            assert record.place is not None
            assert record.outcome is not None
            if record.turn is None:
                self._final.add(record.place)
                self._emit(Finished(record.place, record.outcome, record.key, taken_over=True))
            else:
                self(RunEnded(record.place, record.turn, record.outcome, record.key, taken_over=True))

    @property
    def ended(self) -> AbstractSet[tuple[int, int]]:
        """The place and the turn of each run that needs no process any more."""
        final = {(place, turn) for place in self._final for turn in range(1, self._scenarios[place].turns + 1)}
        return final | {(place, turn) for place, turns in self._ended.items() for turn in turns}

    def end(self, outcomes: Sequence[Outcome]) -> None:
        """Report the outcomes of scenarios with runs that did not take place; `outcomes`: of all runs."""
        for index, outcome in enumerate(outcomes):
            turn, run = divmod(index, len(self.places))
            place, turn = self.places[run], turn + self.first_turns[run] + 1
            if place not in self._final and turn not in self._ended.get(place, {}):
                self._take(place, turn, outcome, None)

    def _take(self, place: int, turn: int, outcome: Outcome, key: str | None) -> None:
        self._ended.setdefault(place, {})[turn] = outcome
        self._keys.setdefault(place, {})[turn] = key
        scenario = self._scenarios[place]
        if all(len(self._ended.get(final, {})) == scenario.turns for final in scenario.places):
            for final, merged in zip(scenario.places, self._outcomes(scenario), strict=True):
                self._emit(Finished(final, merged, self._key(final)))
            for final in scenario.places:
                self._final.add(final)
                del self._ended[final], self._keys[final]

    def _key(self, place: int) -> str | None:
        keys = self._keys[place]
        if self._scenarios[place].changes:
            # The key of the run itself says how it is repeated.
            return None if None in keys.values() else keys[1]
        first, *others = set(keys.values())
        return None if others else first

    def _outcomes(self, scenario: _Scenario) -> tuple[Outcome, ...]:
        """Return the final outcomes of a scenario, all of whose runs have ended."""
        merged = tuple(self._merged(run, place) for run, place in zip(scenario.runs, scenario.places, strict=True))
        if not scenario.is_compared:
            return merged
        from sim_action.runner.engine_agreement import with_agreement  # a usual run does without it

        motions = [None if self._motions is None else motion_file(self._motions, index) for index in scenario.indices]
        return with_agreement(scenario.runs[0], merged, motions)

    def _merged(self, run: LoadedScenario, place: int) -> Outcome:
        """Return one outcome for all repetitions of a run."""
        scenario = self._scenarios[place]
        turns = [self._ended[place][turn] for turn in range(1, scenario.turns + 1)]
        if len(turns) == 1:
            return turns[0]
        if not scenario.changes:
            return merge_repeats(run, turns, self._folder)
        from sim_action.runner.numerical_confidence import divergence, with_confidence  # a usual run does without them

        traces = [stored_trace(outcome, self._folder) for outcome in turns]
        parted = divergence(traces[0], dict(zip(scenario.changes, traces[1:], strict=True)))
        _remove(self._folder, [outcome.model_copy(update={"replay": None}) for outcome in turns[1:]])
        return with_confidence(run, turns[0], dict(zip(scenario.changes, turns[1:], strict=True)), parted)


_CAUSES: Final = (
    "look in its code for the wall clock, for a random generator without a fixed seed, for the order of a set or of "
    "hashes and ids, for threads and processes that it does not wait for, and for files that an earlier run has left"
)
_NO_CODE: Final = (
    "the scenario runs none of your code, so this is a bug of sim-action: please report it, with the engine and CPU"
)


def merge_repeats(loaded: LoadedScenario, outcomes: Sequence[Outcome], folder: Path) -> Outcome:
    """Return one outcome for all runs, without a verdict if flaky; of equal runs, one trace is kept in `folder`."""
    if len(outcomes) == 1:
        return outcomes[0]
    # An interruption or an internal error says nothing about the repeatability of the scenario.
    ours = next((one for one in outcomes if one.exit_code in (ExitCode.INTERRUPTED, ExitCode.INTERNAL)), None)
    # Nor does the wall limit, if the runs that came to their end agree.
    slow = [one for one in outcomes if any(failure.title == TOO_SLOW for failure in one.failures)]
    if slow and len({_Run(0, one).key for one in outcomes if one not in slow}) <= 1:
        ours = ours or slow[0]
    runs = [_Run(number, one) for number, one in enumerate(outcomes, start=1) if one.status != "skipped"]
    if ours is not None or not runs:
        outcome, kept = ours or outcomes[0], [ours or outcomes[0]]
    else:
        outcome, kept = _outcome_of_runs(loaded, runs, folder)
    _remove(folder, [one for one in outcomes if all(one is not other for other in kept)])
    if len(runs) < len(outcomes) and outcome.status == "passed":
        note = f"run {len(runs)} of {len(outcomes)} times: another scenario did not pass (--fail-fast)"
        return outcome.model_copy(update={"status": "skipped", "expectations": (), "notes": (note,)})
    return outcome


@dataclass(frozen=True, slots=True)
class _Run:
    """One of the runs, counted from 1."""

    number: int
    outcome: Outcome

    @property
    def key(self) -> Hashable:
        """A value that is equal for identical runs; messages are left out: they may hold addresses or times of day."""
        outcome = self.outcome
        reasons = tuple((failure.kind, failure.title, failure.location) for failure in outcome.failures)
        verdicts = tuple(expected.model_dump_json() for expected in outcome.expectations)
        return (outcome.status, outcome.digest, reasons, verdicts)

    @property
    def ending(self) -> str:
        """The result in words, such as "run 3 failed (travelled 1.2 m of 1.5 m)"."""
        return f"run {self.number} {self.outcome.ending}"


def _outcome_of_runs(loaded: LoadedScenario, runs: Sequence[_Run], folder: Path) -> tuple[Outcome, list[Outcome]]:
    """Return the outcome for all runs, and the runs whose traces are kept."""
    alike: dict[Hashable, list[_Run]] = {}
    for run in runs:
        alike.setdefault(run.key, []).append(run)
    most, *others = sorted(alike.values(), key=lambda group: (-len(group), group[0].number))
    digests = {run.outcome.digest for run in runs} - {None}
    other = min((group[0] for group in others), key=lambda run: run.number, default=None)
    replay = None if other is None else other.outcome.replay
    about = {
        "repeats": Repeats(count=len(runs), agreed=len(most), digests=len(digests), replay=replay)
        if len(runs) > 1
        else None,
        "wall_time": sum(run.outcome.wall_time for run in runs),
    }
    first = most[0]
    if other is None:
        return first.outcome.model_copy(update=about), [first.outcome]
    parted = _parting(first, other, folder)
    message = "; ".join(
        (
            f"{len(most) if len(most) > 1 else 'none'} of {len(runs)} runs agree",
            *_differences(first, other, parted),
            _CAUSES if loaded.scenario.runs_user_code else _NO_CODE,
        )
    )
    failure = Failure(kind="flaky", title="flaky", message=message, time=parted.time if parted else None)
    note = f"the trace of run {first.number} is stored here, the trace of run {other.number} in {other.outcome.trace}"
    flaky = {"status": "flaky", "failures": (failure,), "expectations": (), "notes": (*first.outcome.notes, note)}
    return first.outcome.model_copy(update=about | flaky), [first.outcome, other.outcome]


def _parting(first: _Run, other: _Run, folder: Path) -> Divergence | None:
    """Return the first difference, or None if the traces show none."""
    ours, theirs = stored_trace(first.outcome, folder), stored_trace(other.outcome, folder)
    with suppress(ValueError):
        return None if ours is None or theirs is None else first_divergence(ours, theirs)
    return None


def _differences(first: _Run, other: _Run, parted: Divergence | None) -> Iterator[str]:
    """Yield the differences between two runs."""
    if parted is not None:
        yield f"run {other.number} differs from run {first.number} {_where(parted)}"
    elif first.outcome.trace and other.outcome.trace and first.outcome.digest != other.outcome.digest:
        yield (
            f"run {other.number} differs from run {first.number} in messages that nodes sent, or between two moments "
            "of its trace"
        )
    if first.outcome.digest == other.outcome.digest or first.outcome.status != other.outcome.status:
        yield from _endings(first, other)


def _endings(first: _Run, other: _Run) -> Iterator[str]:
    if first.outcome.status != other.outcome.status or first.outcome.failures:
        yield f"{first.ending}, {other.ending}"
        return
    for ours, theirs in zip(first.outcome.expectations, other.outcome.expectations, strict=True):
        if ours != theirs:
            yield (
                f"the robot moved identically, but '{ours.name}' judged it differently: run {first.number} "
                f"{_judged(ours.verdict)}, run {other.number} {_judged(theirs.verdict)}"
            )
            return


def _judged(verdict: Verdict) -> str:
    measured = "" if verdict.measured is None else f" (measured {verdict.measured!r} {verdict.unit}".rstrip() + ")"
    return f"{verdict.status.replace('_', ' ')}: {verdict.message}{measured}"


def _where(difference: Divergence) -> str:
    """Return the place of a difference, such as "at 0.304 s, in x of base_position_xyz: 0.25 and not 0.26"."""
    ours, theirs = difference.values
    if not difference.column:
        return f"at {difference.time:.6g} s, where one run ended: they ended at {theirs:.6g} s and {ours:.6g} s"
    return f"at {difference.time:.6g} s, in {difference.column}: {theirs!r} and not {ours!r}"


def stored_trace(outcome: Outcome, folder: Path) -> Trace | None:
    """Return the trace of a run; None if it has none."""
    path = stored_file(folder, outcome.trace) if outcome.trace else None
    with suppress(TraceError):
        return None if path is None else load_trace(path)
    return None


def _remove(folder: Path, outcomes: Iterable[Outcome]) -> None:
    """Remove the stored files of runs that were only needed for the comparison."""
    stored = (name for outcome in outcomes for name in (outcome.trace, outcome.replay, *outcome.recordings))
    for path in (stored_file(folder, name) for name in stored if name):
        if path is not None:
            with suppress(OSError):
                path.unlink()
