"""Workflows: what starts them, which of their jobs run, and what becomes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.github import JobResult, UnsupportedFeature, run_workflow
from tests.integration.github.conftest import CHECKOUT, Perform, job, results, workflow


def test_jobs_wait_for_what_they_need(perform: Perform) -> None:
    jobs = job("last", needs="[middle, first]") + job("middle", needs="first") + job("first")
    result = perform(workflow(jobs))
    assert list(result.jobs) == ["first", "middle", "last"]
    assert result.conclusion == "success"


def test_a_failure_skips_all_that_depends_on_it(perform: Perform) -> None:
    jobs = job("a", "exit 1") + job("b", needs="a") + job("c", needs="b") + job("d")
    result = perform(workflow(jobs))
    assert results(result) == {"a": "failure", "b": "skipped", "c": "skipped", "d": "success"}
    assert result.conclusion == "failure"


def test_status_of_jobs_is_that_of_all_ancestors(perform: Perform) -> None:
    jobs = job("a", "exit 1") + job("b", needs="a", **{"if": "always()"}) + job("c", needs="b")
    jobs += job("d", needs="b", **{"if": "failure()"}) + job("e", needs="c", **{"if": "${{ !cancelled() }}"})
    jobs += job("f", needs="[a, b]", **{"if": "always() && needs.b.result == 'success'"})
    result = perform(workflow(jobs))
    expected = ["failure", "success", "skipped", "success", "success", "success"]
    assert results(result) == dict(zip("abcdef", expected, strict=True))


def test_a_gate_sees_every_result(perform: Perform) -> None:
    script = "\"echo '${{ join(needs.*.result, ' ') }}'\""
    jobs = job("a") + job("b", "exit 1") + job("gate", script, needs="[a, b]", **{"if": "always()"})
    assert perform(workflow(jobs)).jobs["gate"].log.endswith("success failure\n")


def test_outputs_go_from_step_to_job_to_job(perform: Perform) -> None:
    jobs = """
  plan:
    runs-on: ubuntu-latest
    outputs: {answer: "${{ steps.plan.outputs.answer }}", none: "${{ steps.plan.outputs.none }}"}
    steps:
      - id: plan
        run: echo answer=42 >> "$GITHUB_OUTPUT"; exit 1
  use:
    needs: plan
    if: ${{ always() && needs.plan.outputs.answer == '42' }}
    runs-on: ubuntu-latest
    steps:
      - run: echo "<$ANSWER>"
        env: {ANSWER: "${{ needs.plan.outputs.answer }}${{ needs.plan.outputs.none }}"}
