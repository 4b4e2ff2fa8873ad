"""The run of `--against`: an earlier run of the same scenarios, and what changed since, as words and kinds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from sim_action.core.records import dataclass
from sim_action.core.wording import note
from sim_action.reports.comparison import before_text, headline, limits_text, rows_of
from sim_action.results.comparison import Change, ChangeKind, Comparison, compare_outcomes, paired_outcomes
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.results.shard_results import EarlierRun

ScenarioChangeKind = ChangeKind | Literal["less margin", "slower", "weaker", "moves differently", "unchanged"]
"""The kind of change of a scenario or gate; with the last five, the verdict is as before.

- less margin: a margin of the scenario, or of the runs of a gate, is less than half of the margin before.
- slower: the real-time factor is less than half of the one of before.
- weaker: an expectation is gone, allows more, or no longer holds as a warning; or the pass rate of a gate fell.
"""


@dataclass(frozen=True, slots=True)
class ScenarioChange:
    """The change of a scenario or gate."""

    kind: ScenarioChangeKind
    words: str  # what changed, such as "newly fails; before: came true at 5.75 s"
    limit: str = ""  # the limits now and before of the expectation that failed; empty if it fails with both
    # how the scene of its replay differs, such as "pallet is new"; empty if it is the same or not known
    world: str = ""
    # the first command that differs before the motions part, with both values and its time; empty if the commands are
    # the same, None if that is not known, or if the motions do not part
    command: str | None = None

    @property
    def gist(self) -> str:
        """The change in a few words, for a table; empty if nothing changed."""
        kind = "" if self.kind == "unchanged" else self.kind
        command = "other commands" if self.command else ""
        return "; ".join(part for part in (kind, self.limit, self.world, command) if part)


@dataclass(frozen=True, slots=True)
class Base:
    """The earlier run of `--against`, and what changed since."""

    run: EarlierRun  # the earlier run
    comparison: Comparison  # the comparison with it
    changes: Mapping[int, ScenarioChange]  # `id()` of an outcome -> its change; empty if no scenario is in both runs
    before: Mapping[int, Outcome]  # `id()` of an outcome -> the outcome of the same scenario in the earlier run

    @classmethod
    def of(cls, run: EarlierRun, results: Results) -> Base:
        """Compare the results of a page with the earlier run."""
        outcomes = results.outcomes
        gates = (run.gates, results.gates)
        comparison = compare_outcomes(run.outcomes, outcomes, allow_removed=True, gates=gates)
        pairs = paired_outcomes(run.outcomes, outcomes)
        before = {id(new): old for old, new in pairs if new is not None and old is not None}
        return cls(run, comparison, scenario_changes(comparison) if before else {}, before)

    @property
    def headline(self) -> str:
        """The counts of all changes, or that there is nothing to compare."""
        if not self.before:
            return f"Nothing to compare: no scenario of {self.run.name} has the name of one here"
        return f"Compared with the base run ({self.run.name}): {headline(self.comparison)}"


def warn_if_nothing_in_common(run: EarlierRun, outcomes: Sequence[Outcome]) -> None:
    """Say on standard error that an earlier run has no scenario of this one: its path may be wrong."""
    if all(old is None or new is None for old, new in paired_outcomes(run.outcomes, outcomes)):
        note(
            f"--against {run.name}: no scenario has the file and name of one in this run, so nothing is compared; name "
            "the results of an earlier run of these scenarios"
        )


def scenario_changes(comparison: Comparison) -> Mapping[int, ScenarioChange]:
    """Return `id()` of an outcome of the new run -> its change."""
    return {id(change.new): _scenario_change(change) for change in comparison.changes if change.new is not None}


def _scenario_change(change: Change) -> ScenarioChange:
    words = "; ".join(_words(change)) or "it still passes"
    return ScenarioChange(_kind(change), words, _decisive_limit(change))


def _words(change: Change) -> Iterator[str]:
    """Yield each change in words. The reason why a scenario fails is left out: it stands below."""
    for row in rows_of(change):
        has_detail = row.message and row.kind not in ("newly fails", "still fails")
        yield f"{row.kind}: {row.message}" if has_detail else row.kind
        if row.kind == "newly fails" and (before := before_text(change)):
            yield before


def _decisive_limit(change: Change) -> str:
    """Return the limits now and before of the expectation that failed first, if it would have held with the former."""
    first = next(iter(change.outcome.causes), None)
    if change.outcome.failures or first is None or not first.failed or first.verdict.cut_off:
        return ""
    was = next((was for was, now in change.stricter if now is first), None)
    if was is None:
        return ""
    former, limit, margin = was.verdict.limit, first.verdict.limit, first.verdict.margin
    if former is None or limit is None or margin is None:
        return ""
    return limits_text(was, first) if margin + abs(limit - former) >= 0 else ""


def _kind(change: Change) -> ScenarioChangeKind:
    if change.kind not in ("still passes", "still fails"):
        return change.kind
    gate = change.gate
    if change.missed or change.weaker or (gate is not None and gate.failed):
        return "weaker"
    if change.smaller_margins or (gate is not None and gate.margins):
        return "less margin"
    if change.slower and not change.processors:
        return "slower"
    return "moves differently" if change.moves_differently else "unchanged"
