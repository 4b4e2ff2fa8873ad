"""The use case `margins`: find how far each factor of a scenario can move before the scenario fails."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, replace
from sim_action.core.version import __version__
from sim_action.core.wording import counted, note, warn
from sim_action.reports import ReportOptions, ReportRequest
from sim_action.reports.progress import ProgressListener
from sim_action.reports.writing import open_reports, remove_earlier, write_reports
from sim_action.results.factor_margins import Margin, Margins, ScenarioMargins
from sim_action.results.journal import JOURNAL_FILE, Event, Finished, Header, Journal, Record, RunEnded
from sim_action.results.outcome import Outcome
from sim_action.results.output_folder import writing
from sim_action.results.results_json import MARGINS_FILE, write_json
from sim_action.runner.margin_search import FACTORS, FactorRequest, Search, Trial, trial
from sim_action.runner.mutation.mutant import Original
from sim_action.runner.mutation.planning import first_runs
from sim_action.runner.outcome_assembly import planned_outcomes
from sim_action.runner.process_pool import Pool, PoolOptions
from sim_action.runner.run_keys import RunKeys, RunOptions, changed_parts, trusted_journal
from sim_action.runner.run_plan import PlanRequest, Runs, plan_runs
from sim_action.scenario.loading import Libraries
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused

MARGINS_FOLDER: Final = "margins"
"""The folder of the reports below the output folder, so that the results of `run` stay."""


@dataclass(frozen=True, slots=True)
class MarginsRequest:
    """The options of `margins`."""

    plan: PlanRequest
    reports: ReportRequest
    jobs: int
    factors: tuple[FactorRequest, ...] = ()  # those to vary; empty: all that apply
    runs: int = 20  # the largest number of runs for each factor
    budget: int | None = None  # the largest number of runs in all; None: any
    resume: bool = False  # True to take over runs of the earlier call in the output folder


def find_margins(request: MarginsRequest, interruption: Interruption) -> tuple[Margins, ExitCode]:
    """Find the margins of all scenarios, and write the reports. Raise UsageError."""
    with (
        closing(_keys(request)) as keys,
        open_reports(request.reports, keeps_earlier=request.resume) as options,
        tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder,
    ):
        return _Call(request, options, Path(folder), interruption, keys).margins()


def _keys(request: MarginsRequest) -> RunKeys:
    options = RunOptions(request.plan.permissions, replays=False)
    return RunKeys(request.plan.suite.files, options, request.reports.outputs)


class _Call:
    """One call; `folder` holds the files of the runs that are no reports. Raise UsageError.

    Each scenario has a place in the results and in the journal. Its nominal run and its trials are turns there.
    """

    def __init__(
        self, request: MarginsRequest, options: ReportOptions, folder: Path, interruption: Interruption, keys: RunKeys
    ) -> None:
        self._request, self._options, self._folder, self._interruption = request, options, folder, interruption
        self._keys, self._libraries = keys, Libraries()
        self._turns: Counter[int] = Counter()
        self._taken = 0
        plan = plan_runs(request.plan)
        self._firsts = [
            scenario if isinstance(scenario, Refused) else replace(scenario, mutation=None)
            for scenario in first_runs(plan.plans)
        ]
        self._of_patterns = plan.of_nothing
        self._planned = planned_outcomes(
            [scenario if isinstance(scenario, Refused) else (scenario,) for scenario in self._firsts], self._of_patterns
        )
        records = self._resumed() if request.resume else []
        self._earlier = {record.key: record.outcome for record in records if record.key and record.outcome is not None}
        self._nominal = [record for record in records if record.turn == 1]
        header = Header.of_call(self._planned, (*options.files, MARGINS_FILE), plan.shard)
        options.room.reserve(len(self._planned))
        self._journal = Journal(options.folder, header, warn, time.monotonic(), make_room=options.room.make)
        # The factors of the command line that no run has.
        self._absent = set(request.factors)

    def _resumed(self) -> Sequence[Record]:
        """Return the records of the earlier call, and remove its other files."""
        try:
            return trusted_journal(self._options.folder).records
        except UsageError as error:
            note(f"--resume: {error}")
            return []
        finally:
            remove_earlier(self._request.reports, {JOURNAL_FILE})

    def _note_runs(self) -> None:
        """Say how many runs there were, how many the earlier call had, and what has changed since if it had none."""
        count = sum(self._turns.values())
        runs = counted(count, "run")
        if not self._request.resume:
            if count and self._request.reports.verbosity != "quiet":
                note(f"{runs} in all")
            return
        keys = {
            (planned.file, planned.name): self._keys.of(scenario) or ""
            for scenario, planned in zip(self._firsts, self._planned, strict=False)
            if not isinstance(scenario, Refused)
        }
        changed = "" if self._taken else changed_parts(self._nominal, keys)
        note(f"--resume: {self._taken} of {runs} taken over{changed and f'; {changed}'}")

    def margins(self) -> tuple[Margins, ExitCode]:
        """Run everything, and write the reports."""
        loaded = [(place, first) for place, first in enumerate(self._firsts) if not isinstance(first, Refused)]
        nominal = iter(self._outcomes(loaded))
        outcomes = [
            Outcome.of_refused(first) if isinstance(first, Refused) else next(nominal) for first in self._firsts
        ]
        originals = dict(self._originals(outcomes))
        searches = {place: list(self._searches(original)) for place, original in originals.items()}
        if originals and self._absent:
            names = ", ".join(sorted(request.name for request in self._absent))
            raise UsageError(f"no scenario that passes has the factor {names}; name another one")
        self._announce([search for several in searches.values() for search in several])
        self._search(originals, searches)
        self._note_runs()
        scenarios = []
        for place, outcome in enumerate(outcomes):
            several = None
            if place in originals and self._interruption.happened:
                # A search that has not ended knows no margin; a scenario that failed before stays failed.
                reason = "the call was interrupted before the margins were known"
                scenarios.append(_margins(outcome, ()).model_copy(update={"reason": reason}))
                continue
            if place in originals:
                several = tuple(margin for search in searches[place] for margin in search.margins(outcome.digest))
            scenario = _margins(outcome, several)
            if scenario.reason and outcome.status != "error":  # reports show the error itself
                note(f"{scenario.name}: {scenario.reason}")
            self._journal(Finished(place, scenario.shown_by(outcome)))
            scenarios.append(scenario)
        for place, outcome in enumerate(self._of_patterns, start=len(self._firsts)):
            self._journal(Finished(place, outcome))
        margins = Margins(sim_action=__version__, runs=sum(self._turns.values()), scenarios=tuple(scenarios))
        self._write(margins)
        return margins, write_reports(self._journal.close(), self._options)

    def _originals(self, outcomes: Sequence[Outcome]) -> Iterator[tuple[int, Original]]:
        """Yield the runs that passed, with their places."""
        for place, (scenario, outcome) in enumerate(zip(self._firsts, outcomes, strict=True)):
            if original := Original.of(scenario, outcome, self._folder):
                yield place, original

    def _searches(self, original: Original) -> Iterator[Search]:
        for request in self._request.factors or map(FactorRequest, FACTORS):
            factors = request.factors(original)
            self._absent.difference_update([request] if factors else [])
            yield from (Search(factor, request.least(factor), self._request.runs) for factor in factors)
            must_be_left = request.share is not None or request.distance is not None
            if must_be_left and not factors:
                yield Search.of_missing(request.name)

    def _announce(self, searches: Sequence[Search]) -> None:
        """Print the cost, and refuse one beyond the budget."""
        most, budget = len(searches) * self._request.runs, self._request.budget
        if budget is not None and most > budget:
            raise UsageError(
                f"--budget: {counted(most, 'run')} may be needed, {budget} are allowed; name fewer factors or --runs"
            )
        if self._request.reports.verbosity != "quiet":
            note(f"{counted(len(searches), 'factor')}, at most {counted(most, 'run')}")

    def _search(self, originals: Mapping[int, Original], searches: Mapping[int, Sequence[Search]]) -> None:
        """Run the values of all factors, in rounds: what runs next depends on the results of a round alone."""
        pairs = [(place, search) for place, several in searches.items() for search in several]
        while next_values := [(place, side, value) for place, search in pairs for side, value in search.next_values()]:
            trials: list[tuple[int, Trial]] = []
            for place, side, value in next_values:
                one = trial(originals[place], side.factor, value, self._request.plan.permissions, self._libraries)
                side.trials.append(one)
                trials.append((place, one))
            valid = [(place, one, one.loaded) for place, one in trials if one.loaded is not None]
            outcomes = self._outcomes([(place, loaded) for place, _, loaded in valid])
            if self._interruption.happened:
                return
            for (_, one, _), outcome in zip(valid, outcomes, strict=True):
                one.take(outcome)

    def _outcomes(self, scenarios: Sequence[tuple[int, LoadedScenario]]) -> list[Outcome]:
        """Run scenarios, each with its place, or take over their outcomes; those without a factor run always."""
        outcomes: dict[int, Outcome] = {}
        left: dict[int, int] = {}  # index -> turn
        earlier = self._earlier if self._turns else {}
        for index, (place, loaded) in enumerate(scenarios):
            key = self._keys.of(loaded) if earlier else None
            if (outcome := earlier.get(key or "")) is not None:
                outcomes[index] = outcome
                self._record(RunEnded(place, self._turns[place] + 1, outcome, key))
            else:
                left[index] = self._turns[place]
            self._turns[place] += 1
        self._taken += len(outcomes)
        if left:
            progress = ProgressListener(len(left), self._request.reports.verbosity)

            def emit(event: Event) -> None:
                self._record(event)
                progress(event)

            places, runs = [scenarios[index][0] for index in left], [scenarios[index][1] for index in left]
            pool = Pool(
                Runs(runs, self._folder, places=places, turns=list(left.values())),
                emit,
                self._interruption,
                PoolOptions(self._request.jobs, self._keys),
            )
            outcomes |= zip(left, pool.outcomes(self._keys.prepare), strict=True)
            progress.close()
        return [outcomes[index] for index in range(len(scenarios))]

    def _record(self, event: Event) -> None:
        """Write an event into the journal; all runs with one place have one name there, and their files do not stay."""
        if isinstance(event, RunEnded):
            changed = {"name": self._planned[event.place].name, "trace": None, "replay": None}
            event = replace(event, outcome=event.outcome.model_copy(update=changed), is_one_of_several=True)
        self._journal(event)

    def _write(self, margins: Margins) -> None:
        path = self._options.folder / MARGINS_FILE
        with writing(str(path)):
            write_json(margins, path)


def _margins(outcome: Outcome, margins: Sequence[Margin] | None) -> ScenarioMargins:
    reason = "" if margins is not None else f"it has no margins, because it {outcome.ending} with its nominal values"
    same = {key: getattr(outcome, key) for key in ("name", "file", "line", "variation", "engine")}
    return ScenarioMargins(**same, reason=reason, margins=tuple(margins or ()))
