"""The use case `margins`: find how far each factor of a scenario can move before the scenario fails."""

from __future__ import annotations

import platform
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.files import whole_file
from sim_action.core.process import Interruption
from sim_action.core.provenance import platform_name
from sim_action.core.records import dataclass, replace
from sim_action.core.version import __version__
from sim_action.core.wording import counted, escaped_line, note, system_reason
from sim_action.reports import ReportOptions, ReportRequest
from sim_action.reports.progress import ProgressListener
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.factor_margins import MARGINS_FILE, Margin, Margins, ScenarioMargins
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.runner.margin_search import FactorRequest, Search, Trial, trial
from sim_action.runner.mutation.judgement import stored
from sim_action.runner.mutation.mutant import Original
from sim_action.runner.mutation.planning import first_runs
from sim_action.runner.process_pool import Pool, PoolOptions
from sim_action.runner.run_plan import PlanRequest, plan_runs
from sim_action.runner.runs import Runs
from sim_action.scenario.loading import Libraries
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused

MARGINS_FOLDER: Final = "margins"
"""The folder of the reports below the output folder, so that the results of `run` stay."""


@dataclass(frozen=True, slots=True)
class MarginsRequest:
    """The options of `margins`.

    Attributes:
        factors: those to vary; empty: all that apply.
        runs: the largest number of runs for each factor.
        budget: the largest number of runs in all; None: any.
    """

    plan: PlanRequest
    reports: ReportRequest
    jobs: int
    factors: tuple[FactorRequest, ...] = ()
    runs: int = 20
    budget: int | None = None


def find_margins(request: MarginsRequest, interruption: Interruption) -> ExitCode:
    """Find the margins of all scenarios, write the reports and return the exit code. Raise UsageError."""
    with (
        open_reports(request.reports) as options,
        tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder,
    ):
        return _Call(request, options, Path(folder), interruption).exit_code()


class _Call:
    """One call; `folder` holds the files of the runs that are no reports. Raise UsageError."""

    def __init__(
        self, request: MarginsRequest, options: ReportOptions, folder: Path, interruption: Interruption
    ) -> None:
        self._request, self._options, self._folder, self._interruption = request, options, folder, interruption
        self._started = time.monotonic()
        self._libraries = Libraries()
        self._runs = 0
        # The factors of the command line that no run has.
        self._absent = set(request.factors)

    def exit_code(self) -> ExitCode:
        plan = plan_runs(self._request.plan)
        firsts = list(first_runs(plan.plans))
        loaded = [replace(each, mutation=None) for each in firsts if not isinstance(each, Refused)]
        nominal = iter(self._outcomes(loaded))
        outcomes = [Outcome.of_refused(each) if isinstance(each, Refused) else next(nominal) for each in firsts]
        originals = list(self._originals(firsts, outcomes))
        searches = [list(self._searches(original)) for original in originals]
        if originals and self._absent:
            names = ", ".join(sorted(request.name for request in self._absent))
            raise UsageError(f"no scenario that passes has the factor {names}; name another one")
        self._announce([search for several in searches for search in several])
        self._search(originals, searches)
        if self._interruption.happened:
            # A search that has not ended knows no margin; a scenario that failed before stays failed.
            outcomes = [_without_margins(outcome) for outcome in outcomes]
            originals = []
            searches = []
        by_outcome = {
            id(original.outcome): tuple(
                margin for search in several for margin in search.margins(original.outcome.digest)
            )
            for original, several in zip(originals, searches, strict=True)
        }
        scenarios = tuple(_margins(outcome, by_outcome.get(id(outcome))) for outcome in outcomes)
        shown = []
        for scenario, outcome in zip(scenarios, outcomes, strict=True):
            if scenario.reason and outcome.status != "error":  # reports show the error itself
                note(f"{scenario.name}: {scenario.reason}")
            shown.append(scenario.shown_by(outcome))
        shown += [*map(Outcome.of_nothing, plan.empty), *map(Outcome.of_unmatched, plan.unmatched)]
        self._write(Margins(sim_action=__version__, runs=self._runs, scenarios=scenarios))
        results = Results(
            sim_action=__version__,
            python=platform.python_version(),
            platform=platform_name(),
            wall_time=time.monotonic() - self._started,
            shard=plan.shard,
            outcomes=tuple(shown),
        )
        return write_reports(results, self._options)

    def _originals(self, firsts: Sequence[LoadedScenario | Refused], outcomes: Sequence[Outcome]) -> Iterator[Original]:
        """Yield the runs that passed."""
        for each, outcome in zip(firsts, outcomes, strict=True):
            trace = stored(outcome, self._folder) if outcome.status == "passed" else None
            if trace is not None and not isinstance(each, Refused):
                yield Original(each, outcome, trace)

    def _searches(self, original: Original) -> Iterator[Search]:
        for request in self._request.factors or FactorRequest.of_all():
            factors = request.factors(original)
            self._absent.difference_update([request] if factors else [])
            yield from (Search(factor, request.least(factor), self._request.runs) for factor in factors)
            if request.is_demanded and not factors:
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

    def _search(self, originals: Sequence[Original], searches: Sequence[Sequence[Search]]) -> None:
        """Run the values of all factors, in rounds: what runs next depends on the results of a round alone."""
        groups = zip(originals, searches, strict=True)
        pairs = [(original, search) for original, several in groups for search in several]
        while wanted := [(original, side, value) for original, search in pairs for side, value in search.wanted()]:
            trials: list[Trial] = []
            for original, side, value in wanted:
                one = trial(original, side.factor, value, self._request.plan.permissions, self._libraries)
                side.trials.append(one)
                trials.append(one)
            valid = [(one, one.loaded) for one in trials if one.loaded is not None]
            outcomes = self._outcomes([loaded for _, loaded in valid])
            if self._interruption.happened:
                return
            for (one, _), outcome in zip(valid, outcomes, strict=True):
                one.take(outcome)

    def _outcomes(self, scenarios: Sequence[LoadedScenario]) -> list[Outcome]:
        if not scenarios:
            return []
        self._runs += len(scenarios)
        listener = ProgressListener(len(scenarios), self._request.reports.verbosity)
        runs = Runs(scenarios, self._folder)
        outcomes = Pool(runs, listener, self._interruption, PoolOptions(self._request.jobs)).outcomes()
        listener.close()
        return outcomes

    def _write(self, margins: Margins) -> None:
        path = self._options.folder / MARGINS_FILE
        try:
            with whole_file(path) as file:
                file.write((margins.model_dump_json(indent=2) + "\n").encode("utf-8", "backslashreplace"))
        except OSError as error:
            raise UsageError(escaped_line(f"{path} cannot be written: {system_reason(error)}")) from None


def _without_margins(outcome: Outcome) -> Outcome:
    """Return the outcome of a scenario whose margins are not known, because the call was interrupted."""
    if outcome.status != "passed":
        return outcome
    message = "the call was interrupted before the margins were known; the scenario passes with its nominal values"
    failure = Failure(kind="interrupted", title="interrupted", message=message)
    return outcome.model_copy(update={"status": "error", "failures": (failure,), "expectations": ()})


def _margins(outcome: Outcome, margins: Sequence[Margin] | None) -> ScenarioMargins:
    reason = "" if margins is not None else f"it has no margins, because it {outcome.ending} with its nominal values"
    return ScenarioMargins(
        name=outcome.name,
        file=outcome.file,
        line=outcome.line,
        variation=outcome.variation,
        engine=outcome.engine,
        reason=reason,
        margins=tuple(margins or ()),
    )
