"""A run that has ended, read from its results: the outcomes, and where the files of each one are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.results.outcome import Outcome
from sim_action.results.over_variations import over_variations
from sim_action.results.results_json import RESULTS_FILE, find_all, read_all
from sim_action.results.shard_results import gates_of, merge_shards
from sim_action.scenario.variations.gate import PlannedGate


@dataclass(frozen=True, slots=True)
class EarlierRun:
    """A run that has ended.

    Attributes:
        name: its results, as typed.
        outcomes: the outcomes, with those of gates.
        gates: the gates as they are stated.
        folders: `id()` of an outcome -> the folder of its results file, from which its files are named.
    """

    name: str
    outcomes: tuple[Outcome, ...]
    folders: Mapping[int, Path]
    gates: tuple[PlannedGate, ...] = ()


def read_run(pattern: str) -> EarlierRun:
    """Return one run, joined as by `merge`: a missing shard is an error outcome. Raises UsageError."""
    files = read_all(find_all([pattern]))
    if not files:
        raise UsageError(escaped_line(f"no {RESULTS_FILE} found at '{pattern}'; name a results file or its folder"))
    entries = merge_shards(files, None)
    gates = gates_of(files)
    outcomes = over_variations([entry.outcome for entry in entries], gates)
    # The gates are judged again; the runs keep their order.
    runs = [outcome for outcome in outcomes if outcome.statistics is None]
    origins = [entry.origin for entry in entries if entry.outcome.statistics is None]
    folders = {id(run): origin.parent for run, origin in zip(runs, origins, strict=True) if origin is not None}
    return EarlierRun(pattern, outcomes, folders, gates)