"""
    result = perform(workflow(jobs))
    assert result.jobs["plan"].outputs == {"answer": "42", "none": ""}
    assert result.jobs["use"].runs[0].log == "<42>\n"


def test_time_runs_out_for_jobs(perform: Perform) -> None:
    jobs = job("a", "sleep 60", timeout_minutes="0.005") + "      - run: true\n      - {run: echo, if: failure()}\n"
    result = perform(workflow(jobs + job("b", needs="a") + job("c", needs="a", **{"if": "${{ !cancelled() }}"})))
    assert [step.outcome for step in result.jobs["a"].steps] == ["cancelled", "skipped", "skipped"]
    assert results(result) == {"a": "cancelled", "b": "skipped", "c": "success"}
    assert result.conclusion == "cancelled"


def test_logs_summaries_and_annotations_are_kept_by_job(perform: Perform) -> None:
    jobs = job("a", 'echo "# a" >> "$GITHUB_STEP_SUMMARY"; echo ::notice::a') + job("b", "echo b")
    result = perform(workflow(jobs))
    assert (result.jobs["a"].summary, result.jobs["b"].summary) == ("# a\n", "")
    assert [annotation.message for annotation in result.jobs["a"].annotations] == ["a"]
    assert result.log == "[a: success]\n::notice::a\n[b: success]\nb\n"


def test_a_job_can_be_taken_as_done(perform: Perform) -> None:
    text = workflow(job("a", "exit 1") + job("b", "echo ${{ needs.a.outputs.x }}", needs="a"))
    result = perform(text, done={"a": JobResult("success", {"x": "given"})})
    assert results(result) == {"a": "success", "b": "success"}
    assert result.jobs["b"].runs[0].log == "given\n"
    with pytest.raises(UnsupportedFeature, match="typo"):
        perform(text, done={"typo": JobResult("success")})


@pytest.mark.parametrize("on", ["push", "[pull_request, push]", "{push: {branches: [main]}, pull_request: }"])
def test_events_start_workflows(perform: Perform, on: str) -> None:
    jobs = job("a", "echo ${{ github.event_name }} ${{ github.ref }} $GITHUB_BASE_REF")
    assert perform(workflow(jobs, f"on: {on}")).runs[0].log == "push refs/heads/main\n"
    with pytest.raises(UnsupportedFeature, match="does not start"):
        perform(workflow(jobs, f"on: {on}"), event_name="schedule")


def test_pull_requests_have_refs_of_their_own(perform: Perform) -> None:
    jobs = job("a", "echo ${{ github.ref }} $GITHUB_HEAD_REF $GITHUB_BASE_REF ${{ github.event.number }}")
    result = perform(workflow(jobs, "on: pull_request"), event_name="pull_request", event={"number": 1})
    assert result.runs[0].log == "refs/pull/1/merge change main 1\n"


def test_names_and_ids_of_runs(perform: Perform) -> None:
    text = "on: push\nname: mine\nconcurrency: {group: 'x-${{ github.run_id }}', cancel-in-progress: true}\n"
    jobs = job("a", "echo ${{ github.workflow }} $GITHUB_JOB ${{ github.run_id }}", name="job ${{ github.ref_name }}")
    first, second = (perform(f"{text}jobs:\n{jobs}").runs[0] for _ in range(2))
    assert first.name == "job main"
    assert first.log.startswith("mine a ")
    assert first.log != second.log


@pytest.mark.parametrize(
    "text",
    [
        workflow(job("a", needs="b")),
        workflow(job("a", needs="b") + job("b", needs="a")),
        workflow(job("a", container="alpine")),
        workflow(job("a", services="{}")),
        workflow(job("a", environment="x")),
        workflow(job("a").replace("ubuntu-latest", "self-hosted")),
        workflow(job("a").replace("ubuntu-latest", "[ubuntu-latest, big]")),
        workflow(job("a").replace("ubuntu-latest", "windows-latest")),
        workflow(job("a", defaults="{run: {shell: pwsh}}")),
        workflow(job("a", **{"if": "matrix.x"})),
        workflow(job("a", **{"if": "env.x"})),
        workflow(job("a", **{"if": "needs.b.result == 'success'"})),
        workflow(job("a", env="{A: '${{ runner.os }}'}")),
        workflow(job("a", env="{A: '${{ secrets.MINE }}'}")),
        workflow(job("a", "true\n        env: {A: '${{ github.token }}'}")),
        workflow(job("a", "true\n        typo: 1")),
        workflow(job("a", "true\n        env: {A: '${{ job.status }}'}")),
        workflow(job("a", "true\n        timeout-minutes: 1")),
        workflow(job("a", permissions="{everything: write}")),
        workflow(job("a", permissions="{contents: maybe}")),
        workflow(job("a", permissions="read-all")),
        workflow(job("a", timeout_minutes="'5'")),
        workflow(job("a", continue_on_error="true")),
        workflow(job("a", concurrency="x")),
        workflow(job("a"), "on: push\nconcurrency: {group: x, typo: 1}"),
        workflow(job("a"), "on: push\nconcurrency: ${{ runner.os }}"),
        workflow(job("a"), "on: push\nenv: {A: b}"),
        workflow(job("a"), "on: {push: , workflow_run: }"),
        workflow(job("a"), "on: push\ntypo: 1"),
        workflow(job("a"), "on: {push: {typo: 1}}"),
        workflow("  a: {uses: ./.github/workflows/main.yml, secrets: inherit}"),
        workflow("  a: {uses: octocat/robots/.github/workflows/main.yml@v1}"),
        workflow("  a: {runs-on: ubuntu-latest}"),
    ],
)
def test_what_is_not_known_is_refused(perform: Perform, text: str) -> None:
    with pytest.raises(UnsupportedFeature):
        perform(text)


def test_a_workflow_is_run_from_where_it_is(repository: Path, tmp_path: Path) -> None:
    file = tmp_path / "elsewhere.yml"
    (repository / ".github/CODEOWNERS").touch()
    file.write_text(workflow(job("a", "ls -A") + f"      - uses: {CHECKOUT}\n      - run: ls -A\n"), encoding="utf-8")
    result = run_workflow(file, repository, temp=tmp_path / "run")
    assert result.runs[0].log == ".git\n.github\n"


def test_a_schedule_is_a_list_of_times(perform: Perform) -> None:
    on = "on: {schedule: [{cron: '23 3 * * *'}, {cron: '5 4 * * 1', timezone: Europe/Berlin}], workflow_dispatch: }"
    assert perform(workflow(job("a"), on), event_name="schedule").conclusion == "success"
    with pytest.raises(UnsupportedFeature, match="corn"):
        perform(workflow(job("a"), on.replace("cron", "corn")), event_name="schedule")


def test_an_event_without_inputs_has_empty_ones(perform: Perform) -> None:
    jobs = job("a", "echo '<${{ inputs.nothing }}>'", **{"if": "${{ !inputs.nothing }}"})
    assert perform(workflow(jobs)).runs[0].log == "<>\n"
