"""Runs of scenarios in the pool of child processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sim_action.core.process import Interruption
from sim_action.results.journal import Listener
from sim_action.results.outcome import Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.process_pool import Pool, PoolOptions
from sim_action.runner.run_plan import Runs
from sim_action.scenario.model import LoadedScenario


def execute(
    scenarios: Sequence[LoadedScenario],
    folder: Path,
    jobs: int,
    emit: Listener,
    interruption: Interruption,
    *,
    child_type: type[ChildProcess] | None = None,
    shares: bool = True,
    meanwhile: Callable[[], object] = lambda: None,
    **runs: Any,
) -> list[Outcome]:
    """Run scenarios; `runs` are other attributes of `Runs`."""
    options = PoolOptions(jobs, child_type=child_type, shares=shares)
    return Pool(Runs(scenarios, folder, **runs), emit, interruption, options).outcomes(meanwhile)
