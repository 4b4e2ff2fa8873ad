from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from sim_action.recording.replay.replay_data import write_replay
from sim_action.reports import ReportOptions
from sim_action.reports.github.job_summary import MAX_BYTES, summary, write_summary
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.replays import replay, signal
from tests.reports.samples import SAMPLES, results_of
from tests.soak import examples

ON_GITHUB = {"GITHUB_SERVER_URL": "https://github.com", "GITHUB_REPOSITORY": "a/b", "GITHUB_SHA": "c0ffee"}


def test_golden(kind: str, options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden(f"{kind}.md", summary(SAMPLES[kind], replace(options, environment=ON_GITHUB)))


def test_appends_to_the_file(options: ReportOptions, tmp_path: Path) -> None:
    file = tmp_path / "summary.md"
    file.write_text("before\n")
    write_summary(SAMPLES["passed"], replace(options, environment={"GITHUB_STEP_SUMMARY": str(file)}))
    assert file.read_text(encoding="utf-8").startswith("before\n## ✅ The scenario passed\n")
    # Without a file, it writes nothing.
    write_summary(SAMPLES["passed"], options)
    assert list(tmp_path.iterdir()) == [file]


def test_the_summary_fits_the_worst_first(options: ReportOptions) -> None:
    # Worst first.
    kinds = ("passed", "warning", "failed", "crash")
    outcomes = [like(SAMPLES[kind].outcomes[0], name=kind) for kind in kinds]
    headings = [line for line in summary(results_of(*outcomes), options).splitlines() if line.startswith("### ")]
    assert headings == ["### 💥 crash", "### ❌ failed", "### ⚠️ warning", "### ✅ passed"]
    # 500 scenarios fit failures first.
    passed = like(SAMPLES["passed"].outcomes[0], output="x" * 10_000)
    failed = SAMPLES["failed"].outcomes[0]
    failing = [like(failed, name=f"failing {number}") for number in range(100)]
    text = summary(results_of(*[passed] * 400, *failing), options)
    assert len(text.encode()) < MAX_BYTES
    assert all(f"### ❌ failing {number}\n" in text for number in range(100))
    assert text.index("### ❌ failing 99") < text.index("### ✅")
    assert "more scenarios are not shown" in text
    assert "<summary>400 scenarios passed</summary>" in text
    assert summary(SAMPLES["failed"], options, most_bytes=100) == ""


def test_details_are_closed(kind: str, options: ReportOptions) -> None:
    tokens = MarkdownIt("commonmark").enable("table").parse(summary(SAMPLES[kind], options))
    html = "".join(token.content for token in tokens if token.type == "html_block")
    assert html.count("<details>") == html.count("</details>")


@pytest.mark.parametrize("count", [1, 3, 20_000])
def test_what_is_huge_fits(count: int, options: ReportOptions, tmp_path: Path) -> None:
    file = tmp_path / "summary.md"
    file.write_text("x" * 500_000)
    failures = tuple(Failure(kind="script", title="t", message="|" * 9_000, details="`" * 90_000) for _ in range(30))
    outcome = Outcome(name="n" * 120, file="f", status="error", failures=failures, output="#" * 64_000)
    write_summary(results_of(*[outcome] * count), replace(options, environment={"GITHUB_STEP_SUMMARY": str(file)}))
    assert 500_000 < file.stat().st_size <= MAX_BYTES


@settings(examples(50), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(text=st.one_of(st.text(), st.text(alphabet="|`<>@#[]()\n\r\\_* ")))
def test_hostile_text_changes_no_structure(text: str, options: ReportOptions) -> None:
    def structure(hostile: str) -> list[str]:
        outcome = SAMPLES["failed"].outcomes[0]
        expectations = tuple(
            like(expected, name=hostile, verdict=replace(expected.verdict, message=hostile))
            for expected in outcome.expectations
        )
        changed = {"name": hostile, "expectations": expectations, "notes": (hostile,), "output": f"a{hostile}"}
        tokens = MarkdownIt("commonmark").enable("table").parse(summary(results_of(like(outcome, **changed)), options))
        return [token.type for token in tokens]

    assert structure(f"a{text}") == structure("a")


def with_replays(results: Results, options: ReportOptions, name: str = "distance to the wall") -> Results:
    """The same, with a replay of each run, in which every expectation has a curve."""
    path = "replays/all.json.gz"
    curves = (signal(name, [0.0, 0.5, 1.0, 1.12], expectation=number, lower=1.5) for number in range(4))
    write_replay(replay(*curves), options.folder / path)
    return like(results, outcomes=tuple(like(outcome, replay=path) for outcome in results.outcomes))


def test_failures_are_drawn_up_to_a_number(options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden("charts.md", summary(with_replays(SAMPLES["failed"], options), replace(options, environment=ON_GITHUB)))
    # What failed is drawn and what held is not.
    text = summary(with_replays(SAMPLES["failed"], options), options)
    wall, straight = text.split("### ❌ ")[1:]
    assert (wall.count("```mermaid"), straight.count("```mermaid")) == (2, 1)
    assert "mermaid" not in summary(with_replays(SAMPLES["passed"], options), options)
    # A page has few charts however many fail.
    failed = SAMPLES["failed"].outcomes[0]
    outcomes = [like(failed, name=f"failing {number}") for number in range(100)]
    text = summary(with_replays(results_of(*outcomes), options), options)
    assert text.count("```mermaid") == 16
    assert text.index("### ❌ failing 8\n") > text.rindex("```mermaid")
    assert len(text.encode()) < MAX_BYTES


@settings(examples(25), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(name=st.text(min_size=1, max_size=200).filter(lambda text: text.encode(errors="ignore").decode() == text))
def test_the_name_of_a_curve_ends_no_chart(name: str, options: ReportOptions) -> None:
    text = summary(with_replays(SAMPLES["failed"], options, name), options)
    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    fences = [token for token in tokens if token.type == "fence" and token.info == "mermaid"]
    assert [len(fence.content.splitlines()) for fence in fences] == [7, 7, 7]
