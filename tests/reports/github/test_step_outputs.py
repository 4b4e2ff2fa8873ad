from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.reports import ReportOptions
from sim_action.reports.github.step_outputs import outputs, write_outputs
from tests.outcomes import like
from tests.reports.samples import SAMPLES
from tests.soak import examples


def read_back(text: str) -> dict[str, str]:
    """As the runner reads the file."""
    entries: dict[str, str] = {}
    lines = iter(text.split("\n")[:-1])
    for line in lines:
        name, delimiter = line.split("<<", 1)
        value = []
        while (part := next(lines)) != delimiter:
            value.append(part)
        entries[name] = "\n".join(value)
    return entries


def test_what_later_steps_can_ask_for(options: ReportOptions, tmp_path: Path) -> None:
    file = tmp_path / "output"
    file.write_text("before<<x\n1\nx\n")
    write_outputs(SAMPLES["failed"], replace(options, environment={"GITHUB_OUTPUT": str(file)}))
    assert read_back(file.read_text()) == {
        "before": "1",
        "conclusion": "failure",
        "total": "3",
        "passed": "1",
        "failed": "2",
        "flaky": "0",
        "inconclusive": "0",
        "not-exercised": "0",
        "errors": "0",
        "skipped": "0",
        "output-directory": str(tmp_path / "sim-results"),
        "junit-path": str(tmp_path / "sim-results" / "junit.xml"),
        "results-path": str(tmp_path / "sim-results" / "results.json"),
        "report-path": str(tmp_path / "sim-results" / "report.html"),
        "report-fragment": "",
        "travelled": "",
        "duration": "1.250",
        "real-time-factor": "28.16",
    }


def test_the_report_opens_at_what_decided_why_the_worst_scenario_failed(options: ReportOptions) -> None:
    replayed = [like(outcome, replay="replays/a.json.gz") for outcome in SAMPLES["cut"].outcomes]
    found = like(SAMPLES["cut"], outcomes=(*SAMPLES["passed"].outcomes, *replayed))
    assert outputs(found, options)["report-fragment"] == "#scenario=burger%20hits%20the%20wall&t=3.2"
    passed = like(found, outcomes=found.outcomes[:1])
    assert outputs(passed, options)["report-fragment"] == ""
    told = outputs(found, replace(options, silenced=frozenset({"report"})))
    assert (told["report-path"], told["report-fragment"]) == ("", "")
    [parted] = [like(outcome, replay="replays/a.json.gz") for outcome in SAMPLES["flaky"].outcomes[1:2]]
    flaky = like(found, outcomes=(*SAMPLES["passed"].outcomes, parted))
    assert outputs(flaky, options)["report-fragment"] == "#scenario=burger%20wanders&t=0.3"


def test_travelled_and_conclusions(options: ReportOptions) -> None:
    # Travelled of one scenario.
    assert outputs(SAMPLES["passed"], options)["travelled"] == "1.5012"
    assert outputs(SAMPLES["crash"], options)["travelled"] == ""
    # Conclusions.
    conclusions = {kind: outputs(results, options)["conclusion"] for kind, results in SAMPLES.items()}
    assert conclusions["passed"] == conclusions["warning"] == "success"
    assert conclusions["crash"] == conclusions["invalid"] == "failure"
    assert conclusions["interrupted"] == "cancelled"


@settings(examples(50), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(folder=st.text(st.characters(exclude_characters="\0\r", exclude_categories=["Cs"]), min_size=1))
def test_no_path_forges_an_output(folder: str, options: ReportOptions, tmp_path: Path) -> None:
    file = tmp_path / "output"
    file.write_text("")
    environment = {"GITHUB_OUTPUT": str(file)}
    write_outputs(SAMPLES["passed"], replace(options, junit=Path(folder), environment=environment))
    read = read_back(file.read_bytes().decode())
    assert set(read) == set(outputs(SAMPLES["passed"], options))
    assert read["junit-path"] == str(Path(folder).absolute())


def test_delimiters_are_not_to_be_guessed(options: ReportOptions, tmp_path: Path) -> None:
    file = tmp_path / "output"
    write_outputs(SAMPLES["passed"], replace(options, environment={"GITHUB_OUTPUT": str(file)}))
    delimiters = re.findall(r"<<(.+)", file.read_text())
    assert len(delimiters) == len(set(delimiters))
    # Without a file, nothing is written.
    write_outputs(SAMPLES["passed"], options)
    assert list(tmp_path.iterdir()) == [file]
