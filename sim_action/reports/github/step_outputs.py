"""The outputs of a GitHub Actions step, such as `conclusion` and `passed`, for later steps."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from sim_action.core.files import append_whole
from sim_action.reports import ReportOptions
from sim_action.reports.links import reason_time, replay_link
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.results_json import RESULTS_FILE, Results


def write_outputs(results: Results, options: ReportOptions) -> None:
    """Append the outputs to the file named by `GITHUB_OUTPUT`, if it is set."""
    append_outputs(outputs(results, options), options.environment)


def append_outputs(values: Mapping[str, str], environment: Mapping[str, str]) -> None:
    """Append names and values to the file named by `GITHUB_OUTPUT`, if it is set. Raises OSError."""
    file = environment.get("GITHUB_OUTPUT")
    if not file:
        return
    entries = "".join(_entry(name, value) for name, value in values.items())
    # Paths need not be valid UTF-8; their bytes are kept.
    append_whole(Path(file), entries.encode("utf-8", errors="surrogateescape"))


def outputs(results: Results, options: ReportOptions) -> dict[str, str]:
    """Return name -> value; times are in s, `travelled` is in m and empty unless exactly one scenario moved a robot."""
    travelled, factor = results.travelled, results.real_time_factor
    return {
        "conclusion": results.conclusion,
        "total": str(results.total),
        "passed": str(results.count("passed")),
        "failed": str(results.count("failed")),
        "flaky": str(results.count("flaky")),
        "inconclusive": str(results.count("inconclusive")),
        "not-exercised": str(results.count("not_exercised")),
        "errors": str(results.count("error")),
        "skipped": str(results.count("skipped")),
        "output-directory": str(options.folder.absolute()),
        "junit-path": "" if "junit" in options.silenced else str(options.junit.absolute()),
        "results-path": "" if "results" in options.silenced else str((options.folder / RESULTS_FILE).absolute()),
        "report-path": "" if "report" in options.silenced else str((options.folder / REPORT_FILE).absolute()),
        "report-fragment": _fragment(results, options),
        "travelled": "" if travelled is None else f"{travelled:.4f}",
        "duration": f"{results.wall_time:.3f}",
        "real-time-factor": "" if factor is None else f"{factor:.2f}",
    }


def _fragment(results: Results, options: ReportOptions) -> str:
    """Return the URL fragment that opens the report at the worst failure and its sim time; empty if all passed."""
    worst = next(iter(results.worst_first()), None)
    if worst is None or worst.status in ("passed", "skipped"):
        return ""
    if worst.statistics is not None:
        # A gate has no replay of its own.
        groups = (group for group in grouped_scenarios(results.outcomes) if group.gate is worst)
        worst = next((run for group in groups for run in group.not_passed), worst)
    return replay_link(worst, options, reason_time(worst)).removeprefix(REPORT_FILE)


def _entry(name: str, value: str) -> str:
    delimiter = f"ghadelimiter_{os.urandom(16).hex()}"
    return f"{name}<<{delimiter}\n{value}\n{delimiter}\n"
