"""The use case `run --plan-gate`: plan the numbers of runs of gates, and run nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sim_action.core.errors import UsageError
from sim_action.core.units import SHARE, parse
from sim_action.core.wording import escaped_line, log_line, shown
from sim_action.core.workspace import compared_name
from sim_action.reports.gate_chances import Duration, plan_lines
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import RESULTS_FILE, Results
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import PlannedGate, UnattainableGate

_NO_GATE = (
    "--plan-gate: no scenario in these paths has a gate; add one beside 'variations', such as "
    "gate: {passes: {at_least: 90 %}, runs: 61}"
)


def wished_rate(text: str) -> float:
    """Return the rate of `--plan-gate`. Raises UsageError."""
    try:
        rate = parse(text, SHARE)
    except ValueError:
        rate = 0.0
    if 0 < rate < 1:
        return round(rate, 14)
    advice = "a rate between 0 % and 100 %, such as --plan-gate 97%; paths stand before the option"
    raise UsageError(f"--plan-gate: expected {advice}; found {shown(text)}")


def is_plannable(scenario: Source | Refused) -> bool:
    """Return True for a scenario with a gate, also if it is refused because the runs of its gate are too few."""
    if isinstance(scenario, Refused):
        return isinstance(scenario.error, UnattainableGate)
    return scenario.gate is not None


def gate_plans(scenarios: Sequence[Source | Refused], wish: float, folder: Path, jobs: int) -> list[str]:
    """Return the lines with the plans of all gates.

    Args:
        scenarios: all that are selected.
        wish: the true rate of a robot that should pass.
        folder: has results of an earlier run, from which the time follows.
        jobs: the number of runs at the same time.

    Raises UsageError if no scenario has a gate, and none is refused for another reason.
    """
    planned: dict[tuple[str, str], tuple[PlannedGate, bool]] = {}
    for scenario in scenarios:
        if isinstance(scenario, Refused):
            if isinstance(scenario.error, UnattainableGate):
                gate = scenario.error.stated.planned(
                    scenario.name, scenario.name, scenario.file, scenario.line, scenario.error.runs
                )
                planned.setdefault((gate.file, gate.group), (gate, True))
        elif scenario.gate is not None:
            # The combinations of listed values have equal gates.
            planned.setdefault((scenario.gate.file, scenario.gate.group), (scenario.gate, False))
    if not planned and not any(isinstance(scenario, Refused) for scenario in scenarios):
        raise UsageError(_NO_GATE)
    earlier = _earlier(folder)
    lines: list[str] = []
    for gate, is_refused in planned.values():
        gate_lines = plan_lines(_called(gate), wish, _duration(gate, earlier, jobs), is_refused=is_refused)
        lines += [*([""] if lines else []), *map(log_line, gate_lines)]
    return lines


def _called(gate: PlannedGate) -> PlannedGate:
    return gate.model_copy(update={"name": escaped_line(gate.group)})


def _earlier(folder: Path) -> Sequence[Outcome]:
    """Return the runs of an earlier call; none if there is no valid file."""
    try:
        return Results.read(folder / RESULTS_FILE).runs
    except UsageError:
        return ()


def _duration(gate: PlannedGate, earlier: Sequence[Outcome], jobs: int) -> Duration:
    file = compared_name(gate.file)
    ran = (run for run in earlier if run.group == gate.group and compared_name(run.file) == file)
    # A run that an early stop left out took no time.
    times = [run.wall_time for run in ran if run.status != "skipped"]
    mean = sum(times) / len(times) if times else 0.0
    return lambda runs: _time_text(runs * mean / min(jobs, max(runs, 1))) if mean else ""


def _time_text(seconds: float) -> str:
    for size, unit in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(1.0, seconds):.0f} s"
