"""How the reports show a gate: as one entry, whatever the number of its runs."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import pytest

from sim_action.core.errors import ExitCode, Location
from sim_action.reports import ReportOptions
from sim_action.reports.formatting import counts_text, taken_over_text
from sim_action.reports.github.annotations import write_annotations
from sim_action.reports.github.job_summary import summary
from sim_action.reports.github.step_outputs import outputs
from sim_action.reports.junit import write_junit
from sim_action.reports.links import rerun_command
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.reports.terminal import print_results
from sim_action.reports.writing import complain_about
from sim_action.results.gates import over_variations
from sim_action.results.results_json import Results
from sim_action.world.claims import AuditWarning
from tests.outcomes import gate_results, like, outcome, planned_gate, runs_of_gate

Golden = Callable[[str, str], None]
PLANNED = planned_gate()


def judged(**counts: int) -> Results:
    return gate_results(PLANNED, *runs_of_gate(PLANNED, **counts))


def early() -> Results:
    planned = planned_gate(100, stop_early={"reject": "85 %", "accept": "95 %"})
    return gate_results(planned, *runs_of_gate(planned, passed=2, failed=6, skipped=92))


def several_claims() -> Results:
    quantile = {"of": "travel.measured", "q": "30 %", "at_least": "0.4 m"}
    planned = planned_gate(20, passes={"at_least": "50 %"}, quantile=quantile, errors={"at_most": 1})
    return gate_results(planned, *runs_of_gate(planned, passed=18, error=1, not_exercised=1))


def part(**counts: int) -> Results:
    return gate_results(PLANNED, *runs_of_gate(PLANNED, **counts), shard=(1, 3, 61))


GATES: dict[str, Callable[[], Results]] = {
    "passed": lambda: judged(passed=60, failed=1),
    "failed": lambda: judged(passed=40, failed=21),
    "inconclusive": lambda: judged(passed=58, failed=3),
    "errors": lambda: judged(passed=57, failed=1, error=2, not_exercised=1),
    "interrupted": lambda: judged(passed=10, interrupted=51),
    "skipped": lambda: judged(passed=10, skipped=51),
    "early": early,
    "several-claims": several_claims,
    "part": lambda: part(passed=18, failed=2),
    "stopped-part": lambda: part(passed=18, interrupted=2),
}


@pytest.fixture(params=GATES)
def gate_kind(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


def printed(results: Results, options: ReportOptions) -> str:
    stream = io.StringIO()
    print_results(results, options, stream)
    return stream.getvalue()


def annotated(results: Results, options: ReportOptions, capsys: pytest.CaptureFixture[str]) -> str:
    write_annotations(results, replace(options, environment={"GITHUB_ACTIONS": "true"}))
    return capsys.readouterr().out


def junit(results: Results, options: ReportOptions) -> ET.Element:
    write_junit(results, options)
    return ET.parse(options.junit).getroot()


def test_golden(gate_kind: str, options: ReportOptions, golden: Golden, capsys: pytest.CaptureFixture[str]) -> None:
    results = GATES[gate_kind]()
    golden(f"gate-{gate_kind}.txt", printed(results, options))
    golden(f"gate-{gate_kind}.md", summary(results, options))
    write_junit(results, options)
    golden(f"gate-{gate_kind}.xml", options.junit.read_text(encoding="utf-8"))
    golden(f"gate-{gate_kind}-annotations.txt", annotated(results, options, capsys))


@pytest.mark.parametrize("strict", [False, True])
def test_the_counts_are_properties(strict: bool, options: ReportOptions) -> None:
    root = junit(judged(passed=58, failed=3), replace(options, junit_strict=strict))
    values = {each.get("name"): each.get("value") for each in root.iter("property")}
    assert [values[name] for name in ("runs", "passed", "failed", "errors")] == ["61", "58", "3", "0"]
    assert float(values["lower"] or 0) < float(values["rate"] or 0) < float(values["upper"] or 0)


@pytest.mark.parametrize(
    ("other", "code", "words"),
    [
        ({"failed": 2}, ExitCode.PASSED, "no verdicts here; 20 runs of 1 gate for sim-action merge in"),
        ({"interrupted": 2}, ExitCode.INTERRUPTED, "20 runs of 1 gate for sim-action merge (2 could not run)"),
    ],
)
def test_of_a_part_only_runs_that_could_not_run_count(
    other: dict[str, int], code: ExitCode, words: str, options: ReportOptions
) -> None:
    results = part(passed=18, **other)
    assert results.exit_code is code
    assert words in printed(results, replace(options, verbosity="quiet"))


def test_quiet_and_verbose(options: ReportOptions) -> None:
    # Quiet shows gates that did not pass and no runs.
    quiet = replace(options, verbosity="quiet")
    assert printed(judged(passed=61), quiet) == "1 passed; 61 runs of 1 gate in 1.0 s (183x real time)\n"
    text = printed(judged(passed=58, failed=3), quiet)
    assert "58 of 61 runs passed" in text
    assert "friction" not in text
    # Verbose shows every run.
    text = printed(judged(passed=58, failed=3), replace(options, verbosity="verbose"))
    assert text.count("slip[friction=") == 61


def test_a_warning_counts_once_for_all_runs(options: ReportOptions, capsys: pytest.CaptureFixture[str]) -> None:
    warning = AuditWarning(rule="nothing-to-touch", message="no objects", location=Location(PLANNED.file, 9, 5))
    runs = [like(run, warnings=(warning,)) for run in runs_of_gate(PLANNED, passed=61)]
    (expected,) = runs[0].expectations
    soft = like(expected, severity="warning", verdict=replace(expected.verdict, passed=False))
    runs = [like(run, expectations=(*run.expectations, soft)) for run in runs]
    results = gate_results(PLANNED, *runs)
    assert counts_text(results) == "1 passed, 2 warnings; 61 runs of 1 gate"
    text = printed(results, options)
    assert text.count("no objects") == 1
    assert "(in 61 of 61 runs)" in text
    assert "not in 61 of 61 runs" in text
    assert annotated(results, options, capsys).count("::warning") == 2


def test_counts_links_and_commands_of_gates(options: ReportOptions) -> None:
    # Scenarios and gates are counted together.
    gate = judged(passed=58, failed=3)
    results = like(gate, outcomes=(outcome("a.sim.yml"), *gate.outcomes))
    assert counts_text(results) == "1 passed, 1 inconclusive; 61 runs of 1 gate"
    assert summary(results, options).startswith("## ❌ 1 of 2 scenarios and gates did not pass\n")
    assert taken_over_text(17, results) == "17 of 62 runs taken over from the earlier run"
    assert outputs(results, options)["total"] == "2"
    # The report opens at the worst run.
    runs = runs_of_gate(PLANNED, passed=58, failed=3)
    replayed = [like(run, replay=f"replays/{run.number}.json") for run in runs]
    fragment = outputs(gate_results(PLANNED, *replayed), options)["report-fragment"]
    assert fragment.startswith("#scenario=slip%5Bfriction%3D0.59%5D")
    assert fragment.endswith("&t=3")
    # The command runs all runs of a gate.
    planned = planned_gate(name="slip[mass=2]")
    alone = gate_results(planned, *runs_of_gate(planned, passed=61)).verdicts[0]
    command = "sim-action run scenarios/slip.sim.yml --only slip --seed 7 --backend pybullet"
    assert rerun_command(alone, options) == command


def test_each_gate_is_one_line_where_reports_are_missing(
    gate_kind: str, options: ReportOptions, capsys: pytest.CaptureFixture[str]
) -> None:
    complain_about({"results": OSError(28, "No space left on device")}, GATES[gate_kind](), options)
    (line,) = capsys.readouterr().out.splitlines()
    assert "slip" in line


def test_a_gate_of_listed_values_has_its_own_runs() -> None:
    claim = {"at_least": "50 %", "confidence": "75 %"}
    gates = [planned_gate(3, f"slip[mass={mass}]", passes=claim) for mass in (1, 2)]
    outcomes = [run for gate in gates for run in gate_results(gate, *runs_of_gate(gate, passed=3)).outcomes]
    groups = grouped_scenarios(outcomes, gates)
    assert [(group.name, len(group.outcomes)) for group in groups] == [("slip[mass=1]", 3), ("slip[mass=2]", 3)]
    assert [group.status for group in groups] == ["passed", "passed"]


def test_runs_that_are_listed() -> None:
    # Runs on several engines have one entry for each gate.
    # The runs of both alternate.
    gates = [planned_gate(29, name=f"slip [{engine}]") for engine in ("pybullet", "mujoco")]
    both = zip(*(runs_of_gate(gate, passed=29) for gate in gates), strict=True)
    judged = over_variations([run for pair in both for run in pair], gates)
    groups = [(group.name, len(group.outcomes), group.is_part) for group in grouped_scenarios(judged, gates)]
    assert groups == [(gate.name, 29, False) for gate in gates]
    # Runs beyond an early decision are not listed.
    # Shards run all samples of a gate, and `merge` counts up to the decision.
    planned = planned_gate(100, stop_early={"reject": "85 %", "accept": "95 %"})
    (group,) = grouped_scenarios(gate_results(planned, *runs_of_gate(planned, passed=2, failed=98)).outcomes)
    assert group.gate is not None
    assert group.gate.statistics is not None
    assert group.rate_text.startswith("2 of 5 runs passed")
    assert group.not_passed_text == "3 runs failed"
